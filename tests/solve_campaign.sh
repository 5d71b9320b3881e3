#!/bin/bash
# What poses that COLMAP found are worth: the camera positions and the PSNR that training reaches, against those of the poses
# that the pictures were made with.   usage: solve_campaign.sh BUILD [SEED...]
# 60 views of a made scene; 2000 iterations a seed with the search for t*. What is there already in BUILD/solve-campaign is
# kept. Status 1: a camera lies off by more than 0.5 %, or the mean PSNR is more than 0.5 dB lower.
set -euo pipefail
build=$(cd "${1:?usage: $0 BUILD [SEED...]}" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
shift
[ $# -gt 0 ] || set -- 1 2 3
work=$build/solve-campaign
mkdir -p "$work"
cd "$work"

[ -e views/transforms_test.json ] || "$build/bin/sf_scene" terrazzo -o views --size 400 --train 60 --test 1
# Both data sets list the same pictures in the same order, so that they hold out the same ones.
python3 - <<'END'
import json, os
data = json.load(open("views/transforms_train.json"))
for frame in data["frames"]:
    frame["file_path"] = "images/" + os.path.basename(frame["file_path"]) + ".png"
data["frames"].sort(key=lambda frame: frame["file_path"])
os.makedirs("true", exist_ok=True)
if not os.path.islink("true/images"):
    os.symlink("../views/train", "true/images")
json.dump(data, open("true/transforms.json", "w"))
END
"$build/bin/sf_data" views/train --solve -o solved
"$build/bin/sf_data" views --json >views.json
"$build/bin/sf_data" solved --json >solved.json
python3 "$here/similarity.py" views.json solved.json 0.5

for seed in "$@"; do
  for poses in true solved; do
    name=$poses-$seed
    [ -s "$name.json" ] && continue
    again=
    [ ! -e "$name.safetensors" ] || again=--resume
    "$build/bin/sf_train" $poses -o "$name.safetensors" --stage1 600 --stage2 1400 --samples 8192 --seed "$seed" --json $again >"$name.part"
    mv "$name.part" "$name.json"
  done
done
python3 - "$@" <<'END'
import json, statistics, sys
print("| seed | true poses: dB, t_r | COLMAP's: dB, t_r | difference, dB |\n|---|---|---|---|")
differences = []
for seed in sys.argv[1:]:
    true, solved = (json.load(open(f"{name}-{seed}.json")) for name in ("true", "solved"))
    differences.append(solved["psnr"] - true["psnr"])
    print(f"| {seed} | {true['psnr']:.2f}, {true['t_r']} | {solved['psnr']:.2f}, {solved['t_r']} | {differences[-1]:+.2f} |")
mean = statistics.mean(differences)
spread = f", standard deviation {statistics.stdev(differences):.2f}" if len(differences) > 1 else ""
print(f"mean difference {mean:+.2f} dB{spread}")
sys.exit(f"solve-campaign: COLMAP's poses cost {-mean:.2f} dB, at most 0.5 is expected" if mean < -0.5 else 0)
END
