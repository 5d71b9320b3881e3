#!/bin/bash
# docs/golden_tb.sv, built as docs/kit.md says around the RTL with planted faults: it passes without a fault, names what
# differs with one, and says why a scene cannot be read. usage: golden_bench.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"
"$build/bin/sf_export" "$work/scene.snn" --vectors "$work/kit" --data "$work/data" --samples 1 >/dev/null || exit 1
rtl=$build/faults/rtl
# shellcheck disable=SC2046
MAKEFLAGS='' verilator --binary --timing --top-module golden_tb --prefix Vgolden_tb --Mdir "$work/made" -O3 \
  -Wno-fatal -Wno-lint -Wno-style --x-assign unique --x-initial unique --unroll-count 256 --unroll-stmts 1000000 \
  --output-split 100000000 -MAKEFLAGS "OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0" \
  -I"$rtl" $(sed -n "s|^rtl/|$rtl/|p" "$work/kit/rtl.f") src/lib/sf_golden_dpi.sv docs/golden_tb.sv \
  -LDFLAGS "$build/lib/libsf_golden_dpi.so" >"$work/log" 2>&1 || { grep -E '%Error|error' "$work/log"; exit 1; }

# run STATUS TEXT ARGUMENT...
run() {
  local want=$1 text=$2 got
  shift 2
  LD_LIBRARY_PATH=$build/lib "$work/made/Vgolden_tb" +scene="$work/scene.snn" +program="$work/kit/program.hex" \
    +samples=300 +verilator+rand+reset+2 "$@" >"$work/out" 2>&1
  got=$(($? > 0))
  [ $got -eq "$want" ] || fail "$*: status $got, expected $want"
  grep -qF -- "$text" "$work/out" || fail "$*: '$text' is not in $(cat "$work/out")"
  grep -E 'PASS|DIFF|Error' "$work/out" | head -n 1
}
run 0 'PASS 300 random samples' +fault=0
run 1 ': membrane of neuron 37' +fault=1
run 1 'layer 3 step 1: rows' +fault=2
run 1 ': 0 tap beats, expected' +fault=15
run 1 ': surplus tap beat' +fault=16
mv "$work/scene.snn" "$work/away.snn"
run 1 'scene.snn: ' +fault=0
finish "the example bench passes beside the golden model and sees planted faults"
