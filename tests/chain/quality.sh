#!/bin/bash
# make quality on one scene and a few iterations: the table, what is kept, what is compared, what is refused.
. "$(dirname "$0")/../chain.bash" "$@"
short=(--only simple --seeds "1 2" --stage1 20 --stage2 60 --samples 512 --out "$work/q")

# Pictures of 32 pixels where the script would make some of 200.
mkdir -p "$work/b/quality-data" "$work/b/bin"
ln -s "$build"/bin/* "$work/b/bin/"
"$build/bin/sf_scene" simple -o "$work/b/quality-data/simple" --size 32 --train 8 --test 2 -q || fail "no scene"
touch "$work/b/quality-data/simple/complete"

run() { "$root/tools/quality.sh" "$work/b" "$@" >"$work/out" 2>"$work/err"; }
row() { grep '^| simple |' "$work/out"; }

run "${short[@]}" --keep || fail "a short measurement: $(cat "$work/err")"
row | grep -qE '^\| simple \| [0-9.]+ \+- [0-9.]+ \| [0-9.]+ \+- ' || fail "no row of simple with two seeds: $(cat "$work/out")"
row | grep -q '(' && fail "compared with nothing"
[ -s "$work/q/kept.json" ] || fail "--keep kept nothing"
for key in psnr twin_psnr excess_mse t_star t_r worth price lost_cells; do
  grep -q "\"$key\"" "$work/q/quality.json" || fail "quality.json has no $key"
done

touch -d '2001-01-01' "$work/q/simple/snn-1/train.jsonl"
run "${short[@]}" || fail "the second call: $(cat "$work/err")"
[ "$(date -r "$work/q/simple/snn-1/train.jsonl" +%Y)" = 2001 ] || fail "a finished run ran again"
[ "$(row | grep -o '(' | wc -l)" -ge 8 ] || fail "the kept table is not compared: $(row)"
rm "$work/b/bin/sf_train"
{ cat "$build/bin/sf_train" && echo; } >"$work/b/bin/sf_train" # another program, as after a change of a default
chmod +x "$work/b/bin/sf_train"
run "${short[@]}" || fail "another sf_train: $(cat "$work/err")"
[ "$(date -r "$work/q/simple/snn-1/train.jsonl" +%Y)" != 2001 ] || fail "a run of another sf_train was kept"
touch -d '2001-01-01' "$work/q/simple/snn-1/train.jsonl"
run "${short[@]}" --train "--beta 1" || fail "other options: $(cat "$work/err")"
[ "$(date -r "$work/q/simple/snn-1/train.jsonl" +%Y)" != 2001 ] || fail "a run of other options was kept"
row | cut -d'|' -f6 | grep -q ' 1.00 ' || fail "beta = 1 does not learn one step: $(row)"

# The share of lost cells: none of itself.
for seed in 1 2; do cp "$work/q/simple/ann-1/model.safetensors" "$work/q/simple/ann-2/model.safetensors"; done
cp "$work/q/simple/ann-1/model.safetensors" "$work/q/simple/snn-1/model.safetensors"
cp "$work/q/simple/ann-1/model.safetensors" "$work/q/simple/snn-2/model.safetensors"
lost() { "$build/bin/sf_quality" "$work/q" | grep '^| simple' | cut -d'|' -f10; }
lost | grep -q ' 0.000 +- 0.000 ' || fail "a model has lost cells of itself"

# occupancy MODEL OCTAL...: fills equal parts of the model's occupancy grid, one byte value (in octal) each.
occupancy() {
  local file=$1 header range first last
  shift
  header=$(od -An -tu8 -N8 "$file" | tr -d ' ')
  range=$(head -c $((8 + header)) "$file" | grep -ao '"occupancy":{[^}]*}' | grep -o 'data_offsets":\[[^]]*' | grep -o '[0-9]*,[0-9]*')
  first=${range%,*} last=${range#*,}
  for value in "$@"; do
    head -c $(((last - first) / $#)) /dev/zero | tr '\000' "\\$value"
  done | dd of="$file" bs=64K seek=$((8 + header + first)) oflag=seek_bytes conv=notrunc status=none
}
# Both twins have all cells of the first half and four of eight in the second: 6 parts of 8. Spiking models: the first one lacks
# the first quarter, 2 of 6. The second one lacks half of the first half and all that the twins share in the second, 4 of 6.
occupancy "$work/q/simple/ann-1/model.safetensors" 377
occupancy "$work/q/simple/ann-2/model.safetensors" 377 017
occupancy "$work/q/simple/snn-1/model.safetensors" 000 377 377 377
occupancy "$work/q/simple/snn-2/model.safetensors" 360
lost | grep -q ' 0.500 +- ' || fail "the share of lost cells is not (2/6 + 4/6) / 2: $(lost)"
grep -A9 '"lost_cells"' "$work/q/quality.json" | grep -q '0\.333' || fail "the least share of lost cells is not 2/6"

run --only mars; [ $? -eq 2 ] && grep -q "scene 'mars' is unknown" "$work/err" || fail "an unknown scene: $(cat "$work/err")"
run --seeds x; [ $? -eq 2 ] || fail "--seeds x"
run --only mic; [ $? -eq 1 ] && grep -q 'no scene is left' "$work/err" || fail "no scene there: $(cat "$work/err")"
mkdir "$work/none"
"$build/bin/sf_quality" "$work/none" >"$work/out" 2>"$work/err"; [ $? -eq 1 ] && grep -q 'no finished run' "$work/err" || fail "an empty folder"
[ ! -e "$work/none/quality.json" ] || fail "a table of nothing was written"
exit $((failures > 0))
