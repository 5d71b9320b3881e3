#!/bin/bash
# make speed-error on a scene of its own: every kind of point, fronts that another program finds, too, finished points kept, and
# what is missing said in one line. usage: speed_error.sh BUILD
. "$(dirname "$0")/../tool_run.bash" speed_error "$@"
tool=${script%.sh}.py
build b
out=$work/b/speed-error/smoke
# measure STATUS TEXT OPTIONS...: output in $work/out, which holds TEXT
measure() {
  local wanted=$1 text=$2 got
  "$tool" "$work/b" --profile smoke "${@:3}" >"$work/out" 2>&1
  got=$?
  [ $got -eq "$wanted" ] || fail "${*:3}: exit status $got, expected $wanted"
  grep -qF -e "$text" "$work/out" || fail "${*:3}: does not say '$text'"
}
measure 1 "no points: run it without --report" --report
measure 0 "speed-error.html: "
first=$(sed -n 's/.*html: \([0-9]*\) points$/\1/p' "$work/out")
[ "$first" -ge 15 ] || fail "$first points"
for point in "t = 1" "t = 8" "weights of 4 bits" "fit, 0.05 dB" float portable "RTL in Verilator" TensoRF; do
  grep -qF "| $point |" "$out/table.md" || fail "no point '$point'"
  grep -qF "<td>$point</td>" "$out/speed-error.html" || fail "the page has no '$point'"
done
for file in speed-error.svg speed-error.html; do
  python3 - "$out/$file" <<'END' || fail "$file: no picture with a circle for each point and cost"
import json, os, re, sys
text = open(sys.argv[1]).read()
points = json.load(open(os.path.join(os.path.dirname(sys.argv[1]), "points.json")))
sys.exit(text.count("<title>") - text.count("<title>Speed") != sum(k in p for p in points for k in ("seconds", "cycles", "mj")))
END
done

# Fronts by walking from the cheapest on: a point is on the front where nothing cheaper or as cheap is as good or better.
python3 - "$out/points.json" <<'END' || fail "fronts"
import json, sys
points = json.load(open(sys.argv[1]))
wrong = 0
for key in ("seconds", "cycles", "mj"):
    best = float("-inf")
    priced = sorted((p for p in points if key in p), key=lambda p: (p[key], -p["psnr"]))
    for p in priced:
        same = [q for q in priced if q[key] == p[key]]
        on = p["psnr"] > best or (p["psnr"] == max(q["psnr"] for q in same) and all(q["psnr"] < p["psnr"] or q in same for q in priced if q[key] <= p[key]))
        wrong += on != (key in p.get("fronts", []))
        best = max(best, p["psnr"])
by_name = {p["name"]: p for p in points}
# What must hold of any run: instruction sets and RTL give one picture, more steps take more cycles and energy.
same = [by_name[n] for n in ("portable", "RTL in Verilator") if n in by_name]
wrong += len({(p["psnr"], p["cycles"], p["mj"]) for p in same}) != 1
steps = [by_name[f"t = {t}"] for t in range(1, 9)]
wrong += any(a["cycles"] >= b["cycles"] or a["mj"] >= b["mj"] for a, b in zip(steps, steps[1:]))
wrong += any(abs(p["excess_squared_error"] - 10 ** (-p["psnr"] / 10) + 10 ** (-p["float_psnr"] / 10)) > 1e-15 for p in points)
wrong += any(p["t_r"] != t for t, p in enumerate(steps, 1))
sys.exit(wrong)
END

measure 0 "$first points"
grep -qE '^  (steps|widths|fit|training|backbone)' "$work/out" && fail "finished points were made again"
rm "$out/points/steps-t = 3.json"
measure 0 "  steps: t = 3"
[ "$(grep -c '^  steps' "$work/out")" -eq 1 ] || fail "more than the point that was gone"
cp "$out/models/tensorf.safetensors" "$work/t" && rm "$out/models/tensorf.safetensors"
"$programs/sf_train" "$out/scene" -o "$out/models/tensorf.safetensors" --backbone tensorf --stage1 2 --stage2 2 --samples 512 --rays 64 --voxels 16 \
  --occ-res 16 -q >/dev/null || fail "another model"
measure 0 "  backbone: TensoRF"
measure 1 "speed_error: $work/none: no such folder" --data "$work/none"
echo "speed_error: $first points, fronts as another program finds them, finished points kept"
