#!/bin/bash
# The whole chain on small scenes of its own making: every program, both image backends, co-simulation, audit.
# usage: chain.sh BUILD
set -euo pipefail
bin=$1/bin
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "chain: $1" >&2; exit 1; }

check_scene() { # name, train options
  local dir=$work/$1
  shift
  "$bin/sf_scene" "${dir##*/}" -o "$dir" --size 40 --train 10 --test 2 >/dev/null
  "$bin/sf_train" "$dir" -o "$dir/m.safetensors" --stage1 40 --stage2 80 --samples 2048 --levels 6 --log2-hash 12 \
    --finest-res 64 --lattice 128 --occ-res 32 --quiet "$@"
  "$bin/sf_export" "$dir/m.safetensors" -o "$dir/s.snn" >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend float --model "$dir/m.safetensors" -o "$dir/float.exr" >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend fixed --threads 1 -o "$dir/one.exr" >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend fixed --threads 3 -o "$dir/three.exr" >/dev/null
  cmp "$dir/one.exr" "$dir/three.exr" || fail "$1: the fixed image depends on the threads"
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend fixed --crop 17,17,6,6 -o "$dir/fixed.exr" >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend rtl --crop 17,17,6,6 -o "$dir/rtl.exr" >/dev/null
  cmp "$dir/fixed.exr" "$dir/rtl.exr" || fail "${dir##*/}: the RTL's image differs from the fixed-point core's"
  "$bin/sf_cosim" "$dir/s.snn" "$dir" --rays 30 --seed 7 --stalls 20 --json >"$dir/cosim.json" || fail "${dir##*/}: co-simulation"
  grep -Eq '"differences":[[:space:]]*0,' "$dir/cosim.json" || fail "${dir##*/}: differences"
  "$bin/energy_audit" "$dir/s.snn" "$dir" --rays 100 --json >"$dir/audit.json" || fail "${dir##*/}: audit"
  echo "${dir##*/}: ok"
}

check_fit() { # NAME: the fitted scene in the RTL
  local dir=$work/$1
  "$bin/sf_export" "$dir/m.safetensors" -o "$dir/fit.snn" --fit --data "$dir" --fit-rays 256 --quiet --json >"$dir/fit.json"
  "$bin/sf_cosim" "$dir/fit.snn" "$dir" --rays 20 --seed 8 --stalls 20 --json >"$dir/fit-cosim.json" ||
    fail "$1: co-simulation of the fitted scene"
  grep -Eq '"differences":[[:space:]]*0,' "$dir/fit-cosim.json" || fail "$1: the fitted scene differs in the RTL"
}

check_scene textured --hidden 64 --input-mode hybrid
check_fit textured
check_scene simple --input-mode no-decay --steps 4 --hidden 32
check_scene fog --input-mode decay --steps 5 --hidden 64
check_fit fog
check_scene empty --steps 2 --hidden 32
check_scene plaza --steps 3 --bound 8 --hidden 32
"$bin/error_budget" "$work/plaza/m.safetensors" "$work/plaza/s.snn" "$work/plaza" --rays 20 --samples 1000 --quiet >"$work/budget.txt" ||
  fail "plaza: error budget"
grep -q '^none: the fixed-point core  *equal' "$work/budget.txt" || fail "plaza: the error budget's core is not the core"

# The same of TensoRF's field, and golden images of the whole set.
check_tensorf() {
  local dir=$work/vm
  "$bin/sf_scene" textured -o "$dir" --size 40 --train 10 --test 2 >/dev/null
  "$bin/sf_train" "$dir" -o "$dir/m.safetensors" --backbone tensorf --stage1 100 --stage2 100 --samples 1024 --rays 256 \
    --voxels 16 --steps 2 --occ-res 16 --hidden 16 --quiet
  "$bin/sf_export" "$dir/m.safetensors" -o "$dir/s.snn" >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend fixed --threads 1 -o "$dir/one.exr" >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --view 1 --backend fixed --threads 3 -o "$dir/three.exr" >/dev/null
  cmp "$dir/one.exr" "$dir/three.exr" || fail "tensorf: the fixed image depends on the threads"
  "$bin/sim_render" "$dir/s.snn" "$dir" --all --crop 18,18,3,3 -o "$dir/all" --quiet >/dev/null
  "$bin/sim_render" "$dir/s.snn" "$dir" --verify "$dir/all/manifest.json" --backend rtl --quiet >/dev/null ||
    fail "tensorf: the RTL's images differ from the fixed-point core's"
  "$bin/sf_cosim" "$dir/s.snn" "$dir" --rays 12 --seed 7 --json >"$dir/cosim.json" || fail "tensorf: co-simulation"
  grep -Eq '"differences":[[:space:]]*0,' "$dir/cosim.json" || fail "tensorf: differences"
  "$bin/energy_audit" "$dir/s.snn" "$dir" --rays 100 --json >"$dir/audit.json" || fail "tensorf: audit"
  "$bin/sf_cycles" "$dir/s.snn" "$dir" --downscale 4 --json >/dev/null || fail "tensorf: cycles"
  "$bin/sf_export" "$dir/s.snn" --vectors "$dir/kit" --data "$dir" >/dev/null || fail "tensorf: vectors"
  "$bin/error_budget" "$dir/m.safetensors" "$dir/s.snn" "$dir" --rays 20 --samples 1000 --quiet >"$dir/budget.txt" ||
    fail "tensorf: error budget"
  grep -q '^weight test: every sample decoded' "$dir/budget.txt" || fail "tensorf: the error budget has no weight test"
  "$bin/sf_export" "$dir/m.safetensors" -o "$dir/fit.snn" --fit --data "$dir" --fit-rays 256 --fit-loss 0.2 --quiet --json >"$dir/fit.json"
  python3 - "$dir/fit.json" <<'PYTHON' || fail "tensorf: fit"
import json, sys
fit = json.load(open(sys.argv[1]))["fit"]
before, after = fit["before"], fit["after"]
assert fit["loss_db"] <= fit["bound_db"] == 0.2
assert after["bytes"] < before["bytes"] and after["energy_fj"] < before["energy_fj"] and after["entries"] < before["entries"]
PYTHON
  "$bin/sim_render" "$dir/fit.snn" "$dir" --view 1 --backend fixed --crop 16,16,8,8 -o "$dir/fixed.exr" >/dev/null
  "$bin/sim_render" "$dir/fit.snn" "$dir" --view 1 --backend rtl --crop 16,16,8,8 -o "$dir/rtl.exr" >/dev/null
  cmp "$dir/fixed.exr" "$dir/rtl.exr" || fail "tensorf: the fitted scene's image differs in the RTL"
  "$bin/sf_cosim" "$dir/fit.snn" "$dir" --rays 12 --seed 8 --json >"$dir/fit-cosim.json" || fail "tensorf: co-simulation of the fitted scene"
  grep -Eq '"differences":[[:space:]]*0,' "$dir/fit-cosim.json" || fail "tensorf: the fitted scene differs in the RTL"
  "$bin/energy_audit" "$dir/fit.snn" "$dir" --rays 100 --json >"$dir/audit.json" || fail "tensorf: audit of the fitted scene"
  echo "tensorf: ok"
}
check_tensorf

# Interrupted and continued equals uninterrupted.
scene=$work/simple
options="--stage1 100 --stage2 200 --samples 1024 --levels 4 --log2-hash 10 --finest-res 32 --lattice 64 --occ-res 16 --quiet"
# shellcheck disable=SC2086
"$bin/sf_train" "$scene" -o "$work/whole.safetensors" $options >/dev/null
# shellcheck disable=SC2086
"$bin/sf_train" "$scene" -o "$work/part.safetensors" $options >/dev/null 2>&1 &
pid=$!
sleep 0.4
kill -INT $pid 2>/dev/null || true
status=0
wait $pid || status=$?
if [ $status -eq 130 ]; then
  # shellcheck disable=SC2086
  "$bin/sf_train" "$scene" -o "$work/part.safetensors" $options --resume >/dev/null
else
  [ $status -eq 0 ] || fail "interrupted training exits $status"
fi
cmp "$work/whole.safetensors" "$work/part.safetensors" || fail "an interrupted run that was resumed differs"
echo "resume: ok"
