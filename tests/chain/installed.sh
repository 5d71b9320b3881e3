#!/bin/bash
# The installed programs as a stranger uses them: the staged tree moved elsewhere, far from the build folder. Data and firmware
# are found, manual pages render and name every option, completions offer every option, one version is said everywhere,
# uninstall leaves nothing.   usage: installed.sh BUILD
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$(cd "$1" && pwd)
export LC_ALL=C.UTF-8
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "installed: $1" >&2; exit 1; }
run_make() { MAKEFLAGS='' "${MAKE:-make}" -s B="$build" PREFIX=/opt/sf DESTDIR="$work/stage" "$@"; }

mkdir -p "$work/stage/opt/sf/share/man/man1"
echo theirs >"$work/stage/opt/sf/share/man/man1/other.1"
run_make install
cp -r "$work/stage/opt/sf" "$work/moved"
at=$work/moved
mapfile -t programs < <(cd "$build/bin" && find . -maxdepth 1 -type f -perm -u+x ! -name sf_gen ! -name 'fuzz_*' -printf '%f\n' | sort)
[ "${#programs[@]}" -ge 10 ] || fail "no programs in $build/bin"
[ "$(ls "$at/bin")" = "$(printf '%s\n' "${programs[@]}")" ] || fail "other programs are installed than those of $build/bin"

# ---- one version ----

version=$(sed -n 's/^#define SPIKEFIELD_VERSION_[A-Z]* \([0-9]*\).*/\1/p' include/spikefield/spikefield.h | paste -sd.)
[[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]] || fail "spikefield.h has no version: '$version'"
says() { [ "$2" = "$version" ] || fail "$1 says version '$2', include/spikefield/spikefield.h says $version"; }
for p in "${programs[@]}"; do
  said=$("$at/bin/$p" --version)
  says "$p --version" "${said#"$p (spikefield) "}"
  says "the completion of $p" "$(sed -n "s/^# Completion of $p \([^ ]*\) for bash.*/\1/p" "$at/share/bash-completion/completions/$p")"
done
says share/spikefield "$(cat "$at/share/spikefield/VERSION")"
says spikefield.pc "$(sed -n 's/^Version: //p' "$at/lib/pkgconfig/spikefield.pc")"
says CHANGELOG.md "$(sed -n '0,/^## /s/^## \([0-9.]*\).*/\1/p' CHANGELOG.md)"
says "the shared library's name" "$(basename "$(readlink -f "$at/lib/libspikefield.so")" | sed 's/^libspikefield\.so\.//')"
soname=$(readelf -d "$at/lib/libspikefield.so" | sed -n 's/.*SONAME.*\[libspikefield\.so\.\(.*\)\]/\1/p')
[ "$soname" = "${version%%.*}" ] || fail "soname $soname of version $version"

# ---- programs: nothing in them points into the build folder but what a debugger reads ----

for p in "${programs[@]}"; do
  strip -o "$work/stripped" "$at/bin/$p"
  if grep -qaF -e "$build" "$work/stripped"; then fail "$p depends on $build"; fi
  if readelf -d "$at/bin/$p" | grep -E 'RPATH|RUNPATH'; then fail "$p looks for libraries in a folder of its own"; fi
done
"$build/faults/make_scene" "$work/s.snn"
cd "$work"
export PATH=$at/bin:$PATH
sf_scene simple -o data --size 16 --train 2 --test 1 --quiet || fail "sf_scene"
sf_train --help >help.txt && grep -q -e --minutes help.txt || fail "sf_train --help"
energy_audit s.snn data --rays 5 --rtl-rays 1 --tech 45nm --json --quiet >audit.json || fail "energy_audit --tech 45nm"
grep -q '"45 nm CMOS' audit.json || fail "energy_audit did not use the installed prices"
mv "$at/share/spikefield/tech" tech # and from nowhere else
if energy_audit s.snn data --rays 5 --rtl-rays 0 --tech 45nm --json --quiet >audit.json 2>err; then fail "prices come from elsewhere"; fi
grep -qF "$at/share/spikefield/tech/45nm.tech" err || fail "the missing file is not named: $(cat err)"
mv tech "$at/share/spikefield/tech"
if [ -e "$at/bin/sf_soc" ] && [ -e "$at/lib/spikefield/sf_firmware.elf" ]; then
  sf_soc s.snn data --crop 7,7,2,2 --quiet --json >soc.json || fail "sf_soc does not find its firmware"
else
  echo "firmware: not installed"
fi
: >top.sv
if sf_cosim s.snn data --dut top.sv 2>err; then fail "sf_cosim --dut works without a build folder"; fi
grep -qF "$at is not the build folder of a source tree" err || fail "sf_cosim --dut does not say what is missing: $(cat err)"

# ---- manual pages and completions ----

options_of() { "$1" --help | sed -n -E 's/^ +(-[a-zA-Z], )?(--[a-z0-9-]+)( .*)?$/\2/p' | sort -u; }
pages() {
  for p in "${programs[@]}"; do
    man --warnings -E UTF-8 -l -Tutf8 "$at/share/man/man1/$p.1" >page 2>err || fail "man cannot read the page of $p: $(cat err)"
    [ ! -s err ] || fail "the page of $p: $(head -n 1 err)"
    sed -E 's/\x1b\[[0-9;]*m//g; s/.\x08//g' page >plain
    grep -q "^NAME" plain && grep -qE "^ +$p +- +[a-z]" plain || fail "the page of $p does not begin with its name"
    for option in $(options_of "$p"); do grep -qE -e "(^|[ ,])$option( |=|,|$)" plain || fail "the page of $p lacks $option"; done
    says "the page of $p" "$(sed -n 's/^\.TH [^"]*"1" "[^"]*" "spikefield \([^"]*\)".*/\1/p' "$at/share/man/man1/$p.1")"
  done
  [ "$(man -M "$at/share/man" -w sf_train)" = "$at/share/man/man1/sf_train.1" ] || fail "man does not find sf_train"
}
if [ -z "$(ls "$at/share/man/man1" | grep -v other.1)" ]; then echo "help2man: not installed"
elif ! command -v man >/dev/null; then echo "man: not installed"
else pages; fi

# completed PROGRAM WORD...: what bash offers for the last word
completed() {
  bash --norc -euc 'source "$1/$2"; shift; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
    function=$(complete -p "$1" | sed "s/.*-F \([^ ]*\) .*/\1/"); "$function" "$1" "${@: -1}" "${@: -2:1}" 2>/dev/null || true
    printf "%s\n" "${COMPREPLY[@]}"' completed "$at/share/bash-completion/completions" "$@"
}
for p in "${programs[@]}"; do
  diff <(options_of "$p") <(completed "$p" -- | sort -u) || fail "the completion of $p offers other options than its --help"
done
offers() { [ "$(completed "${@:2}" | sort | tr '\n' ' ')" = "$1 " ] || fail "${*:2}: offered $(completed "${@:2}" | tr '\n' ' '), not $1"; }
offers "ann snn" sf_train --net ''
offers "snn" sf_train --net s
offers "snn" sf_train --net = s
offers "ann snn" sf_train --net =
offers "data" sf_train da
offers "s.snn" energy_audit data --tech s.
offers "" sf_train --minutes ''
offers "textured" sf_scene tex

# ---- and away again ----

cd - >/dev/null
run_make uninstall
left=$(cd "$work/stage" && find . ! -type d -o -name '*spikefield*')
[ "$left" = ./opt/sf/share/man/man1/other.1 ] || fail "uninstall leaves, or takes too much: $left"
if run_make install DATADIR=/elsewhere >"$work/out" 2>&1; then fail "DATADIR where no program looks is accepted"; fi
grep -qF "DATADIR has to be" "$work/out" || fail "$(cat "$work/out")"
echo "installed: ok"
