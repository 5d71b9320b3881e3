#!/usr/bin/env bash
# Models for the frame of the benchmark, made once: usage: bench_models.sh BUILD SCENES. Prints scene, twin and data folder, a line each.
# The scene is that of `make lego` where it has run, else lego (or, without SCENES/lego, a procedural scene) after a minute.
set -euo pipefail
build=$1 data=$2/lego out=$1/bench
mkdir -p "$out"
if [[ ! -d $data ]]; then
  data=$out/textured
  [[ -e $data/transforms_test.json ]] || "$build/bin/sf_scene" textured -o "$data" >&2
fi
train() { "$build/bin/sf_train" "$data" -o "$1" --stage1 300 --stage2 900 --eval-views 1 "${@:2}" >&2; }
scene=$build/lego/scene.snn
if [[ ! -e $scene ]]; then
  scene=$out/scene.snn
  if [[ ! -e $scene ]]; then
    train "$out/model.safetensors"
    "$build/bin/sf_export" "$out/model.safetensors" -o "$scene" >&2
  fi
fi
[[ -e $out/twin.done ]] || { train "$out/twin.safetensors" --net ann && touch "$out/twin.done"; }
printf '%s\n' "$scene" "$out/twin.safetensors" "$data"
