#!/bin/bash
# sf_cycles says what the net at hand has, and no more; its plot is drawn. usage: cycles.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"
cd "$work" || exit 1
"$build/bin/sf_train" data -o vm.safetensors --backbone tensorf --stage1 5 --stage2 10 --samples 512 --rays 64 --voxels 16 \
  --steps 3 --occ-res 16 --quiet >/dev/null && "$build/bin/sf_export" vm.safetensors -o vm.snn >/dev/null || exit 1

# layers NAME SCENE WANTED...: in the text and in the JSON
layers() {
  "$build/bin/sf_cycles" "$2" data --quiet >"$1.txt" && "$build/bin/sf_cycles" "$2" data --quiet --json >"$1.json" || fail "$1"
  [ "$(grep -oE '\b[CD][123] [0-9.]+ %' "$1.txt" | cut -c1-2 | tr '\n' ' ')" = "$3 " ] || fail "$1: $(grep utilisation "$1.txt")"
  [ "$(grep -oE '"[CD][123]":' "$1.json" | tr -d '":' | tr '\n' ' ')" = "$3 " ] || fail "$1: $(grep '"[CD]' "$1.json")"
  grep -qE 'samples?, t_r = [1-9]' "$1.txt" || fail "$1: $(head -n 1 "$1.txt")"
}
layers hash scene.snn 'D1 D2 C1 C2 C3'
layers tensorf vm.snn 'C1 C2 C3'
grep -q 'D[12]' tensorf.txt && fail "TensoRF has neither D1 nor D2: $(grep 'D[12]' tensorf.txt)"

# The plot has the numbers of the table: 4 clocks by 4 counts of cores.
mkdir plots
"$build/bin/sf_cycles" scene.snn data --quiet --plot plots/frames.gp >plot.txt 2>plot.err || fail "--plot: $(cat plot.err)"
grep -q 'plots/frames.gp' plot.err || fail "--plot says nothing: $(cat plot.err)"
table=$(sed -n '/^frames\/s/,/^$/p' hash.txt | awk '/MHz/ { print $1, $3, $4, $5, $6 }')
[ "$(awk '/^EOD/ { on = 0 } on { printf "%d %.2f %.2f %.2f %.2f\n", $1, $2, $3, $4, $5 } /<< EOD/ { on = 1 }' plots/frames.gp)" = "$table" ] &&
  [ "$(wc -l <<<"$table")" -eq 4 ] || fail "plots/frames.gp is not the table: $table"
"$build/bin/sf_cycles" scene.snn data --plot frames.svg 2>plot.err
[ $? -eq 2 ] && grep -q 'expected NAME.gp' plot.err || fail "--plot frames.svg: $(cat plot.err)"
if command -v gnuplot >/dev/null; then
  (cd plots && gnuplot frames.gp) >plot.err 2>&1 && grep -q '</svg>' plots/frames.svg && grep -q '8 cores' plots/frames.svg ||
    fail "gnuplot: $(cat plot.err)"
else
  echo "gnuplot: not on this machine"
fi
finish "sf_cycles names the layers that there are, and its plot shows its table"
