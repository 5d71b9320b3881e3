#!/bin/bash
# The vector kit as its user has it, in a folder elsewhere: PASS in Icarus and in Verilator with the same line;
# waveforms (kit_flips.sh: wrong bits; kit_faults.sh, kit_dut.sh: other RTL). usage: kit.sh BUILD
. "$(dirname "$0")/../kit_run.bash" "$@"
"$build/bin/sf_export" "$work/scene.snn" --vectors "$work/again" --data "$work/data" --samples 24 --seed 3 >/dev/null || exit 1
diff -r "$kit" "$work/again" || fail "the same seed gives other files"

# A kit may be written again, over one that was interrupted, too, and into an empty folder; among other things not.
vectors() { "$build/bin/sf_export" "$work/scene.snn" --vectors "$work/$1" --data "$work/data" --samples 24 --seed 3 >"$work/out" 2>&1; }
rm -r "$work/again/manifest.json" "$work/again/rtl"
mkdir "$work/empty" "$work/thesis"
echo precious >"$work/thesis/README.md"
for folder in again empty; do
  vectors $folder && diff -r "$kit" "$work/$folder" || fail "a kit in the folder '$folder': $(cat "$work/out")"
done
vectors thesis
[ $? -eq 2 ] && grep -q 'thesis: holds other things than a vector kit' "$work/out" || fail "a kit among other things: $(cat "$work/out")"
[ "$(ls "$work/thesis")" = README.md ] && [ "$(cat "$work/thesis/README.md")" = precious ] || fail "what was there is not as it was"

# Every file is in the manifest with its size and hash.
tr -d ' \t\n' <"$kit/manifest.json" | grep -oE '"name":"[^"]*","bytes":[0-9]+,"sha256":"[0-9a-f]{64}"' |
  sed -E 's/"name":"([^"]*)","bytes":([0-9]+),"sha256":"([0-9a-f]*)"/\3  \1/' >"$work/sums"
(cd "$kit" && sha256sum --quiet -c "$work/sums") || fail "the manifest's hashes"
(cd "$kit" && find . -type f ! -name manifest.json -printf '%P\n' | sort) | diff - <(cut -c67- "$work/sums" | sort) ||
  fail "the manifest lists other files than there are"

run verilator 0 PASS -- >"$work/verilator"
cat "$work/verilator"
flip expected_membranes_C2.hex 41
run verilator 1 'sample 13 layer C2 step 1 neuron 0 membrane' --
cp "$work/kept" "$kit/expected_membranes_C2.hex"
run verilator 0 'PASS 24 samples' -- STALLS=0 TAP=0
run verilator 0 'PASS 24 samples' -- STALLS=80 SEED=11
[ "$(grep -c '^2' "$kit/stimulus.hex")" -ge 2 ] || fail "the kit has no second ray"
run verilator 1 'built without waveforms' -- ARGS=+vcd=run.vcd
run verilator 1 'nowhere' -- DUT=nowhere # whatever was built before
command -v iverilog >/dev/null || { echo "iverilog: not installed"; finish "Icarus skipped"; }

# A user sees the verdict last, after one line that says what is built, and not the compiler's command.
make -C "$kit" icarus 2>&1 | grep -v 'Entering\|Leaving' >"$work/shown"
[ "$(wc -l <"$work/shown")" -eq 2 ] || fail "make icarus: $(cut -c1-200 "$work/shown" | head -n 5)"
tail -n 1 "$work/shown" | tee "$work/icarus"
diff "$work/verilator" "$work/icarus" || fail "the simulators take other ways"
flip expected_membranes_D1.hex 1
run icarus 1 'sample 0 layer D1 step 0 neuron 0 membrane' -- STALLS=0
cp "$work/kept" "$kit/expected_membranes_D1.hex"

# Waveforms: the bench and every level of the block, up to the last cycle. Of fewer neurons, which is a smaller program.
"$build/faults/make_scene" "$work/narrow.snn" 32 && "$build/bin/sf_export" "$work/narrow.snn" --vectors "$work/narrow" --data "$work/data" \
  --samples 12 --seed 3 >/dev/null || exit 1
kit=$work/narrow
for simulator in icarus verilator; do
  run $simulator 0 PASS -- VCD=run.vcd BUILD=waves OPT=-O0 >/dev/null
  grep -q '^\$scope module u_dut' < <(sed 's/^ *//' "$kit/run.vcd") && grep -q 'm_axis_tdata_o' "$kit/run.vcd" || fail "$simulator: no nets in run.vcd"
  cycles=$(sed -nE 's/^PASS.* ([0-9]+) cycles.*/\1/p' "$work/log")
  [ "$(grep '^#' "$kit/run.vcd" | tail -n 1 | tr -d '#')" -ge $((cycles * 10000 - 10000)) ] || fail "$simulator: run.vcd ends early"
  rm "$kit/run.vcd"
done
run icarus 1 'FAIL: +vcd: nowhere/run.vcd cannot be written' -- VCD=nowhere/run.vcd BUILD=waves OPT=-O0

finish "the kit passes in both simulators"
