# Doxygen filter of pages: converts equations between dollars, and links to headings by the anchors of
# web views of repositories.

# Returns the anchor of a heading, unique among all pages.
function label(heading,    page, name) {
  page = FILENAME
  gsub(/[^a-zA-Z0-9]/, "_", page)
  name = tolower(heading)
  gsub(/[^a-z0-9_ -]/, "", name)
  gsub(/ /, "-", name)
  return page "-" name
}

/^```/ { in_code = !in_code }

!in_code && /^##+ / {
  heading = $0
  sub(/^#+ +/, "", heading)
  $0 = $0 " {#" label(heading) "}"
}

!in_code {
  # Links within the page; links to another page lose their anchor.
  while (match($0, /\]\(#[a-z0-9_-]+\)/))
    $0 = substr($0, 1, RSTART + 1) "@ref " label(substr($0, RSTART + 3, RLENGTH - 4)) \
      substr($0, RSTART + RLENGTH - 1)
  gsub(/\.md#[a-z0-9_-]+\)/, ".md)")
}

{
  if (!in_code && /\$/) {
    # Display equations, then inline equations. Code spans keep their dollars.
    gsub(/\$\$/, "\001")
    count = split($0, parts, "`")
    text = ""
    for (n = 1; n <= count; n++) {
      part = parts[n]
      if (n % 2 == 1) {
        while (match(part, /\001[^\001]*\001/))
          part = substr(part, 1, RSTART - 1) "\\f[" substr(part, RSTART + 1, RLENGTH - 2) "\\f]" \
            substr(part, RSTART + RLENGTH)
        while (match(part, /\$[^$]*[^$\\]\$/)) {
          inner = substr(part, RSTART + 1, RLENGTH - 2)
          part = substr(part, 1, RSTART - 1) "\002" inner "\002" substr(part, RSTART + RLENGTH)
        }
        gsub(/\002/, "\\f$", part)
      }
      text = text (n > 1 ? "`" : "") part
    }
    gsub(/\001/, "$$", text)
    $0 = text
  }
  print
}
