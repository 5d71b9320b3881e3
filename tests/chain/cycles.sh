#!/bin/bash
# sf_cycles says what the net at hand has, and no more; its plot is drawn. usage: cycles.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"
cd "$work" || exit 1
"$build/bin/sf_train" data -o vm.safetensors --backbone tensorf --stage1 50 --stage2 50 --samples 512 --rays 64 --voxels 16 \
  --steps 3 --occ-res 16 --quiet >/dev/null && "$build/bin/sf_export" vm.safetensors -o vm.snn >/dev/null || exit 1

number() { sed -E -n "s/^\\s*\"$1\":\\s*([0-9.e+-]+),?$/\\1/p" "$2" | head -n 1; } # of a report, by its key
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

# TensoRF is modelled from positions on: a slower memory takes longer for the same work. Other builds are as fast at most.
"$build/bin/sf_cycles" vm.snn data --downscale 2 --quiet --latency 1 --builds --json >fast.json && "$build/bin/sf_cycles" vm.snn data --downscale 2 --quiet --latency 100 --json >slow.json ||
  fail "--latency"
fast=$(number cycles fast.json) slow=$(number cycles slow.json)
[ "$fast" -gt 1000 ] && [ "$slow" -gt "$fast" ] || fail "latencies: $fast and $slow cycles"
for count in densities lookups misses samples; do
  [ "$(number $count fast.json)" -gt 0 ] && [ "$(number $count fast.json)" = "$(number $count slow.json)" ] || fail "$count depends on the memory"
done
[ "$(number cycles fast.json)" -ge "$(number lookups fast.json)" ] || fail "more than a look-up a cycle"
grep -q 'densities of the field, ' tensorf.txt && grep -q 'answers after 16 cycles' tensorf.txt || fail "the field in the text"
"$build/bin/sf_cycles" vm.snn data --downscale 2 --quiet --threads 1 --latency 1 --builds --json >one.json && cmp -s fast.json one.json || fail "cycles depend on threads"
"$build/bin/sf_cycles" scene.snn data --latency 10 >plot.txt 2>plot.err
[ $? -eq 2 ] && grep -q 'has a hash grid' plot.err || fail "--latency of a hash grid: $(cat plot.err)"

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
# --explore: this build's point is what the audit and the cycle model say, and so is another cache.
"$build/bin/sf_cycles" scene.snn data --downscale 2 --quiet --explore --plot plots/builds.gp --json >explore.json 2>explore.err || fail "--explore: $(cat explore.err)"
# point BYTES WAYS MACS NEURONS STEPS KEY
point() {
  tr -d ' \t\n' <explore.json | grep -oE '\{"macs":[^}]*\}' |
    grep "\"macs\":$3,\"neurons\":$4,\"steps_at_once\":$5,.*\"cache_bytes\":$1,\"cache_ways\":$2," | sed -E "s/.*\"$6\":([^,}]*).*/\1/"
}
for cache in '32768 4' '1024 1' '8192 2'; do
  read -r bytes ways <<<"$cache"
  "$build/bin/energy_audit" scene.snn data --view 0 --downscale 2 --rtl-rays 0 --recount-rays 1 --cache-bytes "$bytes" --cache-ways "$ways" --quiet --json |
    tr -d ' \t\n' >audit.json || fail "audit"
  wanted=$(sed -E 's/.*"key":"neuron"[^{]*"mj_per_view":([^,]*),.*/\1/' audit.json)
  got=$(point "$bytes" "$ways" 128 16 2 mj_per_frame)
  awk -v a="$wanted" -v b="$got" 'BEGIN { exit !(a > 0 && (a - b) ^ 2 <= (1e-9 * a) ^ 2) }' || fail "cache $cache: $got mJ, the audit says $wanted"
done
"$build/bin/sf_cycles" scene.snn data --downscale 2 --quiet --json >half.json || fail "--downscale"
wanted=$(number cycles half.json) got=$(point 32768 4 128 16 2 cycles)
awk -v a="$wanted" -v b="$got" 'BEGIN { exit !((a - b) ^ 2 < (0.02 * a) ^ 2) }' || fail "explore: $got cycles, the model says $wanted"
[ "$(grep -c '"this_build":.*true' explore.json)" -eq 1 ] && [ "$(grep -c '"board":.*true' explore.json)" -eq 1 ] || fail "this build, the board"
[ "$(grep -c '"front":.*true' explore.json)" -ge 1 ] && grep -q 'Pareto front' plots/builds.gp && grep -q 'builds.gp' explore.err || fail "the front"
"$build/bin/sf_cycles" scene.snn data --downscale 2 --quiet --explore --threads 1 --json >one.json && cmp -s explore.json one.json || fail "--explore depends on threads"
"$build/bin/sf_cycles" scene.snn data --downscale 4 --quiet --explore >explore.txt && grep -q 'Pareto front' explore.txt && grep -q "the board's" explore.txt ||
  fail "--explore as text"
"$build/bin/sf_cycles" vm.snn data --downscale 4 --quiet --explore >explore.txt || fail "--explore of TensoRF"
"$build/bin/sf_cycles" scene.snn data --tech 45nm >explore.txt 2>plot.err
[ $? -eq 2 ] && grep -q 'goes with --explore' plot.err || fail "--tech alone: $(cat plot.err)"
finish "sf_cycles names the layers that there are, and its plot shows its table"
