#!/bin/bash
# Widths of a variant build. Copies include/spikefield/arch.def into the build folder with other values; the copy is found
# before the original, by C, by sf_gen (hence by the RTL) and by the firmware. An unchanged copy keeps its time.
# usage: arch.sh BUILD NAME=VALUE...
set -eu
build=$1 source=include/spikefield/arch.def target=$1/include/spikefield/arch.def
shift
mkdir -p "${target%/*}"
new=$(mktemp "$target.XXXXXX")
trap 'rm -f "$new" "$new.next"' EXIT
cp "$source" "$new"
for setting in "$@"; do
  if ! [[ $setting =~ ^([A-Z_0-9]+)=([0-9]{1,4})$ ]] || ! grep -q "^SF_ARCH(${BASH_REMATCH[1]}, " "$source"; then
    echo "ARCH: '$setting': expected NAME=VALUE with a name of $source" >&2
    exit 1
  fi
  if [ "${BASH_REMATCH[1]}" = MEMBRANE_BITS ]; then # the RTL, the vector kernels and the packed taps are written for 24 bits
    echo "ARCH: '$setting': MEMBRANE_BITS is no parameter, membranes have 24 bits; AC_FRAC and LEAK_FRAC can be changed" >&2
    exit 1
  fi
  sed -E "s/^(SF_ARCH\(${BASH_REMATCH[1]}, )[^,]+/\1${BASH_REMATCH[2]}/" "$new" >"$new.next"
  mv "$new.next" "$new"
done
cmp -s "$new" "$target" || mv "$new" "$target"
echo "$*" >"$build/arch"
