#!/bin/bash
# Good runs of every program, beside which nothing is written on stderr; interruptions.   usage: cli.sh BUILD
. "$(dirname "$0")/../cli_run.bash" "$@"

good sf_scene simple -o simple --size 4 --train 1 --test 1
good sf_data d --png cameras.png
good sf_data d --json
usage "missing argument" sf_data
usage "usage: sf_export MODEL -o SCENE [--vectors DIR] [options] (see sf_export --help)" sf_export # the first form alone
data "d/transforms_train.json: not a model or a scene" sf_export d/transforms_train.json -o out
data "no such folder" sf_data absent
usage "missing option -o DIR" sf_data d --solve
usage "--frames has no effect without --solve" sf_data d --frames 20
usage "--matching" sf_data d --solve -o out --matching some
data "d: no JPEG or PNG picture is there" sf_data d --solve -o out && rm -r out
data "cannot write" sf_data d --png absent/cameras.png
# A pixel of these pictures: 2 * bound * 22.22 px of focal length / 3.22 of distance, at least the coarsest level. Equal
# steps are a pixel long, or less: 13.8 sqrt(3) = 23.9 of 2 sqrt(3) / lattice units, even.
while read -r finest lattice options; do
  steps="steps of 2 sqrt(3) / $lattice"
  [ "$lattice" != - ] || steps="steps of distance / 128"
  # shellcheck disable=SC2086
  run sf_train d -o box.safetensors --stage1 1 --stage2 1 --levels 2 --log2-hash 8 --threads 1 $options
  check "sf_train $options" "not $steps, finest level $finest, but: $(head -n 1 stdout.txt)" \
    grep -qF "$steps, finest level $finest," stdout.txt
done <<'END'
14 26 --base-res 2
56 - --base-res 2 --bound 4
56 26 --base-res 2 --bound 4 --dt-gamma 0
16 26
16 200 --lattice 200
77 26 --finest-res 77
END
# A box that the pictures show more than, or little of, is told before anything is learned.
while IFS='|' read -r said options; do
  # shellcheck disable=SC2086
  run sf_train d -o box.safetensors --stage1 1 --stage2 1 --levels 2 --log2-hash 8 --lattice 128 --threads 1 -q $options
  check "sf_train $options" "exit status $status" [ $status -eq 0 ]
  check "sf_train $options" "it says '$(cat err)', not '$said'" [ "$(sed -E 's/ (to|within|--scale) [0-9]+(\.[0-9]+)?/ \1 N/g' err)" = "$said" ]
done <<'END'
|--scale 0.8
sf_train: warning: box: the pictures show what lies beyond [-1, 1]^3: it would have to reach to N. Try --scale N (now 4), or a larger --bound|--scale 4
|--scale 4 --bound 8
sf_train: warning: box: what the pictures show lies within N of the middle of [-1, 1]^3. Try --scale N (now 0.05)|--scale 0.05
sf_train: warning: box: what the pictures show lies within N of the middle of [-8, 8]^3. Try --scale N (now 0.05)|--scale 0.05 --bound 8
END
good sf_train d -o tuned.safetensors --fine-tune model.safetensors --weight-bits 4 --stage2 2 --threads 1
good sf_export tuned.safetensors -o tuned.snn
if ! grep -q "4-bit weights" stdout.txt; then fail "tuned.safetensors" "is not exported with its own 4 bits"; fi
if grep -q "scales are not used" stdout.txt; then fail "tuned.safetensors" "a note about widths that are its own"; fi
sed 's/"h_shift":"3"/"h_shift":"4"/' tuned.safetensors >shifted.safetensors
data "h = current >> 4" sf_export shifted.safetensors -o out
good sf_export tuned.safetensors -o tuned.snn --grid-bits 7
if ! grep -q "scales are not used" stdout.txt; then fail "tuned.safetensors" "no note that its scales are not used"; fi
good sf_export model.safetensors -o fit.snn --fit --fit-loss 0 --data d --fit-rays 256 --json
good sf_cosim fit.snn d --rays 1 --seed 1
good sim_render s.snn d -o g.exr --png g.png --truth t.png
good sim_render s.snn d -o f.exr --backend float
good sim_render s.snn d -o train --all --split train
good sim_render s.snn -o c.exr --camera 9,8,9.5,9.5,4.5,4,1,0,0,0,0,0,-1,-3,0,1,0,0
# Threads that the address space has no room for are not asked for.
(ulimit -v 4000000 && OMP_STACKSIZE=16m "$BIN/sim_render" s.snn d --threads 1024 -o t.exr -q >stdout.txt 2>err)
check "sim_render --threads 1024" "no picture" cmp -s t.exr g.exr
good sim_render s.snn d -o r.exr --backend rtl --crop 7,7,2,2 --view 1
good sim_render s.snn d -o x.exr --backend fixed --crop 7,7,2,2 --view 1
good energy_audit s.snn d --rays 20 --rtl-rays 1 --json --csv a.csv
good energy_audit --published
good energy_audit s.snn d --rays 20 --rtl-rays 1 --recount-rays 5 --steps 1 --tech 45nm
good sf_train d -o twin.safetensors --net ann --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --lattice 128 --threads 1
good sf_convert twin.safetensors d --rays 5 --json
check sf_convert "squared error above the twin's" python3 -c 'import json
r = json.load(open("stdout.txt"))
error = lambda row: 10 ** (-row["psnr"] / 10)
assert all(abs(p["excess_squared_error"] - error(p) + error(r["twin"])) < 1e-12 for p in r["converted"])'
for line in "prefixes 0.5 radix" "paper 0 hybrid"; do
  read -r objective opaque mode <<<"$line"
  good sf_train d -o objective.safetensors --objective $objective --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --lattice 128 --threads 1 --json
  check "--objective $objective" "is not the price of a sample" grep -Eq "\"opaque\":[[:space:]]*$opaque," stdout.txt
  check "--objective $objective" "has other neurons" grep -Eq "\"mode\":[[:space:]]*\"$mode\"" stdout.txt
done
# An object's cells are small; a larger box has cascades of large ones.
cp -r d wide && sed -i '0,/{/s//{"aabb_scale": 4,/' wide/transforms_*.json
for line in "d 256" "wide 128" "wide 64 --occ-res 64"; do
  read -r data cells more <<<"$line"
  # shellcheck disable=SC2086
  good sf_train "$data" -o cells.safetensors $more --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --lattice 128 --threads 1
  check "$data $more" "has other cells" grep -aq "\"occ_res\":\"$cells\"" cells.safetensors
done
# A worth that was measured once has no standard error.
good sf_train d -o once.safetensors --stage1 2 --stage2 4 --levels 2 --log2-hash 8 --lattice 128 --threads 1
check sf_train "an error of one measurement" grep -Eq 'not reached; one more step is worth -?[0-9.e-]+ and costs [0-9.e-]+ \(measured once\)$' stdout.txt
check "sf_train --log" "an error of one measurement" python3 -c 'import json
last = [json.loads(line) for line in open("once.safetensors.jsonl")][-1]
assert last["worth"] and last["worth_error"] is None and last["price"] and last["price_error"] is None'
good sf_train d -o along.safetensors --steps-along-ray --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --lattice 128 --threads 1
check "along.safetensors" "its cost" grep -q "mJ a view: [0-9]* samples, each with [0-9]* products and [0-9]* additions that spikes cause" stdout.txt
data "along_ray" sf_export along.safetensors -o along.snn
data "along_ray" sf_train d -o out --fine-tune along.safetensors --stage2 2
good sf_train d -o vm.safetensors --backbone tensorf --stage1 2 --stage2 2 --voxels 16 --rays 64 --samples 256 --threads 1
good sf_train d -o vm-tuned.safetensors --fine-tune vm.safetensors --weight-bits 4 --grid-bits 5 --leak-bits 6 --stage2 2 --samples 256 --threads 1
good sf_export vm-tuned.safetensors -o vm-tuned.snn
if ! grep -q "at 4-bit weights, 12-bit features, 6-bit leaks, 5-bit grid entries" stdout.txt; then fail "vm-tuned.safetensors" "is not exported with its own widths"; fi
if grep -q "scales are not used" stdout.txt; then fail "vm-tuned.safetensors" "a note about widths that are its own"; fi
good sf_export vm-tuned.safetensors -o vm-tuned.snn --grid-bits 8
if ! grep -q "fine-tuned for 4-bit weights, 12-bit features and 5-bit grid entries; those scales are not used" stdout.txt; then fail "vm-tuned.safetensors" "no note about widths that are not its own"; fi
good energy_audit s.snn d --rays 20 --rtl-rays 0 --twin twin.safetensors
good energy_audit s.snn d --rays 20 --rtl-rays 0 --recount-rays 0 --json
check "a recount of nothing" "is equal" grep -q '"core_equals_recount":.null' stdout.txt
good energy_audit --compare s.snn s.snn d --rays 20 --rtl-rays 0 --steps-b 1 --json
good error_budget model.safetensors s.snn d --samples 100 --rays 4 --json
good sf_cosim s.snn d --rays 1 --seed 1 -q
good sf_cycles s.snn d --view 1 --clock 100 --json
check "rtl = fixed" "r.exr and x.exr differ" cmp -s r.exr x.exr
for f in model.safetensors s.snn g.exr g.png t.png f.exr a.csv; do
  check "good runs" "$f is missing" [ -s $f ]
done
# Cameras that look past the box at the layout's scale and stand in it at the scale that the scene was trained at.
mkdir away && cp -r d/train d/test away
for split in train test; do
  echo '{"camera_angle_x": 0.7, "frames": [{"file_path": "./'$split'/r_0", "transform_matrix":
    [[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 2], [0, 0, 0, 1]]}]}' >away/transforms_$split.json
done
good sf_train away -o small.safetensors --scale 0.4 --stage1 2 --stage2 2 --hidden 16 --steps 3 --levels 2 --log2-hash 8 --lattice 128 --threads 1
good sf_export small.safetensors -o small.snn
good sf_export small.safetensors -o fitted.snn --fit --data away --fit-rays 256 --traces small_traces --rays 4
good sim_render small.snn away -o out
good sim_render small.snn away -o out --scale 0.4 --backend float --model small.safetensors
good energy_audit small.snn away --rays 20 --rtl-rays 0
good error_budget small.safetensors small.snn away --samples 100 --rays 4
good sf_cosim small.snn away --rays 20
good sf_cycles small.snn away
good sf_export fitted.snn --vectors small_kit --samples 1 --data away
rm -rf out small_traces small_kit
data "no view looks at the scene" sim_render s.snn away -o out
for p in "sim_render -o out" energy_audit "error_budget small.safetensors"; do
  # shellcheck disable=SC2086
  data "small.snn: trained at scale 0.4, d is to be read at 0.8; give --scale 0.4" $p small.snn d --scale 0.8
done
good sf_export tuned.safetensors -o fitted.snn --fit --data d --fit-rays 256 --fit-loss 100 --json
check "--fit" "not the weights that the model was tuned for" grep -q '"weight_bits":.*4,' stdout.txt

# ---- interruption ----

run sf_scene simple -o wide --size 128 --train 3 --test 1 # the cameras of d
stop() { # OUTPUT PROGRAM ARGS...
  interrupt "sleep 0.5" stdout.txt err "$BIN/$2" "${@:3}"
  sed -i '/: learned from other pictures: wide has the same cameras/d' err # it is larger
  judge "interrupted: ${*:2}" "$2" 130 ""
  absent "$1" "interrupted: ${*:2}"
}
stop stop.exr sim_render s.snn wide --backend rtl --crop 0,0,128,128 -o stop.exr --png stop.exr.png
stop stop.snn sf_export model.safetensors -o stop.snn --fit --data wide --fit-rays 2000000 -q
stop stop.csv energy_audit s.snn wide --rays 1000000000 --csv stop.csv
absent stop.exr.png "interrupted: sim_render"

good sf_scene simple -o views --size 64 --train 2 --test 30
# Names are bytes, reports are UTF-8.
name=$(printf 'r_\377')
cp -r d bytes
mv bytes/test/r_0.png "bytes/test/$name.png"
sed -i "s#test/r_0\"#test/$name\"#" bytes/transforms_test.json
while read -r line; do
  good $line
  check "$line" "no UTF-8" iconv -f UTF-8 -t UTF-8 stdout.txt >/dev/null
done <<'END'
sf_data bytes --json
sim_render s.snn bytes --all -o bytes_all --json -q
sim_render s.snn bytes --verify bytes_all/manifest.json --json -q
energy_audit s.snn bytes --rays 20 --rtl-rays 1 --json -q
END

# Interrupted while it loads, a training leaves what is there.
cp model.safetensors before.safetensors
cp model.safetensors early.safetensors
interrupt true stdout.txt err "$BIN/sf_train" views -o early.safetensors
judge "interrupted at once: sf_train" sf_train 130 ""
check "interrupted at once" "model lost" cmp -s before.safetensors early.safetensors

# The evaluation after a training can be interrupted, too: its checkpoint is resumed to the evaluation alone.
brief=(views -o stop.safetensors --stage1 1 --stage2 1 --levels 2 --log2-hash 8 --lattice 128)
interrupt "[ -s stop.safetensors ]" stdout.txt err "$BIN/sf_train" "${brief[@]}" --psnr-prefixes 30
sed -i '/evaluation: view/d' err # progress lines
judge "interrupted evaluation: sf_train" sf_train 130 "interrupted in the evaluation"
# A checkpoint keeps the options of its run: others are refused, and none are needed.
for option in "--beta 1e-06" "--seed 2" "--stage2 3" "--minutes 1" "--net ann" "--steps 4" "--theta 0.5" "--no-extra" "--limit 1" "--downscale 1"; do
  data "stop.safetensors: its run has ${option%% *}" sf_train views -o stop.safetensors --resume $option
done
data "--beta 5e-07, the command line says 1e-06" sf_train "${brief[@]}" --resume --beta 1e-6
data "other views" sf_train wide -o stop.safetensors --resume
sed 's/"option.beta":"5e-07"/"option.beta":"5e+07"/' stop.safetensors >edited.file
data "edited.file: cannot resume: --beta 5e+07" sf_train views -o edited.file --resume
good sf_train views -o stop.safetensors --resume --stage2 1 --beta 5e-7 --eval-views 1 --json
check "resumed evaluation" "no summary" grep -q '"iterations":2,.*"views":1' stdout.txt
run sf_train "${brief[@]}" --resume --quiet
judge "finished: sf_train --resume" sf_train 1 "cannot resume"

finish
