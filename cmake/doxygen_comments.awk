# Doxygen filter of headers: converts plain comments. The first block documents the file. A comment above
# declarations documents all of them up to the next blank line or comment, also after the body of a
# type. A comment after a declaration documents that declaration.

# Escapes text that Doxygen would read as a command, a tag or the end of a list.
function plain(text) {
  gsub(/\\/, "\\\\\\\\", text)
  gsub(/@/, "\\@", text)
  gsub(/</, "\\&lt;", text)

  gsub(/ \.\.( |$)/, " \\&hellip; ", text)
  return text
}

function is_comment(text) { return text ~ /^ *\/\/( |$)/ }
function is_label(text) { return text ~ /^ *(public|private|protected):/ }
function indentation(text) { match(text, /^ */); return RLENGTH }

# Returns the last line of the group of declarations below a comment, from line `first` on; 0 if there is
# only one declaration or if one has a body of several lines.
function end_of_group(first,    n, last, ends, width) {
  width = indentation(line[first])
  for (n = first; n <= count; n++) {
    if (line[n] ~ /^ *$/ || is_comment(line[n]) || is_label(line[n]) || line[n] ~ /^ *#/ ||
        indentation(line[n]) < width) break
    if (line[n] ~ /[{([] *$/ || line[n] ~ /^ *}/) {
      if (line[n] !~ /[([] *$/) return 0
    }
    if (line[n] ~ /[;}]( *\/\/.*)?$/) { ends++; last = n }
  }
  return ends > 1 ? last : 0
}

{ line[++count] = $0 }

END {
  n = 1
  if (line[1] ~ /^\/\//) {
    print "/// \\file"
    for (; is_comment(line[n]); n++) print "///" plain(substr(line[n], 3))
  }
  group_end = 0
  behind = 0  # column of a comment after a declaration, which the next lines may continue
  # above[width]: comment above the type whose body is open at that indentation
  for (; n <= count; n++) {
    text = line[n]
    if (is_comment(text)) {
      at = index(text, "//")
      if (behind && at == behind) {
        print substr(text, 1, at - 1) "///<" plain(substr(text, at + 2))
        continue
      }
      behind = 0
      if (!is_comment(line[n - 1])) {
        for (first = n; is_comment(line[first]); first++) continue
        group_end = end_of_group(first)
        if (group_end) print "///@{"
        block = ""
      }
      documented = substr(text, 1, at - 1) "///" plain(substr(text, at + 2))
      print documented
      block = block documented "\n"
      continue
    }
    behind = 0
    if (text !~ /^}/ && match(text, /[;,{}a-zA-Z0-9] +\/\/ /)) {
      behind = RSTART + RLENGTH - 3
      # After an enumeration in one line, Doxygen would assign the comment to its last value.
      if (text ~ /^ *enum .*};/) {
        print "///" plain(substr(text, behind + 2))
        text = substr(text, 1, behind - 1)
        behind = 0
      } else
        text = substr(text, 1, behind - 1) "///<" plain(substr(text, behind + 2))
    }
    print text
    width = indentation(text)
    if (text ~ /^ *(struct|class|enum) .*{$/) above[width] = is_comment(line[n - 1]) ? block : ""
    if (n == group_end) {
      print "///@}"
      group_end = 0
    }
    if (text ~ /^ *};/ && above[width] != "" && line[n + 1] !~ /^ *$/ && line[n + 1] !~ /^ *}/ &&
        !is_comment(line[n + 1]) && !is_label(line[n + 1])) {
      group_end = end_of_group(n + 1)
      if (group_end) print "///@{"
      printf "%s", above[width]
    }
  }
}
