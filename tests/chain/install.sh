#!/bin/bash
# The installed library as a stranger uses it: header, pkg-config file, exported names, docs/example.c linked against
# the shared and the static library, its pixels beside the golden image of sim_render.
# usage: install.sh BUILD
set -euo pipefail
build=$1
bin=$build/bin
export LC_ALL=C
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "install: $1" >&2; exit 1; }
run_make() { MAKEFLAGS='' "${MAKE:-make}" -s B="$build" "$@"; }
cc=${CC:-cc}
cxx=${CXX:-c++}
strict="-Wall -Wextra -Wpedantic -Werror"

prefix=$work/prefix
run_make install PREFIX="$prefix"
header=$prefix/include/spikefield/spikefield.h
export PKG_CONFIG_PATH=$prefix/lib/pkgconfig
version=$(printf '#include <stdio.h>\n#include "%s"\nint main(void) { return puts(SPIKEFIELD_VERSION) < 0; }\n' "$header" |
  $cc -x c - -o "$work/version" && "$work/version")
[ "$(pkg-config --modversion spikefield)" = "$version" ] || fail "the pkg-config file and the header differ in version"

# The header alone, in the dialects of its users.
[ "$(sed -n 's/^#include //p' "$header" | sort | tr '\n' ' ')" = "<stdbool.h> <stddef.h> <stdint.h> " ] ||
  fail "the header includes more than the standard's types"
cd "$work"
echo '#include <spikefield/spikefield.h>' >alone.c
# shellcheck disable=SC2046,SC2086
{
  $cc -std=c99 $strict $(pkg-config --cflags spikefield) -c alone.c -o alone.o || fail "the header as C99"
  $cxx -x c++ -std=c++11 $strict $(pkg-config --cflags spikefield) -c alone.c -o alone.o || fail "the header as C++11"
}
cd - >/dev/null

# Names: those of the header, all of them, nothing else; and nothing that prints or ends the program.
sed -n 's/^SPIKEFIELD_API.*\(spikefield_[a-z0-9_]*\)(.*/\1/p' "$header" | sort >"$work/public"
[ "$(wc -l <"$work/public")" -ge 10 ] || fail "no public names found in the header"
[ "$(grep -c '^SPIKEFIELD_API' "$header")" -eq "$(wc -l <"$work/public")" ] || fail "a declaration hides its name"
shared=$(readlink -f "$prefix/lib/libspikefield.so")
nm -D --defined-only "$shared" | awk '{ print $3 }' | sort >"$work/exported"
diff "$work/public" "$work/exported" || fail "the shared library exports other names than the header declares"
nm -g --defined-only "$prefix/lib/libspikefield.a" | awk 'NF == 3 { print $3 }' | sort >"$work/exported"
diff "$work/public" "$work/exported" || fail "the static library shows other names than the header declares"
nm -D --undefined-only "$shared" | awk '{ sub("@.*", "", $2); print $2 }' >"$work/used"
if grep -xE '_?_?exit|_Exit|quick_exit|abort|printf|vprintf|puts|putchar|perror|stdout|stderr|system|signal|sigaction|setlocale' "$work/used"
then fail "the library prints, exits or changes the process"; fi
soname=$(readelf -d "$shared" | sed -n 's/.*SONAME.*\[\(.*\)\]/\1/p')
[ "$soname" = "libspikefield.so.${version%%.*}" ] || fail "soname $soname"
[ -e "$prefix/lib/$soname" ] || fail "$soname is not installed"
if readelf -d "$shared" | grep -q TEXTREL; then fail "the shared library is not position-independent"; fi

# The golden model of benches: its own names alone, under the same rules, and each of them imported by the package.
golden=$prefix/lib/libsf_golden_dpi.so
sed -n 's/^SF_GOLDEN_API.*[ *]\(sf_golden_[a-z_]*\)(.*/\1/p' "$prefix/include/spikefield/sf_golden_dpi.h" | sort >"$work/golden"
[ "$(wc -l <"$work/golden")" -ge 10 ] || fail "no names found in sf_golden_dpi.h"
nm -D --defined-only "$golden" | awk '{ print $3 }' | sort | diff "$work/golden" - || fail "libsf_golden_dpi.so exports other names than its header declares"
sed -n 's/.*import "DPI-C" function.* \(sf_golden_[a-z_]*\)(.*/\1/p' "$prefix/share/spikefield/sf_golden_dpi.sv" | sort | diff "$work/golden" - ||
  fail "sf_golden_dpi.sv imports other functions than the header declares"
nm -D --undefined-only "$golden" | awk '{ sub("@.*", "", $2); print $2 }' >"$work/used"
if grep -xE '_?_?exit|_Exit|abort|printf|vprintf|puts|putchar|perror|stdout|stderr|system|signal|sigaction|setlocale' "$work/used"
then fail "the golden model prints, exits or changes the process"; fi

# The example, as its own comment compiles it, and against the static library.
static=$(pkg-config --static --libs spikefield)
# shellcheck disable=SC2046,SC2086
{
  $cc $strict docs/example.c $(pkg-config --cflags --libs spikefield) -o "$work/example" || fail "the example, shared"
  $cc docs/example.c $(pkg-config --cflags spikefield) ${static/-lspikefield/-l:libspikefield.a} -o "$work/example_static" ||
    fail "the example, static"
}
readelf -d "$work/example" | grep -q "NEEDED.*$soname" || fail "the example does not use the shared library"
if readelf -d "$work/example_static" | grep -q libspikefield; then fail "the static example uses the shared library"; fi
"$build/faults/make_scene" "$work/s.snn"
LD_LIBRARY_PATH=$prefix/lib "$work/example" "$work/s.snn" "$work/shared.ppm" 24 >"$work/shared.txt" 2>/dev/null || fail "the example"
"$work/example_static" "$work/s.snn" "$work/static.ppm" 24 >"$work/static.txt" 2>/dev/null || fail "the static example"
cmp "$work/shared.ppm" "$work/static.ppm" || fail "the shared and the static library differ in pixels"
cmp "$work/shared.txt" "$work/static.txt" || fail "the shared and the static library differ in counts or taps"
grep -q '^energy [1-9][0-9]* fJ' "$work/shared.txt" || fail "the example reports no energy"
if "$work/example_static" "$work/absent.snn" "$work/x.ppm" 2>"$work/err"; then fail "a missing scene is no error"; fi
grep -q "^example: .*absent.snn" "$work/err" || fail "the error does not name the file"

# The same camera in a data set: sim_render gives the same pixels.
"$bin/sf_scene" simple -o "$work/data" --size 24 --train 1 --test 1 >/dev/null
cat >"$work/data/transforms_test.json" <<JSON
{"w": 24, "h": 24, "fl_x": 30, "frames": [{"file_path": "./test/r_0", "transform_matrix":
  [[1, 0, 0, 0], [0, 0.6, -0.8, -2.5625], [0, 0.8, 0.6, 1.921875], [0, 0, 0, 1]]}]}
JSON
"$bin/sim_render" "$work/s.snn" "$work/data" --scale 1 --backend fixed -o "$work/golden.exr" >/dev/null
"$build/tests/exr_to_ppm" "$work/golden.exr" >"$work/golden.ppm"
cmp "$work/golden.ppm" "$work/shared.ppm" || fail "the library's picture is not the golden image"
[ "$(tail -c +16 "$work/golden.ppm" | od -An -v -tx2 -w6 | sort -u | wc -l)" -gt 20 ] || fail "the picture is empty"

run_make uninstall PREFIX="$prefix"
[ -z "$(find "$prefix" ! -type d)" ] || fail "uninstall leaves $(find "$prefix" ! -type d | head -n 1)"

# Staged for a package: files below DESTDIR, names without it.
run_make install PREFIX=/usr DESTDIR="$work/stage" LIBDIR=/usr/lib/here
grep -qx 'libdir=/usr/lib/here' "$work/stage/usr/lib/here/pkgconfig/spikefield.pc" || fail "DESTDIR shows in the pkg-config file"
run_make uninstall PREFIX=/usr DESTDIR="$work/stage" LIBDIR=/usr/lib/here
[ -z "$(find "$work/stage" ! -type d)" ] || fail "uninstall leaves files in DESTDIR"
echo "install: ok"
