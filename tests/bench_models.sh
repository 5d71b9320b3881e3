#!/usr/bin/env bash
# Models for the frame of the benchmark, made once for a data folder: usage: bench_models.sh BUILD SCENES. Prints scene, twin
# and data folder, a line each. The scene is that of `make lego` where it has run and SCENES/lego is there, else lego (or a
# procedural scene) after a minute.
set -euo pipefail
build=$1 data=$2/lego out=$1/bench
mkdir -p "$out"
scene=$build/lego/scene.snn
if [[ ! -d $data ]]; then
  data=$out/textured scene=
  [[ -e $data/transforms_test.json ]] || "$build/bin/sf_scene" textured -o "$data" >&2
fi
whose=$(cd "$data" && pwd -P)
[[ -e $out/data && $(<"$out/data") = "$whose" ]] || { rm -f "$out"/*.done "$out"/*.snn && echo "$whose" >"$out/data"; }
train() { "$build/bin/sf_train" "$data" -o "$1" --stage1 300 --stage2 900 --eval-views 1 "${@:2}" >&2; }
if [[ ! -e $scene ]]; then
  scene=$out/scene.snn
  if [[ ! -e $scene ]]; then
    train "$out/model.safetensors"
    "$build/bin/sf_export" "$out/model.safetensors" -o "$scene" >&2
  fi
fi
[[ -e $out/twin.done ]] || { train "$out/twin.safetensors" --net ann && touch "$out/twin.done"; }
printf '%s\n' "$scene" "$out/twin.safetensors" "$data"
