#!/bin/bash
# Builds of the accelerator with fewer lanes: a net that fits co-simulates with 0 differences, one that is too wide is
# refused.   usage: lanes.sh BUILD
set -u
export LC_ALL=C
build=$(cd "${1:?usage: lanes.sh BUILD}" && pwd) || exit 2
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/sf_lanes.XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
failed=0
fail() {
  echo "FAILED: $1"
  tail -n 5 "$work/out" "$work/err" 2>/dev/null
  failed=1
}
"$build/bin/sf_scene" textured -o "$work/data" --size 24 --train 8 --test 2 >/dev/null || exit 1
for hidden in 32 64; do
  "$build/bin/sf_train" "$work/data" -o "$work/$hidden.safetensors" --stage1 20 --stage2 40 --samples 512 --levels 4 \
    --log2-hash 10 --finest-res 32 --lattice 64 --occ-res 16 --hidden $hidden --steps 3 --quiet >/dev/null &&
    "$build/bin/sf_export" "$work/$hidden.safetensors" -o "$work/$hidden.snn" >/dev/null || exit 1
done
# The RTL of this build, in the order of the kit.
"$build/bin/sf_export" "$work/32.snn" --vectors "$work/kit" --data "$work/data" --samples 1 >/dev/null || exit 1
rtl=$work/kit/rtl
sources=$(sed "s|^|$rtl/|" "$work/kit/rtl.f" | tr '\n' ' ')
# run LANES HIDDEN
run() {
  "$build/bin/sf_cosim" "$work/$2.snn" "$work/data" --rays 150 --limit-samples 1500 --seed 1 --quiet --json \
    --evidence "$work/evidence" --dut "-GLANES=$1 +incdir+$rtl $sources" >"$work/out" 2>"$work/err"
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
exit $failed
