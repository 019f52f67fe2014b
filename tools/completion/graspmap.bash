# Completion of graspmap for bash, with the package bash-completion. Commands, flags and their values are
# read from `graspmap --help` and `graspmap COMMAND --help`.

_graspmap_commands() {
  "$1" --help 2>/dev/null | sed -n "s/^  \([a-z][a-z-]*\) .*/\1/p"
}

# Words after `simulate`.
_graspmap_subcommands() {
  "$1" "$2" --help 2>/dev/null | sed -n '/^WHAT:/,/^$/ s/^  \([a-z][a-z-]*\) .*/\1/p'
}

# "--view top|oblique|front  from where" -> top oblique front
_graspmap_values() {
  "${@:1:$#-1}" --help 2>/dev/null |
    sed -n "s/^ *\(-[a-z],\)\?${!#} \([a-zA-Z0-9_-]*|[a-zA-Z0-9_|-]*\).*/\2/p" | tr '|' ' '
}

_graspmap() {
  local cur prev words cword split
  _init_completion -s || return
  local program=${words[0]}
  if [[ $cword -eq 1 ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(_graspmap_commands "$program") --help --version" -- "$cur")
    return
  fi
  local call=("$program" "${words[1]}")
  local subcommands
  subcommands=$(_graspmap_subcommands "${call[@]}")
  if [[ -n $subcommands ]]; then
    if [[ $cword -eq 2 ]]; then
      mapfile -t COMPREPLY < <(compgen -W "$subcommands --help" -- "$cur")
      return
    fi
    call+=("${words[2]}")
  fi
  if [[ $prev == --* ]]; then
    local values
    values=$(_graspmap_values "${call[@]}" "$prev")
    if [[ -n $values ]]; then
      mapfile -t COMPREPLY < <(compgen -W "$values" -- "$cur")
      return
    fi
  fi
  if [[ $cur == -* ]]; then
    local flags
    flags=$("${call[@]}" --help 2>/dev/null | grep -oE -e '--[a-z][a-z0-9-]*' | sort -u)
    mapfile -t COMPREPLY < <(compgen -W "$flags" -- "$cur")
    return
  fi
  _filedir
}

complete -F _graspmap graspmap
