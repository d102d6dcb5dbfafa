# Completion of the command sprag in bash: its programs; the options and choices in the --help of each; the scenes
# that are shipped with Sprag; and files of the working directory.
_sprag() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[0]} words files=
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    words=$("$command" --help | sed -n 's/^  \([a-z_]*\)  .*/\1/p'; echo scenes --help --version)
  elif [[ ${COMP_WORDS[1]} != scenes ]]; then
    local help
    help=$("$command" "${COMP_WORDS[1]}" --help 2> /dev/null)
    if [[ $word == -* ]]; then
      words=$(sed -n 's/^  \(-[a-z],\)\?\(--[a-z-]*\).*/\2/p' <<< "$help")
    elif [[ $before == --* ]]; then
      words=$(sed -n "s/^  $before \([a-z0-9]*|[a-z0-9|]*\).*/\1/p" <<< "$help" | tr '|' ' ')
    else
      local part='/^Studies/,$d'
      if [[ ${COMP_WORDS[1]} == study ]]; then part='1,/^Studies/d'; fi
      words=$("$command" scenes 2> /dev/null | sed -n "$part; s/^  \([a-z0-9_]*\) .*/\1/p")
      files=yes
      compopt -o filenames 2> /dev/null || true
    fi
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word"; [[ ! $files ]] || compgen -f -- "$word")
}
complete -o default -F _sprag sprag
