# For scripts of tests/chain that try every tool on a kind of scene; no tool refuses any:   . every_tool.bash BUILD
# Gives data sets object, place (around the camera) and faces (forward-facing), and every_tool.
set -euo pipefail
bin=$(cd "$1/bin" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export OMP_NUM_THREADS=2
failures=0
fail() { echo "every_tool: $1" >&2; failures=$((failures + 1)); }

"$bin/sf_scene" textured -o object --size 40 --train 9 --test 2 --quiet >/dev/null
"$bin/sf_scene" plaza -o place --size 40 --train 9 --test 2 --quiet >/dev/null
# A forward-facing capture: the pictures of the object, cameras side by side.
python3 - <<'PYTHON'
import os, shutil, struct
pictures = sorted(f for f in os.listdir("object/train") if f.endswith(".png"))
os.makedirs("faces/images")
row = []
for i, name in enumerate(pictures):
    shutil.copy(os.path.join("object/train", name), os.path.join("faces/images", name))
    pose = [[0, 1, 0, 0.1 * i, 40], [-1, 0, 0, 0.05 * (i % 3), 40], [0, 0, 1, 0, 50]]  # down, right, back, place, size and focal
    row.append([x for line in pose for x in line] + [2, 10])
header = "{'descr': '<f8', 'fortran_order': False, 'shape': (%d, 17), }" % len(row)
header += " " * (63 - (10 + len(header)) % 64) + "\n"
with open("faces/poses_bounds.npy", "wb") as f:
    f.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode())
    f.write(b"".join(struct.pack("<17d", *r) for r in row))
PYTHON

tool() { # SCENE TOOL COMMAND...
  local name="$1, $2"
  shift 2
  "$@" >out.txt 2>err.txt || fail "$name: $(tail -1 err.txt)"
}

every_tool() { # SCENE DATA TRAIN-OPTIONS...
  local s=$1 d=$2
  shift 2
  "$bin/sf_train" "$d" -o "$s.safetensors" --stage1 20 --stage2 30 --steps 2 --hidden 32 --occ-res 16 --eval-views 1 --quiet "$@" >/dev/null ||
    { fail "$s: training"; return; }
  "$bin/sf_export" "$s.safetensors" -o "$s.snn" >/dev/null || { fail "$s: export"; return; }
  tool "$s" float "$bin/sim_render" "$s.snn" "$d" --backend float --model "$s.safetensors" --crop 8,8,4,4 -o o.exr --quiet
  tool "$s" fixed "$bin/sim_render" "$s.snn" "$d" --backend fixed --crop 18,18,2,2 -o fixed.exr --quiet
  tool "$s" rtl "$bin/sim_render" "$s.snn" "$d" --backend rtl --crop 18,18,2,2 -o rtl.exr --quiet
  cmp -s fixed.exr rtl.exr || fail "$s: core and accelerator differ"
  tool "$s" set "$bin/sim_render" "$s.snn" "$d" --all --crop 18,18,2,2 -o "$s.set" --quiet
  tool "$s" cosim "$bin/sf_cosim" "$s.snn" "$d" --rays 6 --quiet
  tool "$s" audit "$bin/energy_audit" "$s.snn" "$d" --rays 50 --rtl-rays 4 --quiet
  "$bin/sf_train" "$d" -o twin.safetensors --net ann --stage1 5 --stage2 5 --occ-res 16 --eval-views 1 --quiet "$@" >/dev/null ||
    fail "$s: training of a twin"
  tool "$s" twin "$bin/energy_audit" "$s.snn" "$d" --rays 20 --rtl-rays 0 --twin twin.safetensors --quiet
  tool "$s" convert "$bin/sf_convert" twin.safetensors "$d" --rays 10
  tool "$s" html "$bin/energy_audit" "$s.snn" "$d" --rays 50 --rtl-rays 2 --html "$s.html" --quiet
  tool "$s" cycles "$bin/sf_cycles" "$s.snn" "$d" --downscale 4 --quiet
  tool "$s" explore "$bin/sf_cycles" "$s.snn" "$d" --downscale 8 --explore --quiet
  tool "$s" error_budget "$bin/error_budget" "$s.safetensors" "$s.snn" "$d" --rays 4 --samples 100 --quiet
  tool "$s" fit "$bin/sf_export" "$s.safetensors" -o fit.snn --fit --data "$d" --fit-rays 256 --quiet
  tool "$s" fit-cosim "$bin/sf_cosim" fit.snn "$d" --rays 4 --quiet
  tool "$s" fit-audit "$bin/energy_audit" fit.snn "$d" --rays 50 --rtl-rays 2 --quiet
  tool "$s" fit-fixed "$bin/sim_render" fit.snn "$d" --backend fixed --crop 18,18,2,2 -o fixed.exr --quiet
  tool "$s" fit-rtl "$bin/sim_render" fit.snn "$d" --backend rtl --crop 18,18,2,2 -o rtl.exr --quiet
  cmp -s fixed.exr rtl.exr || fail "$s: core and accelerator differ in the fitted scene"
  [ "$d" != object ] || tool "$s" fit-bytes "$bin/sf_export" "$s.safetensors" -o bytes.snn --fit --data "$d" --fit-rays 256 --fit-bytes $((1 << 15)) --quiet
  tool "$s" fine-tune "$bin/sf_train" "$d" -o tuned.safetensors --fine-tune "$s.safetensors" --weight-bits 6 --stage2 5 --eval-views 1 --quiet
  tool "$s" vectors "$bin/sf_export" "$s.snn" --vectors "$s.kit" --data "$d" --samples 4
  tool "$s" traces "$bin/sf_export" "$s.snn" --traces "$s.traces" --data "$d" --rays 2
  "$bin/sf_export" "$s.snn" --nir "$s.nir" >/dev/null 2>err.txt && fail "$s, nir: mode radix as a NIR graph"
  grep -q "input-mode hybrid" err.txt || fail "$s, nir: $(cat err.txt)"
  "$bin/sf_train" "$d" -o leaky.safetensors --input-mode hybrid --stage1 2 --stage2 2 --steps 2 --hidden 32 --occ-res 16 --eval-views 1 \
    --quiet "$@" >/dev/null || fail "$s: training of leaky neurons"
  tool "$s" nir "$bin/sf_export" leaky.safetensors --nir "$s.nir"
  tool "$s" activity "$bin/sf_cosim" "$s.snn" "$d" --rays 2 --saif "$s.saif" --quiet
  [ ! -x "$bin/sf_soc" ] || tool "$s" sf_soc "$bin/sf_soc" "$s.snn" "$d" --crop 18,18,1,1
}
