#!/bin/bash
# What a set of runs of every program writes: models, scenes, pictures, counts, reports. A change that only moves code leaves it
# as it was. Takes about two minutes; what depends on the clock is left out.
# usage: same_bits.sh BUILD OUT               fills the folder OUT
#        same_bits.sh BUILD OUT REFERENCE     and compares it with an earlier OUT; exit status 1 at any difference
set -euo pipefail
if [ $# -lt 2 ] || [ $# -gt 3 ]; then
  sed -n '2,6s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
bin=$(cd "$1" && pwd)/bin
reference=${3:+$(cd "$3" && pwd)}
mkdir -p "$2"
cd "$2"

# run NAME PROGRAM...: its output and its exit status go to NAME.txt.
run() {
  local name=$1 status=0
  shift
  "$bin/$1" "${@:2}" >"$name.txt" 2>&1 || status=$?
  echo "exit status $status" >>"$name.txt"
}
small=(--stage1 40 --stage2 80 --samples 2048 --occ-res 32 --threads 2 --quiet)
grid=(--levels 6 --log2-hash 12 --finest-res 64 --lattice 128)

# chain NAME SCENE OPTION...: from pictures to reports, in files NAME.*
chain() {
  local name=$1 data=$2
  shift 2
  run "$name.train" sf_train "$data" -o "$name.safetensors" "${small[@]}" "$@" --psnr-prefixes 1 --json
  run "$name.export" sf_export "$name.safetensors" -o "$name.snn" --json
  run "$name.float" sim_render "$name.snn" "$data" --backend float --model "$name.safetensors" -o "$name.float.exr" --quiet --json
  run "$name.fixed" sim_render "$name.snn" "$data" --backend fixed -o "$name.fixed.exr" --png "$name.png" --quiet --json
  run "$name.rtl" sim_render "$name.snn" "$data" --backend rtl --crop 18,18,6,6 -o "$name.rtl.exr" --quiet --json
  run "$name.cosim" sf_cosim "$name.snn" "$data" --rays 12 --seed 3 --stalls 20 --json
  run "$name.cycles" sf_cycles "$name.snn" "$data" --downscale 2 --json
  run "$name.audit" energy_audit "$name.snn" "$data" --rays 60 --csv "$name.csv" --html "$name.html" --model "$name.safetensors" --json
  run "$name.budget" error_budget "$name.safetensors" "$name.snn" "$data" --rays 40 --samples 1000 --quiet --json
  run "$name.point" sf_point "$name.safetensors" "$data" --every 8 --weight-bits 6 --json
  run "$name.nir" sf_export "$name.safetensors" --nir "$name.nir" --json
  run "$name.kit" sf_export "$name.snn" --vectors "$name.kit" --data "$data" --samples 6 --rays 50
  run "$name.traces" sf_export "$name.snn" --traces "$name.traces" --data "$data" --rays 2
}

for scene in textured plaza; do run "scene.$scene" sf_scene "$scene" -o "$scene" --size 40 --train 10 --test 2 --quiet; done
run data sf_data textured --json
chain snn textured "${grid[@]}"
chain decay textured "${grid[@]}" --input-mode decay --hidden 64 --steps 3 --seed 2
chain large plaza "${grid[@]}" --bound 8 --steps 3
chain tensorf textured --backbone tensorf --voxels 20 --rays 256 --steps 3
for net in grid tensorf; do
  options=("${grid[@]}")
  [ $net = grid ] || options=(--backbone tensorf --voxels 20 --rays 256 --steps 3)
  run "ann.$net" sf_train textured -o "ann.$net.safetensors" "${small[@]}" "${options[@]}" --net ann --json
  run "paper.$net" sf_train textured -o "paper.$net.safetensors" "${small[@]}" "${options[@]}" --objective paper --price energy --json
done
run twin energy_audit snn.snn textured --rays 40 --twin ann.grid.safetensors --json
run compare energy_audit --compare snn.snn decay.snn textured --rays 20
run published energy_audit --published
run tuned sf_train textured -o tuned.safetensors --stage2 40 --samples 2048 --threads 2 --quiet --fine-tune snn.safetensors --json
run fit sf_export snn.safetensors -o fit.snn --fit --data textured --fit-rays 512 --quiet --json
run golden sim_render snn.snn textured --all --crop 16,16,8,8 -o golden --quiet --json
# Without what the clock decides, where the programs lie, and copies of the RTL's text.
sed -i "s|$bin/||g; s|${bin%/bin}/||g" ./*.txt ./*.html
rm -rf ./*.kit/rtl ./*.kit/manifest.json
sed -E -i 's/"([a-z_]*seconds|[a-z_]*per_second)":[[:space:]]*[0-9.e+-]+,?//g; s/ in [0-9.]+ m?s\>//; s/[0-9.]+ [kM]?[a-z]+\/s//g' ./*.txt ./*.jsonl ./*.html

[ -n "$reference" ] || exit 0
diff -rq "$reference" . && echo "same bits: $(find . -type f | wc -l) files"
