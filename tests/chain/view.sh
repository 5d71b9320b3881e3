#!/bin/bash
# sf_view and sf_train --view in a real browser: the page opens, turns, is clicked on; what it shows and saves is
# sim_render's, byte for byte; no script error; nothing leaves the window, in light, dark and narrow. Screenshots in
# BUILD/tests/view.
. "$(dirname "$0")/../small_scene.bash"
here=$(cd "$(dirname "$0")" && pwd)
python=/usr/bin/python3 # Debian's has selenium
chromium=$(command -v chromium || true)
if [ -z "$chromium" ] || ! command -v chromedriver >/dev/null || ! "$python" -c 'import selenium' 2>/dev/null; then
  echo "chromium, chromium-driver and python3-selenium are needed: the pages were not looked at"
  exit 77
fi
mkdir -p "$build/tests/view"
"$build/bin/sf_scene" simple -o "$work/set" --size 48 --train 8 --test 2 >/dev/null &&
  "$build/bin/sf_train" "$work/set" -o "$work/model.safetensors" --stage1 30 --stage2 60 --samples 2048 --levels 6 --log2-hash 12 \
    --finest-res 64 --lattice 128 --occ-res 32 --quiet --json >/dev/null &&
  "$build/bin/sf_export" "$work/model.safetensors" -o "$work/trained.snn" >/dev/null || fail "a small scene"
"$build/faults/sf_cosim" "$work/scene.snn" "$work/data" --rays 100 --seed 7 --limit-samples 1000 --quiet --evidence "$work/evidence" \
  --plusarg "+fault=1" >"$work/fault.out" 2>&1
[ -s "$work/evidence.json" ] || fail "a planted fault: $(cat "$work/fault.out")"
"$python" "$here/../view/browse.py" "$build" "$work" "$chromium" || fail "the browser, see above"
finish "the pages work"
