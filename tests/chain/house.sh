#!/bin/bash
# The checks of the house see what they are for: a small house, in order and with each fault planted.
# usage: house.sh BUILD
set -euo pipefail
for need in python3 git; do
  command -v $need >/dev/null || { echo "house: skipped: $need is not installed"; exit 77; }
done
cd "$(dirname "$0")/../.."
tools=$PWD/tools
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "house: $1" >&2; exit 1; }
cd "$work"
git init -q .

house() { # the house in order: src/up calls src/low
  rm -rf README.md src build
  mkdir -p src/low src/up build/obj/src/low build/obj/src/up
  printf '# x\n\n## Map of the house\n\n    src/low/   below\n    src/up/    above it\n\n## End\n' >README.md
  echo 'int low(void);' >src/low/low.h
  printf '#include "low/low.h"\nint low(void) { return 1; }\n' >src/low/low.c
  printf '#include "low/low.h"\nint up(void) { return low(); }\n' >src/up/up.c
}
build() { for file in src/*/*.c; do gcc -Isrc -c "$file" -o "build/obj/${file%.c}.o"; done; }
expect() { # PATTERN: the check fails and says so
  build
  ! "$tools/check_rooms.py" build 2>said || fail "not seen: $1"
  grep -q -- "$1" said || { cat said >&2; fail "not named: $1"; }
}

house && build
"$tools/check_rooms.py" build || fail "a house in order is refused"
echo 'int up(void);' >src/up/up.h && sed -i '1i #include "up/up.h"' src/low/low.c
expect 'src/low/low.c: includes src/up/up.h, which stands below it'
house
printf 'int up(void);\nint low(void) { return up(); }\n' >src/low/low.c && printf 'int up(void) { return 1; }\n' >src/up/up.c
expect 'src/low/low.c: calls up of src/up/up.c, which stands below it'
house
printf 'int low(void);\nint other(void) { return low(); }\n' >src/low/other.c
printf 'int other(void);\nint low(void) { return other(); }\n' >src/low/low.c
expect 'a circle of calls: src/low/low.c, src/low/other.c'
house
printf '#ifndef O\n#define O\n#include "low/low.h"\n#endif\n' >src/low/other.h
printf '#ifndef L\n#define L\n#include "low/other.h"\nint low(void);\n#endif\n' >src/low/low.h
expect 'a circle of includes: src/low/low.h, src/low/other.h'
house
mkdir -p src/shed build/obj/src/shed && echo 'int shed;' >src/shed/shed.c
expect "src/shed/shed.c: in no room"

printf 'Short. %s end.\n' "$(printf 'word %.0s' {1..40})" >long.md
! "$tools/check_prose.py" long.md 2>said || fail "a sentence of 41 words is accepted"
grep -q 'long.md:1: a sentence of 41 words' said || fail "a long sentence is not named"
printf '| %s |\n\n    %s\n' "$(printf 'word %.0s' {1..40})" "$(printf 'word %.0s' {1..40})" >table.md
"$tools/check_prose.py" table.md || fail "tables and code count as sentences"

printf '# A heading, here\n\n[itself](#a-heading-here) and [beside](long.md), `src/fx/plif.c`, `tests/*.c`\n' >links.md
"$tools/check_links.py" links.md || fail "links that lead somewhere are refused"
linked() { # LINE PATTERN: a line that leads nowhere, and what is said of it
  echo "$1" >links.md
  ! "$tools/check_links.py" links.md 2>said || fail "not seen: $1"
  grep -q -- "links.md:1: $2" said || { cat said >&2; fail "not named: $1"; }
}
linked '[gone](gone.md)' 'gone.md: no such file'
linked '[gone](long.md#gone)' 'long.md#gone: no heading #gone'
linked '<img src="gone.png">' 'gone.png: no such file'
linked 'the neuron is `src/fx/gone.c`' 'src/fx/gone.c: no such file in the source tree'
