#!/bin/bash
# Builds of the accelerator with other lanes: a net that fits co-simulates with 0 differences, one that is too wide is
# refused. 32 and 64 lanes in this build's system, 256 in a system of its own (BUILD/lanes, as little of it as the
# comparison needs). What is built here runs a few hundred samples, so it is compiled for a quick build.
# --whole: goes on to rays, firmware, the vector kit in both simulators and synthesis, of each number of lanes.
# usage: lanes.sh BUILD [--whole]
. "$(dirname "$0")/../chain.bash" "$@"
export LC_ALL=C
learn 32 32
learn 64 64
# The RTL of this build, in the order of the kit; kept in its place while it stays the same, and so are builds of it.
rtl=$build/lanes/rtl
"$build/bin/sf_export" "$work/32.snn" --vectors "$work/kit" --data "$work/data" --samples 1 >/dev/null || exit 1
diff -rq "$work/kit/rtl" "$rtl" >/dev/null 2>&1 || { mkdir -p "$rtl" && rm -r "$rtl" && mv "$work/kit/rtl" "$rtl"; } || exit 1
sources=$(sed -n "s|^rtl/|$rtl/|p" "$work/kit/rtl.f" | tr '\n' ' ')
# run LANES HIDDEN
run() {
  (quick_dut && exec "$build/bin/sf_cosim" "$work/$2.snn" "$work/data" --rays 150 --limit-samples 400 --seed 1 --quiet --json \
    --evidence "$work/evidence" --dut "-GLANES=$1 +incdir+$rtl $sources" >"$work/out" 2>"$work/err")
}
for lanes in 32 64; do
  run $lanes $lanes || fail "$lanes lanes: a net of $lanes neurons"
  grep -q '"differences":[[:space:]]*0' "$work/out" || fail "$lanes lanes: no report"
  samples=$(sed -nE 's/.*"samples":[[:space:]]*([0-9]+).*/\1/p' "$work/out" | head -n 1)
  [ "${samples:-0}" -gt 200 ] || fail "$lanes lanes: ${samples:-no} samples"
  echo "$lanes lanes: $samples samples, 0 differences"
  [ $lanes = 64 ] || cycles=$(sed -nE 's/.*"cycles":[[:space:]]*([0-9]+).*/\1/p' "$work/out")
done
run 64 32 || fail "64 lanes: a net of 32 neurons"
grep -qE "\"cycles\":[[:space:]]*${cycles:-none}," "$work/out" || fail "not the cycles of 32 lanes, ${cycles:-none}" # as sf_cycles says
run 32 64 && fail "32 lanes took a net of 64 neurons"
grep -q 'programming refused' "$work/err" || fail "32 lanes: the refusal is not the accelerator's"
tail -n 1 "$work/err"

wide=$build/lanes/256
# make_wide GOAL or VARIABLE=...
make_wide() {
  MAKEFLAGS='' make -s -j1 -C "$root" B="$wide" ARCH="LANES=256" OPT=-O0 VERILATED_OPT="$quick" VERILATOR="verilator --output-split 100000000" \
    VERILATED_OBJ="$(printf "$build/verilated/runtime/%s.o " verilated verilated_fst_c verilated_threads)" "$@" >"$work/out" 2>"$work/err"
}
needed='$(filter-out %_isa.c,$(foreach room,base ranks cli image scene field snn fx quant energy,$(wildcard src/$(room)/*.c)))'
needed+=' src/render/view.c'
harness='$(filter-out sim/soc/% sim/studio/view_set% sim/ray/three_counts% sim/studio/audit_run%,$(wildcard sim/*.c sim/board/*.c sim/activity/*.c sim/ray/*.c sim/studio/*.c sim/soc/*.c))'
make_wide LIB_SRC="$needed" SIM_SRC="$harness" "$wide/bin/sf_cosim" "$wide/faults/make_scene" "$wide/tests/test_fx_vector" "$wide/tests/test_snn" || fail "256 lanes: no build"
"$wide/faults/make_scene" "$work/256.snn" || fail "256 lanes: no scene"
"$wide/bin/sf_cosim" "$work/256.snn" "$work/data" --rays 30 --limit-samples 500 --seed 1 --quiet --json \
  --evidence "$work/evidence" >"$work/out" 2>"$work/err" || fail "256 lanes: a net of 256 neurons"
grep -q '"differences":[[:space:]]*0' "$work/out" || fail "256 lanes: no report"
samples=$(sed -nE 's/.*"samples":[[:space:]]*([0-9]+).*/\1/p' "$work/out" | head -n 1)
[ "${samples:-0}" -ge 500 ] || fail "256 lanes: ${samples:-no} samples"
echo "256 lanes: $samples samples, 0 differences"
for case in every_neuron_fires weights_and_features_at_the_rails; do
  CK_RUN_CASE=$case "$wide/tests/test_fx_vector" >"$work/out" 2>"$work/err" || fail "256 lanes: vector and portable core differ"
  grep -q 'Checks: [1-9]' "$work/out" || fail "256 lanes: $case was not run"
done
"$wide/tests/test_snn" >"$work/out" 2>"$work/err" || fail "256 lanes: training"
# refuses PROGRAM SCENE NEEDED AVAILABLE
refuses() {
  "$1" "$2" "$work/data" --rays 1 >"$work/out" 2>"$work/err" && fail "$4 lanes: took a scene of $3"
  grep -qF "$2: tensor 'colour.w3' needs $3 lanes, this build has $4" "$work/err" || fail "$4 lanes: not said what is missing"
}
refuses "$build/bin/sf_cosim" "$work/256.snn" 256 128
refuses "$wide/bin/sf_cosim" "$work/32.snn" 128 256
tail -n 1 "$work/err"
[ "${2:-}" = --whole ] || exit $((failures > 0))

# shows PATTERN WHAT PROGRAM ARGS...: it ends well and prints a line with the pattern
shows() {
  local pattern=$1 what=$2 started=$SECONDS
  shift 2
  if "$@" >"$work/out" 2>"$work/err" && grep -qE -- "$pattern" "$work/out"; then
    echo "$what: $(grep -m 1 -E -- "$pattern" "$work/out" | sed 's/^[[:space:]]*//'), $((SECONDS - started)) s"
  else
    fail "$what"
  fi
}
make_narrow() { MAKEFLAGS='' make -s -j1 -C "$root" B="$build" VERILATED_OPT="$quick" "$@" >"$work/out" 2>"$work/err"; }
soc='' elf=firmware/sf_firmware.elf
if [ -e "$build/bin/sf_soc" ] && [ -e "$build/$elf" ]; then soc=sf_soc; else echo "no emulated system, or no firmware"; echo "firmware: not installed"; fi

# whole LANES BUILD RTL PROGRAMS: rooms beyond the nets, of a block with so many lanes
whole() {
  local lanes=$1 system=$2 rtl=$3 programs=$4 scene=$work/$1.snn here=$work/$1 backend simulator
  mkdir "$here" || exit 1
  # sim_render compares every pixel and counter with the core, here in four tiles; the pictures are the same bytes.
  for backend in rtl fixed; do
    shows '"samples":[[:space:]]*[1-9]' "$lanes lanes: rays, $backend" "$programs/sim_render" "$scene" "$work/data" \
      --crop 15,11,2,6 --backend $backend -o "$here/$backend.exr" --json --quiet
  done
  cmp "$here/rtl.exr" "$here/fixed.exr" || fail "$lanes lanes: another picture"
  [ -z "$soc" ] || shows '^equal' "$lanes lanes: firmware" "$programs/sf_soc" "$scene" "$work/data" \
    --firmware "$system/$elf" --crop 11,11,2,2 --stall 25 --quiet
  "$system/bin/sf_export" "$scene" --vectors "$here/kit" --data "$work/data" --samples 4 >"$work/out" 2>"$work/err" ||
    fail "$lanes lanes: no vector kit"
  for simulator in $(command -v iverilog >/dev/null && echo icarus) verilator; do
    shows '^PASS 4 samples' "$lanes lanes: kit in $simulator" env -u MAKEFLAGS make -s -C "$here/kit" LANES="$lanes" OPT=-O0 $simulator
  done
  if command -v yosys >/dev/null; then
    shows "^\| .sf_csr. \| $lanes \|" "$lanes lanes: synthesis" "$root/tools/synth.sh" "$build/lanes/$lanes" \
      --rtl "$rtl" --lanes "$lanes" --modules sf_csr
  fi
}
for lanes in 32 64; do
  programs=$build/lanes/$lanes
  make_narrow "$programs/sim_render" ${soc:+"$programs/$soc"} || { fail "$lanes lanes: no build"; continue; }
  whole $lanes "$build" "$root" "$programs"
done
make_wide "$wide/bin/sim_render" "$wide/bin/sf_export" ${soc:+"$wide/bin/$soc" "$wide/$elf"} || { fail "256 lanes: no build"; exit 1; }
whole 256 "$wide" "$wide/variant" "$wide/bin"
exit $((failures > 0))
