#!/bin/bash
# The vector kit around other RTL than its own: every planted fault caught and located, another neuron passes, a wrong one
# does not, another top level is named. usage: kit_faults.sh BUILD
. "$(dirname "$0")/../kit_run.bash" "$@"
command -v iverilog >/dev/null || { echo "iverilog: not installed"; finish "Icarus skipped"; }

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
mkdir "$work/wrong"
sed -f tests/dut/wrong.sed tests/dut/serial/sf_plif.sv >"$work/wrong/sf_plif.sv"
run icarus 1 'neuron' -- OVERLAY="$work/wrong"
run icarus 1 'nowhere' -- DUT=nowhere
sed 's/^module sf_top/module my_top/' "$kit/rtl/sf_top.sv" >"$work/my_top.sv"
touch -d '1 hour ago' "$work/my_top.sv"
sources="$(grep '^rtl/' "$kit/rtl.f" | grep -v '/sf_top.sv$' | tr '\n' ' ')"
run icarus 0 PASS -- SOURCES="$sources $work/my_top.sv" DUT=my_top
run icarus 1 'my_top' -- SOURCES="$sources" DUT=my_top
finish "planted faults of the RTL are caught and located through the kit"
