#!/bin/bash
# The vector kit as its user has it, in a folder elsewhere: PASS in Icarus and in Verilator with the same line; one wrong
# bit in any file, and every planted fault of the RTL, caught and located. usage: kit.sh BUILD
set -u
build=$(cd "$1" && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/sf_kit.XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
failures=0
unset MAKEFLAGS MAKELEVEL

fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

"$build/faults/make_scene" "$work/scene.snn" || exit 1
"$build/bin/sf_scene" simple -o "$work/data" --size 32 --train 1 --test 2 >/dev/null || exit 1
for kit in made again; do
  "$build/bin/sf_export" "$work/scene.snn" --vectors "$work/$kit" --data "$work/data" --seed 3 >/dev/null || exit 1
done
diff -r "$work/made" "$work/again" || fail "the same seed gives other files"
mv "$work/made" "$work/elsewhere" && kit=$work/elsewhere

# Every file is in the manifest with its size and hash.
tr -d ' \t\n' <"$kit/manifest.json" | grep -oE '"name":"[^"]*","bytes":[0-9]+,"sha256":"[0-9a-f]{64}"' |
  sed -E 's/"name":"([^"]*)","bytes":([0-9]+),"sha256":"([0-9a-f]*)"/\3  \1/' >"$work/sums"
(cd "$kit" && sha256sum --quiet -c "$work/sums") || fail "the manifest's hashes"
(cd "$kit" && find . -type f ! -name manifest.json -printf '%P\n' | sort) | diff - <(cut -c67- "$work/sums" | sort) ||
  fail "the manifest lists other files than there are"

# run SIMULATOR STATUS TEXT... [-- VARIABLE...]: make's status (0, or 1 for any failure) and texts in what it prints
run() {
  local simulator=$1 want=$2 texts=() got
  shift 2
  while [ $# -gt 0 ] && [ "$1" != -- ]; do texts+=("$1"); shift; done
  shift
  make -s -C "$kit" "$simulator" "$@" >"$work/log" 2>&1
  got=$(($? > 0))
  [ $got -eq "$want" ] || fail "$simulator $*: status $got, expected $want: $(tail -n 3 "$work/log")"
  for text in "${texts[@]}"; do
    grep -qF -- "$text" "$work/log" || fail "$simulator $*: '$text' is not in $(grep -E 'DIFF|PASS|rror' "$work/log")"
  done
  grep -E '^(PASS|DIFFERENCE)' "$work/log"
}

# flip FILE LINE: one wrong bit
flip() {
  cp "$kit/$1" "$work/kept"
  awk -v at="$2" 'NR == at { digit = substr($0, length($0)); $0 = substr($0, 1, length($0) - 1) \
    substr("1032547698badcfe", index("0123456789abcdef", digit), 1) } { print }' "$work/kept" >"$kit/$1"
}

run verilator 0 PASS -- >"$work/verilator"
cat "$work/verilator"
flip expected_membranes_C2.hex 41
run verilator 1 'sample 13 layer C2 step 1 neuron 0 membrane' --
cp "$work/kept" "$kit/expected_membranes_C2.hex"
if ! command -v iverilog >/dev/null; then
  echo "iverilog is not installed: Icarus skipped"
  exit $((failures > 0))
fi

run icarus 0 PASS -- >"$work/icarus"
cat "$work/icarus"
diff "$work/verilator" "$work/icarus" || fail "the simulators take other ways"
run icarus 0 'PASS 48 samples' -- STALLS=0 TAP=0
run icarus 0 'PASS 48 samples' -- STALLS=80 SEED=11
[ "$(grep -c '^2' "$kit/stimulus.hex")" -ge 2 ] || fail "the kit has no second ray"

flipped() { # FILE LINE TEXT
  flip "$1" "$2"
  run icarus 1 "DIFFERENCE $3" -- STALLS=0
  cp "$work/kept" "$kit/$1"
}
flipped expected_spikes_D1.hex 5 'sample 1 layer D1 step 1 neuron 0 spike'
flipped expected_spikes_C1.hex 95 'sample 31 layer C1 step 1 neuron 0 spike'
flipped expected_spikes_C2.hex 1 'sample 0 layer C2 step 0 neuron 0 spike'
flipped expected_membranes_D1.hex 96 'sample 31 layer D1 step 2 neuron 0 membrane'
flipped expected_membranes_C1.hex 9 'sample 2 layer C1 step 2 neuron 0 membrane'
flipped expected_rows_D2.hex 7 'sample 6 layer D2 step 0 neuron 0 row'
flipped expected_rows_C2.hex 8 'sample 2 layer C2 step 1 neuron 0 row'
flipped expected_rows_C3.hex 32 'sample 31 layer C3 step 0 neuron 0 row'
flipped expected_outputs.hex 19 'sample 9 layer D2 step 2 neuron 0 density'
flipped expected_outputs.hex 64 'sample 31 layer C3 step 2 neuron 1 colour'
flipped expected_counters.hex $((1 + (1 * 8 + 3) * 8 + 2)) 'layer C2 step 2 sop'
flipped expected_counters.hex $((1 + 7 * 8 + 1)) 'rays'
flipped stimulus.hex 40 'sample'
flipped weights.hex 20 'in the kit'
flipped program.hex 1000 'in the kit'
flipped program.hex 4 'sample 0 layer'  # other time steps than the kit's

# As tests/chain/cosim_faults.sh: the RTL with planted faults, one chosen at run time.
faulty() { run icarus "${@:2}" -- RTL="$build/faults/rtl" BUILD=faulty ARGS="+fault=$1"; }
faulty 0 0 PASS
faulty 1 1 'layer C2' 'neuron 37 membrane'
faulty 2 1 'layer C2 step 1 neuron 64 row: expected 1, actual 0'
faulty 3 1 'DIFFERENCE layer C1 step 2 spikes: expected'
faulty 10 1 'layer D1 step 0 mac'
faulty 13 1 'answered before it was asked'
faulty 14 1 'no sign of life'
# Another neuron of the same behaviour, and a wrong one: older files than what was built, in the same folder.
run icarus 0 PASS -- OVERLAY="$PWD/tests/dut/serial"
run icarus 1 'neuron' -- OVERLAY="$PWD/tests/dut/wrong"
run icarus 1 'nowhere' -- DUT=nowhere
run verilator 1 'nowhere' -- DUT=nowhere
sed 's/^module sf_top/module my_top/' "$kit/rtl/sf_top.sv" >"$work/my_top.sv"
touch -d '1 hour ago' "$work/my_top.sv"
sources="$(grep -v '^sf_top.sv' "$kit/rtl.f" | sed 's|^|rtl/|' | tr '\n' ' ')"
run icarus 0 PASS -- SOURCES="$sources $work/my_top.sv" DUT=my_top
run icarus 1 'my_top' -- SOURCES="$sources" DUT=my_top
[ $failures -eq 0 ] && echo "the kit passes in both simulators; wrong bits and planted faults are caught and located"
exit $((failures > 0))
