# Completion of the command sprag in bash: its programs, and of each the options and the choices that
# its --help names.
_sprag() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[0]} words
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    words=$("$command" --help | sed -n 's/^  \([a-z_]*\)  .*/\1/p'; echo --help --version)
  else
    local help
    help=$("$command" "${COMP_WORDS[1]}" --help 2> /dev/null)
    if [[ $word == -* ]]; then
      words=$(sed -n 's/^  \(-[a-z],\)\?\(--[a-z-]*\).*/\2/p' <<< "$help")
    elif [[ $before == --* ]]; then
      words=$(sed -n "s/^  $before \([a-z0-9]*|[a-z0-9|]*\).*/\1/p" <<< "$help" | tr '|' ' ')
    fi
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}
complete -o default -F _sprag sprag
