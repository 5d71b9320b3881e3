#!/bin/bash
# One wrong bit in any file of the vector kit is caught and located, in Verilator (kit.sh: a bit in Icarus). usage: kit_flips.sh BUILD
NEURONS=72 # programmed sooner
. "$(dirname "$0")/../kit_run.bash" "$@"
export OPT=-O0

flipped() { # FILE LINE TEXT
  flip "$1" "$2"
  run verilator 1 "DIFFERENCE $3" -- STALLS=0
  cp "$work/kept" "$kit/$1"
}
flipped expected_spikes_D1.hex 5 'sample 1 layer D1 step 1 neuron 0 spike'
flipped expected_spikes_C1.hex 71 'sample 23 layer C1 step 1 neuron 0 spike'
flipped expected_spikes_C2.hex 1 'sample 0 layer C2 step 0 neuron 0 spike'
flipped expected_membranes_D1.hex 72 'sample 23 layer D1 step 2 neuron 0 membrane'
flipped expected_membranes_C1.hex 9 'sample 2 layer C1 step 2 neuron 0 membrane'
flipped expected_rows_D2.hex 7 'sample 6 layer D2 step 0 neuron 0 row'
flipped expected_rows_C2.hex 8 'sample 2 layer C2 step 1 neuron 0 row'
flipped expected_rows_C3.hex 24 'sample 23 layer C3 step 0 neuron 0 row'
flipped expected_outputs.hex 19 'sample 9 layer D2 step 2 neuron 0 density'
flipped expected_outputs.hex 48 'sample 23 layer C3 step 2 neuron 1 colour'
flipped expected_counters.hex $((1 + (1 * 8 + 3) * 8 + 2)) 'layer C2 step 2 sop'
flipped expected_counters.hex $((1 + 7 * 8 + 1)) 'rays'
flipped stimulus.hex 40 'sample'
flipped weights.hex 20 'in the kit'
flipped program.hex 1000 'in the kit'
flipped program.hex 4 'sample 0 layer'  # other time steps than the kit's

finish "wrong bits are caught and located"
