#!/bin/bash
# The vector kit around other RTL than its own: another neuron passes, a wrong one does not, another top level is named.
# usage: kit_dut.sh BUILD
NEURONS=32 # programmed sooner
. "$(dirname "$0")/../kit_run.bash" "$@"
command -v iverilog >/dev/null || { echo "iverilog: not installed"; finish "Icarus skipped"; }

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
finish "other RTL is taken, or said to be wrong"
