#!/bin/bash
# The whole chain on one scene: train, export, render, co-simulate, audit, summary.
# usage: chain.sh BUILD DATA OUT [--minutes M] [--rays N] [--view K] [--train "OPTIONS"]
set -euo pipefail
if [ $# -lt 3 ]; then
  echo 'usage: chain.sh BUILD DATA OUT [--minutes M] [--rays N] [--view K] [--train "OPTIONS"]' >&2
  exit 2
fi
build=$1 data=$2 out=$3
shift 3
minutes=10 rays=400 view=0 train=
while [ $# -gt 0 ]; do
  case $1 in
    --minutes | --rays | --view | --train) [ $# -gt 1 ] || { echo "chain.sh: $1 needs a value" >&2; exit 2; } ;;&
    --minutes) minutes=$2 ;;
    --rays) rays=$2 ;;
    --view) view=$2 ;;
    --train) train=$2 ;;
    *) echo "chain.sh: unknown option $1" >&2; exit 2 ;;
  esac
  shift 2
done
[ -e "$data" ] || { echo "chain.sh: $data: no such scene (set SCENES=folder)" >&2; exit 1; }
bin=$build/bin
mkdir -p "$out"
started=${STARTED:-$(date +%s)}

step() { printf '\n== %s\n' "$1"; }
step "1/6 train: photographs to a spiking radiance field and its time budget t_r"
# shellcheck disable=SC2086
"$bin/sf_train" "$data" -o "$out/model.safetensors" --minutes "$minutes" $train --json | tee "$out/train.json"
step "2/6 export: float to integers"
"$bin/sf_export" "$out/model.safetensors" -o "$out/scene.snn" --json >"$out/export.json"
ls -l "$out/scene.snn" | awk '{ printf "%s: %.1f MB\n", $NF, $5 / 1e6 }'
step "3/6 render view $view: float, then the fixed-point golden image"
"$bin/sim_render" "$out/scene.snn" "$data" --view "$view" --backend float --model "$out/model.safetensors" -o "$out/float.exr" --json >"$out/float.json"
"$bin/sim_render" "$out/scene.snn" "$data" --view "$view" --backend fixed -o "$out/golden.exr" --png "$out/preview.png" --json >"$out/fixed.json"
step "4/6 render a crop through the Verilog accelerator and compare it with the fixed-point core, byte for byte"
"$bin/sim_render" "$out/scene.snn" "$data" --view "$view" --backend rtl -o "$out/crop_rtl.exr" --json >"$out/rtl.json"
crop=$(tr -d ' \n\t' <"$out/rtl.json" | sed -E 's/.*"crop":\[([0-9,]+)\].*/\1/')
"$bin/sim_render" "$out/scene.snn" "$data" --view "$view" --backend fixed --crop "$crop" -o "$out/crop_fixed.exr" --json >/dev/null
cmp "$out/crop_rtl.exr" "$out/crop_fixed.exr"
echo "crop $crop: identical"
step "5/6 co-simulate: RTL against the fixed-point core, spike by spike"
"$bin/sf_cosim" "$out/scene.snn" "$data" --rays "$rays" --seed 1 --evidence "$out/cosim-difference" --json >"$out/cosim.json"
step "6/6 audit: every operation, counted three times"
"$bin/energy_audit" "$out/scene.snn" "$data" --view "$view" --html "$out/report.html" --model "$out/model.safetensors" --json >"$out/audit.json"
"$bin/sf_summary" "$out" $(($(date +%s) - started))
printf 'See it from any side: %q %q %q --model %q\n' "$bin/sf_view" "$out/scene.snn" "$data" "$out/model.safetensors"
