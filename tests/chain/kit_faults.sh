#!/bin/bash
# The vector kit around RTL with planted faults: each is caught and located. usage: kit_faults.sh BUILD
KIT_SAMPLES=48 # the fault of a counter shows late
NEURONS=72 # programmed sooner; fault 2 is in neuron 64
. "$(dirname "$0")/../kit_run.bash" "$@"
export OPT=-O0

# As tests/chain/cosim_faults.sh: the RTL with planted faults, one chosen at run time.
simulator=verilator more=''
faulty() { run $simulator "${@:2}" -- RTL="$build/faults/rtl" BUILD=faulty ARGS="+fault=$1 $more"; }
faulty 0 0 PASS
faulty 1 1 'layer C2' 'neuron 37 membrane'
faulty 2 1 'layer C2 step 1 neuron 64 row: expected 1, actual 0'
faulty 3 1 'DIFFERENCE layer C1 step 2 spikes: expected'
faulty 10 1 'layer D1 step 0 mac'
faulty 13 1 'answered before it was asked'
more=+patience=20000
faulty 0 0 PASS
faulty 14 1 'no sign of life'
cycles=$(sed -nE 's/^FAIL at cycle ([0-9]+).*/\1/p' "$work/log")
[ "${cycles:-0}" -gt 20000 ] && [ "$cycles" -lt 100000 ] || fail "+patience=20000: the run ends at cycle ${cycles:-(none)}"
# A block that says for ever that its counters are being cleared: to ask it again is no sign of life.
cp -r "$kit/rtl" "$work/busy"
sed -i "s/|error_q, counters_busy_i, active_i/|error_q, 1'b1, active_i/" "$work/busy/sf_csr.sv"
timeout 300 make -s -C "$kit" verilator RTL="$work/busy" BUILD=busy ARGS=+patience=2000 >"$work/log" 2>&1
grep -q 'no sign of life: [0-9]* of [0-9]* writes, 0 of' "$work/log" || fail "counters that are never clear: $(tail -n 3 "$work/log")"
command -v iverilog >/dev/null || { echo "iverilog: not installed"; finish "Icarus skipped"; }
simulator=icarus
faulty 1 1 'layer C2' 'neuron 37 membrane'
finish "planted faults of the RTL are caught and located through the kit"
