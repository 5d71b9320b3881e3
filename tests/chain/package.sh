#!/bin/bash
# The block as others take it away: registers in every generated form, IP-XACT, FuseSoC, C header, a first simulation.
# Ends by planting faults in a copy, to see each check fail.   usage: package.sh BUILD
set -euo pipefail
build=$(cd "${1:?usage: package.sh BUILD}" && pwd)
cd "$(dirname "$0")/../.."
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-package-XXXXXX")
trap 'rm -rf "$work"' EXIT
fail() { echo "package: $1" >&2; exit 1; }
cc=${CC:-cc} cxx=${CXX:-c++}

# FuseSoC searches whole trees and takes the last core of a name: only ours may be found, none of a build folder.
hidden() { # FILE: a folder above it holds FUSESOC_IGNORE
  local folder=${1%/*}
  until [ -e "$folder/FUSESOC_IGNORE" ]; do
    case $folder in */*) folder=${folder%/*} ;; *) return 1 ;; esac
  done
}
lone_core() { # TREE
  find "$1" -name '*.core' | while read -r core; do
    [ "$core" = "$1/spikefield.core" ] || hidden "$core" || { echo "FuseSoC finds $core, too"; exit 1; }
  done
}
[ -e "$build/FUSESOC_IGNORE" ] || fail "no FUSESOC_IGNORE in the build folder: FuseSoC finds the cores of variants there"
lone_core . || fail "more than one core"
mkdir -p "$work/tree/build/variant"
cp spikefield.core "$work/tree"
cp spikefield.core "$work/tree/build/variant"
lone_core "$work/tree" >/dev/null && fail "a core in a build folder without FUSESOC_IGNORE is not seen"
touch "$work/tree/build/FUSESOC_IGNORE"
lone_core "$work/tree" || fail "a core that FuseSoC does not find is seen"
strict="-Wall -Wextra -Wpedantic -Werror -fsyntax-only"

# The C header alone, for C, C++ and assembler; and every number beside csr.def as the compiler reads it.
echo '#include "rtl/gen/sf_csr.h"
int sf_offset = SF_REG_CTRL;' >"$work/alone.c"
printf '#include "rtl/gen/sf_csr.h"\n.long SF_REG_CONFIG_DIR_MAX_MASK, SF_REG_CTRL\n' >"$work/alone.S"
for use in "$cc -std=c99 $strict $work/alone.c" "$cxx -x c++ -std=c++11 $strict $work/alone.c" \
  "$cc -c -o $work/alone.o $work/alone.S"; do
  $use -I. >"$work/out" 2>&1 || fail "sf_csr.h is refused by $use: $(head -n 3 "$work/out")"
done
cat >"$work/header.c" <<'SOURCE'
#include "firmware/sf_driver.h"
#include "rtl/gen/sf_csr.h"
#define SF_CSR(name, offset, access, reset, meaning) _Static_assert(SF_REG_##name == (offset), #name);
#define SF_CSR_FIELD(owner, name, lsb, width, meaning)                                                        \
  _Static_assert(SF_REG_##owner##_##name##_MASK == SF_CSR_##owner##_##name, #owner " " #name);                \
  _Static_assert(SF_REG_##owner##_##name##_SHIFT == SF_CSR_##owner##_##name##_LSB, #owner " " #name);
#define SF_CSR_WINDOW(name, words, bits, meaning) \
  _Static_assert(SF_REG_##name##_WORDS == (words) && SF_REG_##name##_BITS == (bits), #name);
#define SF_CSR_MEMORY(name, address, data, words, bits, meaning) SF_CSR_WINDOW(name, words, bits, meaning)
#include "spikefield/csr.def"
#define EVENT(id, name, title, unit, fj) _Static_assert(SF_REG_EVENT_##id == SF_EVENT_##id, #id);
SF_EVENT_TABLE(EVENT)
_Static_assert(SF_REG_ID_RESET == SF_CSR_ID_RESET && SF_REG_CONFIG_RESET == SF_CSR_CONFIG_RESET, "contents after reset");
SOURCE
# shellcheck disable=SC2086
header() { # FOLDER that holds rtl/
  "$cc" -std=c11 $strict -I"$1" -I. -Iinclude -Isrc "$work/header.c" 2>"$work/out"
}
header . || fail "sf_csr.h and csr.def differ: $(grep -m 1 error "$work/out")"

simulate() { # FOLDER TOP: the RTL files that spikefield.core names, in Icarus
  local files
  files=$(sed -n 's/^      - \([a-z_0-9/]*\.sv\)$/\1/p' "$1/spikefield.core")
  # shellcheck disable=SC2086
  (cd "$1" && iverilog -g2012 -Irtl -s "$2" -o "$work/tb" $files) >"$work/out" 2>&1 &&
    vvp -n "$work/tb" >"$work/out" 2>&1
}
first_look() { simulate "$1" sf_registers_tb; }
# Widths in arch.def that a top level is not written for: it says so when a simulation starts, and else is silent.
refuses() { # FOLDER TOP NAME OTHER: with that value of the package, and not without it
  simulate "$1" "$2" || fail "$2: $(head -n 3 "$work/out")"
  grep -q "is written for" "$work/out" && fail "$2 refuses its own widths"
  rm -rf "$work/other"
  mkdir "$work/other"
  cp -r "$1/rtl" "$1/sim" "$1/spikefield.core" "$work/other"
  sed -i -E "s/( $3 = )[0-9]+;/\1$4;/" "$work/other/rtl/gen/sf_arch_pkg.sv"
  simulate "$work/other" "$2"
  grep -q "is written for" "$work/out" || { echo "$2 takes $3 = $4"; return 1; }
}
if command -v iverilog >/dev/null; then
  first_look . || fail "sf_registers_tb: $(tail -n 2 "$work/out")"
  tail -n 1 "$work/out"
  for width in POS_FRAC=23 DELTA_FRAC=23 TRANS_FRAC=16; do
    refuses . sf_ray_top "${width%=*}" "${width#*=}" || fail "widths that sf_ray_top is not written for"
  done
  refuses . sf_top WEIGHT_BITS 7 || fail "widths that sf_top is not written for"
else
  echo "the first simulation was not run"; echo "iverilog: not installed"
fi

command -v python3 >/dev/null || { echo "skipped: python3 is not installed"; exit 77; }
python3 tests/crosscheck_registers.py

# Planted faults: FILE, what sed does to it, what the check of that file must say.
seen=0
declare -A check_of=([spikefield.xml]=ipxact [spikefield.core]=ipxact [sf_csr.rdl]=systemrdl [sf_csr_pkg.sv]=package [registers.md]=markdown [sf_csr.h]=header)
own_check() { python3 tests/crosscheck_registers.py "$1" "${check_of[${2##*/}]}"; }
planted() {
  rm -rf "$work/tree"
  mkdir "$work/tree"
  cp -r include rtl docs sim spikefield.core "$work/tree"
  sed -i -E "$2" "$work/tree/$1"
  cmp -s "$1" "$work/tree/$1" && fail "the fault '$2' changes nothing in $1"
  if ${4:-own_check} "$work/tree" "$1" >"$work/out" 2>&1; then fail "$1 with '$2' passes"; fi
  grep -q -e "$3" "$work/out" || fail "$1 with '$2' is refused without '$3': $(head -n 3 "$work/out")"
  seen=$((seen + 1))
}
xml=rtl/gen/spikefield.xml
planted $xml "s/(addressOffset>)'h4c</\1'h48</" "D1_THETA is (72"
planted $xml "s/'h53464c44/'h53464c45/" "ID is (0"
planted $xml "0,/<ipxact:modifiedWriteValue>oneToClear<.*/s///" "ERROR is (20, 'RW+W1C'"
planted $xml "s/<ipxact:range>4096</<ipxact:range>2048</" "COUNTERS is (4096, 256"
planted $xml "s/<ipxact:range>163840</<ipxact:range>163839</" "WEIGHTS is (0, 163839"
planted $xml "s/WEIGHT_ADDRESS_VALUE<\/ipxact:indirect/WEIGHT_ADDRESS_ROW<\/ipxact:indirect/" "do not reach"
planted $xml "s/<ipxact:left>3071</<ipxact:left>1535</" "port tap_membrane_o"
planted $xml "0,/s_axil_wdata_i/s//s_axil_rdata_o/" "WDATA is s_axil_rdata_o"
planted $xml "0,/<ipxact:master\/>/s//<ipxact:slave\/>/" "contradicts a slave"
planted $xml "/<ipxact:file>/{N;/sf_csr\.sv/{N;N;d}}" "spikefield.xml: rtl/sf_csr.sv is missing"
planted spikefield.core "/rtl\/sf_scale.sv/d" "spikefield.core: rtl/sf_scale.sv is missing"
planted spikefield.core "s/rtl\/sf_scale.sv/rtl\/sf_scales.sv/" "rtl/sf_scales.sv is not there"
planted spikefield.core "/sf_csr_pkg/d; s/^(      - rtl\/sf_values.sv)/\1\n      - rtl\/gen\/sf_csr_pkg.sv/" \
  "does not stand before"
planted rtl/gen/sf_csr.rdl "s/ROW\[14:6\]/ROW[13:6]/" "WEIGHT_ADDRESS is"
planted rtl/gen/sf_csr.rdl "s/mementries = 512/mementries = 511/" "COUNTERS is (4096, 511"
planted rtl/gen/sf_csr_pkg.sv "s/13'h0078/13'h0074/" "C2_K is"
planted docs/registers.md "s/ERROR \| W1C/ERROR | RW/" "ERROR is (20, 'RW'"
planted rtl/gen/sf_csr.h "s/(SF_REG_IRQ_ENABLE_COUNTERS_MASK 0x0000000)2/\14/" "IRQ_ENABLE_COUNTERS_MASK is 4"
header_of() { header "$1" || { cat "$work/out"; return 1; }; }
planted rtl/gen/sf_csr.h "s/(SF_REG_STEPS 0x00)24/\128/" "STEPS" header_of
if command -v iverilog >/dev/null; then
  look_of() { first_look "$1" || { cat "$work/out" >"$work/said"; cat "$work/said"; return 1; }; }
  refuses_of() { refuses "$1" sf_ray_top TRANS_FRAC 16; }
  planted rtl/sf_ray_top.sv "s/ \|\| sf_arch_pkg::TRANS_FRAC != 20//" "sf_ray_top takes TRANS_FRAC" refuses_of
  planted rtl/sf_csr.sv "s/& ~wdata_q\[10:0\]/\& wdata_q[10:0]/" "expected" look_of
fi
echo "package: $seen planted faults seen"
