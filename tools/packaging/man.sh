#!/bin/bash
# A manual page from a program's --help and --version.   usage: man.sh PROGRAM OUTPUT NAME...    NAME: of all programs
set -euo pipefail
export LC_ALL=C.UTF-8
program=$(realpath "$1") output=$2
name=$(basename "$program")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
help=$("$program" --help) # a help that fails ends it here
# The first sentence of the second paragraph; a list behind it is no part of it.
what=$(awk -v RS= 'NR == 2' <<<"$help" | tr '\n' ' ' | sed -E 's/ *([.:;] |[.:;]$| - ).*//; s/ +$//')
[ -n "$what" ] || { echo "man: $name --help has no sentence that says what it does" >&2; exit 1; }

# Examples are commands, whose lines stay as they are.
awk '/^Examples:/ { on = 1; next } on && /^[^ ]/ { on = 0 } on' <<<"$help" >"$work/examples"
{
  echo "[examples]"
  echo ".nf"
  sed 's/\\/\\e/g; s/-/\\-/g; s/^\s*/  /' "$work/examples"
  echo ".fi"
  echo "[see also]"
  for other in "${@:3}"; do [ "$other" = "$name" ] || printf '.BR %s (1),\n' "$other"; done | sed '$s/,$//'
} >"$work/include"
awk '/^Examples:/ { on = 1; next } on && /^[^ ]/ { on = 0 } !on' <<<"$help" >"$work/help"
"$program" --version >"$work/version"
cat >"$work/$name" <<'SAY'
#!/bin/sh
cat "$(dirname "$0")/${1#--}"
SAY
chmod +x "$work/$name"
help2man --no-info --section 1 --manual spikefield --source "$(sed 's/.*(//; s/)//' "$work/version")" \
  --name "${what,}" --include "$work/include" --output "$output" "$work/$name"
