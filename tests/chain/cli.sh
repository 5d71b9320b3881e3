#!/bin/bash
# Bad input to every program: exit status 2 for usage and 1 for data, exactly one line on stderr that names the option
# or the file, no partial output, never a crash.   usage: cli.sh BUILD
set -u
BIN=$(cd "${1:?usage: cli.sh BUILD}/bin" && pwd) || exit 2
TOOLS=$(cd "$(dirname "$0")/../../tools" && pwd) || exit 2
export LC_ALL=C OMP_NUM_THREADS=2
WORK=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-cli-XXXXXX") || exit 2
trap 'rm -rf "$WORK"' EXIT
trap 'exit 130' INT TERM
cd "$WORK" || exit 2
passed=0 failed=0

fail() {
  failed=$((failed + 1))
  echo "FAILED $1: $2"
  sed 's/^/    stderr: /' err 2>/dev/null | head -3
}

# run PROGRAM ARGS...: leaves $status, files stdout.txt and err.
run() {
  timeout -k 5 60 "$BIN/$1" "${@:2}" >stdout.txt 2>err </dev/null
  status=$?
}

# judge LABEL PROGRAM STATUS PATTERN: one line on stderr, from the program, with PATTERN; nothing left aside.
judge() {
  local label=$1 program=$2 wanted=$3 pattern=$4 lines left
  lines=$(wc -l <err)
  left=$(find . -name '*.sf-*' -print -quit)
  if [ "$status" -ne "$wanted" ]; then fail "$label" "exit status $status, expected $wanted"
  elif [ "$lines" -ne 1 ]; then fail "$label" "$lines lines on stderr, expected 1"
  elif ! grep -q "^$program: " err; then fail "$label" "the line does not name the program"
  elif ! grep -qF -e "$pattern" err; then fail "$label" "the line does not name '$pattern'"
  elif [ -n "$left" ]; then fail "$label" "left $left behind"; rm -f "$left"
  else passed=$((passed + 1)); return; fi
}

usage() { # PATTERN PROGRAM ARGS...
  run "${@:2}"
  judge "usage: ${*:2}" "$2" 2 "$1"
}

data() { # PATTERN PROGRAM ARGS...
  run "${@:2}"
  judge "data: ${*:2}" "$2" 1 "$1"
}

good() { # PROGRAM ARGS...; without progress, which a busy machine would show
  local quiet=()
  if "$BIN/$1" --help | grep -q -e --quiet; then quiet=(--quiet); fi
  run "$@" "${quiet[@]}"
  if [ "$status" -ne 0 ]; then fail "good: $*" "exit status $status"
  elif [ -s err ]; then fail "good: $*" "a good run wrote on stderr"
  else passed=$((passed + 1)); fi
}

absent() { # FILE LABEL
  if [ -e "$1" ]; then fail "$2" "left $1 behind"; rm -rf "$1"; else passed=$((passed + 1)); fi
}

# poke FILE OFFSET OCTAL: one byte.
poke() { printf "\\$3" | dd of="$1" bs=1 seek="$2" conv=notrunc status=none; }
size_of() { wc -c <"$1"; }

# ---- something good to spoil ----

good sf_scene simple -o d --size 16 --train 3 --test 2
good sf_scene simple -o simple --size 4 --train 1 --test 1
good sf_data d --png cameras.png
good sf_data d --json
usage "missing argument" sf_data
data "no such folder" sf_data absent
data "cannot write" sf_data d --png absent/cameras.png
good sf_train d -o model.safetensors --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1
# A pixel of these pictures: 2 * bound * 22.22 px of focal length / 3.22 of distance, at least the coarsest level.
while read -r finest options; do
  # shellcheck disable=SC2086
  run sf_train d -o box.safetensors --stage1 1 --stage2 1 --levels 2 --log2-hash 8 --threads 1 $options
  if grep -q "finest level $finest," stdout.txt; then passed=$((passed + 1)); else fail "sf_train $options" "finest level is not $finest"; fi
done <<'END'
14 --base-res 2
56 --base-res 2 --bound 4
16
77 --finest-res 77
END
good sf_train d -o tuned.safetensors --fine-tune model.safetensors --weight-bits 4 --stage2 2 --threads 1
good sf_export tuned.safetensors -o tuned.snn
if ! grep -q "4-bit weights" stdout.txt; then fail "tuned.safetensors" "is not exported with its own 4 bits"; fi
if grep -q "scales are not used" stdout.txt; then fail "tuned.safetensors" "a note about widths that are its own"; fi
sed 's/"h_shift":"3"/"h_shift":"4"/' tuned.safetensors >shifted.safetensors
data "h = current >> 4" sf_export shifted.safetensors -o out
good sf_export tuned.safetensors -o tuned.snn --grid-bits 7
if ! grep -q "scales are not used" stdout.txt; then fail "tuned.safetensors" "no note that its scales are not used"; fi
good sf_export model.safetensors -o s.snn
good sf_export model.safetensors -o fit.snn --fit --fit-loss 0 --data d --fit-rays 256 --json
good sf_cosim fit.snn d --rays 1 --seed 1
good sim_render s.snn d -o g.exr --png g.png --truth t.png
good sim_render s.snn d -o f.exr --backend float
good sim_render s.snn d -o train --all --split train
# Threads that the address space has no room for are not asked for.
(ulimit -v 4000000 && OMP_STACKSIZE=16m "$BIN/sim_render" s.snn d --threads 1024 -o t.exr -q >stdout.txt 2>err)
if cmp -s t.exr g.exr; then passed=$((passed + 1)); else fail "sim_render --threads 1024" "no picture"; fi
good sim_render s.snn d -o r.exr --backend rtl --crop 7,7,2,2 --view 1
good sim_render s.snn d -o x.exr --backend fixed --crop 7,7,2,2 --view 1
good energy_audit s.snn d --rays 20 --rtl-rays 1 --json --csv a.csv
good energy_audit --published
good energy_audit s.snn d --rays 20 --rtl-rays 1 --recount-rays 5 --steps 1 --tech 45nm
good sf_train d -o twin.safetensors --net ann --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1
good sf_convert twin.safetensors d --rays 5 --json
good sf_train d -o vm.safetensors --backbone tensorf --stage1 2 --stage2 2 --voxels 16 --rays 64 --samples 256 --threads 1
good sf_train d -o vm-tuned.safetensors --fine-tune vm.safetensors --weight-bits 4 --grid-bits 5 --leak-bits 6 --stage2 2 --samples 256 --threads 1
good sf_export vm-tuned.safetensors -o vm-tuned.snn
if ! grep -q "at 4-bit weights, 12-bit features, 6-bit leaks, 5-bit grid entries" stdout.txt; then fail "vm-tuned.safetensors" "is not exported with its own widths"; fi
if grep -q "scales are not used" stdout.txt; then fail "vm-tuned.safetensors" "a note about widths that are its own"; fi
good sf_export vm-tuned.safetensors -o vm-tuned.snn --grid-bits 8
if ! grep -q "fine-tuned for 4-bit weights, 12-bit features and 5-bit grid entries; those scales are not used" stdout.txt; then fail "vm-tuned.safetensors" "no note about widths that are not its own"; fi
good energy_audit s.snn d --rays 20 --rtl-rays 0 --twin twin.safetensors
good energy_audit s.snn d --rays 20 --rtl-rays 0 --recount-rays 0 --json
if grep -q '"core_equals_recount":.null' stdout.txt; then passed=$((passed + 1)); else fail "a recount of nothing" "is equal"; fi
good energy_audit --compare s.snn s.snn d --rays 20 --rtl-rays 0 --steps-b 1 --json
good error_budget model.safetensors s.snn d --samples 100 --rays 4 --json
good sf_cosim s.snn d --rays 1 --seed 1 -q
good sf_cycles s.snn d --view 1 --clock 100 --json
if cmp -s r.exr x.exr; then passed=$((passed + 1)); else fail "rtl = fixed" "r.exr and x.exr differ"; fi
for f in model.safetensors s.snn g.exr g.png t.png f.exr a.csv; do
  if [ -s $f ]; then passed=$((passed + 1)); else fail "good runs" "$f is missing"; fi
done
# Cameras that look past the box at the layout's scale and stand in it at the scale that the scene was trained at.
mkdir away && cp -r d/train d/test away
for split in train test; do
  echo '{"camera_angle_x": 0.7, "frames": [{"file_path": "./'$split'/r_0", "transform_matrix":
    [[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 2], [0, 0, 0, 1]]}]}' >away/transforms_$split.json
done
good sf_train away -o small.safetensors --scale 0.4 --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1
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
if grep -q '"weight_bits":.*4,' stdout.txt; then passed=$((passed + 1)); else fail "--fit" "not the weights that the model was tuned for"; fi
[ "$failed" -eq 0 ] || echo "note: good runs failed, the rest builds on them"

# ---- usage ----

# The shortest right command line of each program.
declare -A right=(
  [sf_scene]="simple -o out" [sf_train]="d -o out" [sf_export]="model.safetensors -o out"
  [sf_cosim]="s.snn d" [sim_render]="s.snn d -o out" [energy_audit]="s.snn d"
  [error_budget]="model.safetensors s.snn d" [sf_cycles]="s.snn d")
for p in sf_scene sf_train sf_export sf_cosim sim_render energy_audit error_budget; do
  usage --no-such-option $p ${right[$p]} --no-such-option
  usage --no-such-option $p ${right[$p]} --no-such-option=3
  usage -Z $p ${right[$p]} -Z
  usage --json $p ${right[$p]} --json=
  usage --seed $p ${right[$p]} --seed
  usage --seed $p ${right[$p]} --seed nan
  usage --seed $p ${right[$p]} --seed -1
  usage --seed $p ${right[$p]} --seed 99999999999999999999999
  usage --seed $p ${right[$p]} --seed 12abc
  usage --seed $p ${right[$p]} --seed=
  usage surplus $p ${right[$p]} surplus
  [ $p = error_budget ] || usage missing $p
  run $p --help
  if [ "$status" -eq 0 ] && [ -s stdout.txt ] && [ ! -s err ]; then passed=$((passed + 1)); else fail "$p --help" "status $status"; fi
done
number() { # PROGRAM OPTION BAD...
  for value in "${@:3}"; do usage "$2" "$1" ${right[$1]} "$2" "$value"; done
}
number sf_scene --size 0 -1 nan 1e400 99999999999 '' 3.5
number sf_scene --train 0 nan
number sf_scene --test -1 inf
number sf_train --beta -1 2 nan NaN inf -inf 1e999 x ''
number sf_train --steps 0 9 nan
number sf_train --stage1 -1 nan 3000000000
number sf_train --minutes -1 nan
for minutes in --minutes\ 0 -m0; do usage "--minutes 0 leaves no time to learn" sf_train d -o out $minutes; done
number sf_train --threads -1 nan
number sf_train --hidden 0 129
usage hidden sf_train d -o out --hidden 17
number sf_train --input-mode sometimes nan ''
number sf_train --net cnn
number sf_train --backbone nerf
number sf_train --voxels 8 2000 nan
number sf_train --rays 1 nan
usage --fine-tune sf_train d -o out --backbone tensorf --fine-tune model.safetensors
for option in --backbone\ tensorf --voxels\ 32 --hidden\ 32; do
  usage "has no effect beside --fine-tune" sf_train d -o out --fine-tune vm.safetensors $option
done
usage "--levels has no effect on --backbone tensorf" sf_train d -o out --fine-tune vm.safetensors --levels 4
for option in --net\ ann --levels\ 4 --steps=4 -T4 --bound\ 2 --stage1\ 3 --no-stage1 --no-distill --beta\ 1 --price\ energy --target-loss\ 1 --objective\ paper; do
  usage "has no effect beside --fine-tune" sf_train d -o out --fine-tune model.safetensors $option
done
for option in --stage1 --stage2; do usage "$option has no effect beside --minutes" sf_train d -o out -m 1 $option 4; done
usage "also --summary" sf_train d -o out --summary out.jsonl
for option in --rays --voxels; do usage "$option has no effect on --backbone ingp" sf_train d -o out $option 64; done
for option in --levels --finest-res --bound; do
  usage "$option has no effect on --backbone tensorf" sf_train d -o out --backbone tensorf $option 4
done
data "cannot open the log for writing: No such file" sf_train d -o out --log absent/x.jsonl
for options in "" "--backbone tensorf" "--scale 0.3"; do
  data "cannot resume: this is no checkpoint but a finished model" sf_train d -o model.safetensors --resume $options
done
number sf_train --fixed-steps -1 9 nan
number sf_train --target-loss -1 21 nan x
number sf_train --target-saving -1 101 nan x
number sf_train --search-rate 0 -1 101 nan x
usage --price sf_train d -o out --price euros
usage --objective sf_train d -o out --objective none
usage "beside a target" sf_train d -o out --target-loss 0.1 --beta 1e-6
usage "number of steps is fixed" sf_train d -o out --price energy --fixed-steps 2
usage "number of steps is fixed" sf_train d -o out --target-saving 50 --net ann
usage "--charge has no effect on --net ann" sf_train d -o out --net ann --charge 0.2
usage "exclude each other" sf_train d -o out --target-loss 0.1 --target-saving 50
number sf_train --psnr-prefixes -1 nan
number sf_train --weight-bits 1 9 nan
number sf_train --leak-bits 3 13 nan
number sf_train --grid-bits 1 9 nan
for width in weight leak grid; do usage "--$width-bits needs --fine-tune" sf_train d -o out --$width-bits 4; done
usage feature-bits sf_train d -o out --fine-tune model.safetensors --feature-bits 9
data scale sf_train d -o out --fine-tune model.safetensors --scale 0.3
usage --fixed-steps sf_train d -o out --net ann --fixed-steps 2
number sf_export --steps 0 9 -1 nan
number sf_export --fit-loss -1 nan inf 101 ''
number sf_export --fit-rays 0 255 -1 nan
number sf_export --fit-bytes 0 -1 nan x
usage --data sf_export model.safetensors -o out --fit
usage --data sf_export s.snn --vectors out
usage --data sf_export model.safetensors -o out --vectors kit
usage --fit sf_export s.snn --vectors out --data d --fit
number sf_export --samples 0 4097 nan
while read -r option value; do
  usage "$option needs" sf_export model.safetensors -o out $option $value
done <<'END'
--fit-loss 0.1
--fit-rays 256
--fit-bytes 4096
--data d
--samples 4
--rays 4
--view 0
END
while read -r option value; do
  usage "$option needs" sf_export s.snn --nir out $option $value
done <<'END'
--steps 1
--background white
--weight-bits 4
--feature-bits 9
--leak-bits 6
--grid-bits 4
--seed 2
--data d
END
usage "--view needs --traces" sf_export s.snn --vectors out --data d --view 0
usage "--samples needs --vectors" sf_export s.snn --traces out --data d --samples 4
absent out "options that nothing reads"
data nodir sf_export model.safetensors -o out --traces traces --data nodir
absent out "traces of nothing"
usage "--view 9 is out of range" sf_export model.safetensors -o out --traces traces --data d --view 9
absent out "traces of no view"
usage "--model needs --backend float" sim_render s.snn d -o out --model model.safetensors
usage "--model needs --backend float" sim_render s.snn d --verify none.json --model model.safetensors
usage "--seed needs --backend rtl" sim_render s.snn d -o out --seed 1
usage "--port needs --backend board" sim_render s.snn d -o out --port tty
usage "--timeout needs --backend board" sim_render s.snn d -o out --timeout 2
usage "--backend board needs --port" sim_render s.snn d -o out --backend board
usage "--backend board needs --port" sf_cosim s.snn d --backend board
usage "belong to --backend board" sf_cosim s.snn d --port tty
for option in --stalls\ 3 --jobs\ 2 --block\ 5 --checkpoint\ out --evidence\ out --plusarg=+fault=1 --saif\ out; do
  usage "has no effect beside --backend board" sf_cosim s.snn d --backend board --port tty $option
done
number sim_render --timeout 0 -1 nan
data "no board there" sim_render s.snn d -o out --backend board --port notty
absent out "a picture without a board"
data "no board there" sf_cosim s.snn d --backend board --port notty
number sf_cosim --rays -1 nan inf x
number sf_cosim --jobs -1 0 257 x
number sf_cosim --block 0 x
number sf_cycles --view -1 nan 2 99999999999
number sf_cycles --downscale -1 65 nan
number sf_cycles --clock 0 nan inf
number sim_render --view -1 nan 2 99999999999
number sim_render --backend gpu nan ''
number sim_render --downscale -1 65 nan
number sim_render --steps 0 9 nan
number sim_render --threads 0 nan
number sim_render --crop '' 1 1,2,3 1,2,3,4,5 0,0,0,1 0,0,1,0 0,0,17,1 16,0,1,1 -1,0,1,1 nan,0,1,1 0,0,1,1x 99999999999,0,1,1
number energy_audit --rays 0 -1 nan
number energy_audit --views 0 3 nan
number energy_audit --view -1 2 nan
number energy_audit --rtl-rays -1 nan
number energy_audit --stall -1 91 nan
number energy_audit --recount-rays -1 nan
number energy_audit --steps 0 9 nan
number energy_audit --steps-b 0 9 nan
number error_budget --rays 0 -1 nan
usage DATA error_budget model.safetensors s.snn
usage nosuch sf_scene nosuch -o out
usage -o sim_render s.snn d
usage "--png is for previews" sim_render s.snn d -o x.png
usage --truth sim_render s.snn d --all -o set --truth t.png
usage --output sf_export model.safetensors
usage "no ReLU twin" sf_convert model.safetensors d
usage --percentile sf_convert model.safetensors d --percentile 0
usage --views energy_audit s.snn d --view 0 --views 1
usage --compare energy_audit --compare s.snn
usage DATA energy_audit --compare s.snn s.snn
usage DATA energy_audit --compare a.json s.snn
usage --csv energy_audit --compare s.snn s.snn d --csv out
usage --tech-b energy_audit s.snn d --tech-b 45nm
usage --steps-b energy_audit s.snn d --steps-b 1
usage extra energy_audit s.snn d extra
usage "missing argument" energy_audit --steps 2
usage "--compare needs two arguments" energy_audit --compare s.snn --steps-b 1
usage "d has no effect: reports" energy_audit --compare a.json b.json d
usage "--tech has no effect: A is a report" energy_audit --compare a.json s.snn d --tech 45nm --tech-b 45nm
usage "--stall has no effect beside --rtl-rays 0" energy_audit s.snn d --rtl-rays 0 --stall 5
usage --model energy_audit s.snn d --model model.safetensors
for option in --tech-b\ nosuch --steps-b\ 1; do
  usage "${option% *} has no effect: B is a report" energy_audit --compare s.snn b.json d $option
done
for option in --rays\ 5 --steps\ 1 --tech\ nosuch --view\ 0 --split\ train; do
  usage "${option% *} has no effect: no scene is counted" energy_audit --compare a.json b.json $option
done
for option in --csv --html --twin; do
  usage "$option has no effect: no scene is counted" energy_audit --published $option out
done
for option in --json --junit\ out --rays\ 3 --plusarg=+fault=1 --checkpoint\ out; do
  usage "has no effect beside --replay" sf_cosim --replay evidence.json $option
done
for bad in "--junit out" "--checkpoint out" "--limit-samples 1" "--jobs 1" "--block 1" "--evidence out"; do
  # shellcheck disable=SC2086
  usage "${bad% *}" sf_cosim s.snn d --saif out $bad
done
usage --clock sf_cosim s.snn d --clock 100
usage --dut-top sf_cosim s.snn d --dut-top my_top
for length in 63 1942; do usage "at most 63 characters" sf_cosim s.snn d --plusarg "+$(printf "%${length}s" '' | tr ' ' x)"; done
usage SECONDS sf_summary d x
usage SECONDS sf_summary d nan
mkdir -p tiny
echo '{"psnr": 30, "ssim": null, "T": 8, "t_r": 2}' | tee tiny/{train,float}.json >tiny/fixed.json
echo '{"samples": 1, "differences": 0}' >tiny/cosim.json
echo '{"energy_spiking_fj": 1, "energy_ann_fj": 2, "energy_saving_percent": 50}' >tiny/audit.json
good sf_summary tiny 3
grep -q '^  time steps' stdout.txt && fail "sf_summary" "a search that was not"
sed -i 's/{/{"t_star": 2.5, "search": {"state": "balanced", "worth": 1.5e-5, "worth_error": 2e-6, "price": 1.4e-5}, /' tiny/train.json
good sf_summary tiny 3
grep -q 't\* = 2.50 (balanced): one more is worth 1.5e-05 +- 2e-06 of squared error and costs 1.4e-05$' stdout.txt ||
  fail "sf_summary" "no line about the search"
grep -q 'SSIM -$' stdout.txt || fail "sf_summary" "no '-' for an SSIM that there is not"
grep -Eq '"ssim_fixed":[[:space:]]*null' tiny/summary.json || fail "sf_summary" "no null in summary.json"
data "no folder SCENE/RUN" sf_report d
absent d/table.md "sf_report without a run"
absent out "usage errors"

script() { # PATTERN SCRIPT ARGS...
  "$TOOLS/$2.sh" "${@:3}" >stdout.txt 2>err
  status=$?
  if [ "$status" -eq 2 ] && [ "$(wc -l <err)" -eq 1 ] && grep -qF -e "$1" err; then passed=$((passed + 1))
  else fail "script: ${*:2}" "exit status $status, not 2 and '$1'"; fi
}
script usage: cosim_campaign
script usage: cosim_campaign --help
script "'abc' is not a whole number" cosim_campaign out s.snn d abc 1
script "'1e6' is not a whole number" cosim_campaign out s.snn d 1e6 1
script "SEEDS holds 3 twice" cosim_campaign out s.snn d 9 "3 1 03"
script usage: chain
script usage: chain --help
absent out "usage of scripts"

# ---- data ----

whole_readers() { # PATTERN DIR: every program that reads all views
  data "$1" sf_train "$2" -o out --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1
  data "$1" energy_audit s.snn "$2" --views 2 --rtl-rays 1
  data "$1" sf_export model.safetensors -o out --fit --fit-rays 256 -q --data "$2"
  data "$1" sf_cosim s.snn "$2" --rays 1
  absent out "bad data $2"
}
readers() { # PATTERN DIR: and those that read one after the other
  whole_readers "$1" "$2"
  data "$1" sim_render s.snn "$2" -o out
  data "$1" sim_render s.snn "$2" --all -o out
  data "$1" sf_cycles s.snn "$2"
  absent out "bad data $2"
}
spoil() { rm -rf bad; cp -r d bad; } # then change bad/
both() { # SED PROGRAM: on both JSON files
  sed -i "$1" bad/transforms_train.json bad/transforms_test.json
}
first_pictures() { for f in bad/train/r_0.png bad/test/r_0.png; do "$@" $f; done; }
cut_picture() { truncate -s $(($(size_of "$1") * 6 / 10)) "$1"; }
flip_picture() { poke "$1" $(($(size_of "$1") / 2)) 123; }
empty_picture() { : >"$1"; }

readers nodir nodir
spoil; rm bad/*.json; readers bad bad
spoil; rm bad/*/*.png; readers r_ bad
spoil; rm bad/train/r_[01].png bad/test/r_0.png; readers r_0 bad
spoil; first_pictures cut_picture; readers r_0 bad
spoil; first_pictures empty_picture; readers r_0 bad
spoil; first_pictures flip_picture; readers r_0 bad
spoil; for s in train test; do cp s.snn bad/$s/r_0.png; done; readers r_0 bad
sf_small() { run sf_scene simple -o small --size 8 --train 1 --test 1; }
sf_small
spoil; for s in train test; do cp small/$s/r_0.png bad/$s/r_1.png; done; whole_readers r_1 bad
spoil; for s in train test; do sed -i '3s/frames/fra\x01mes" "/' bad/transforms_$s.json; done; readers json:3: bad
spoil; for s in train test; do truncate -s 200 bad/transforms_$s.json; done; readers .json: bad
spoil; for s in train test; do : >bad/transforms_$s.json; done; readers .json: bad
spoil; for s in train test; do echo trailing >>bad/transforms_$s.json; done; readers .json: bad
spoil; for s in train test; do echo '[]' >bad/transforms_$s.json; done; readers .json bad
spoil; for s in train test; do echo '{"camera_angle_x":0.7,"frames":[]}' >bad/transforms_$s.json; done; readers .json bad
spoil; both 's/"frames"/"fromes"/'; readers .json bad
spoil; both '5,6s/\[\[-*[0-9.e-]*,/[[NaN,/'; readers .json: bad
spoil; both 's/\[\[-*[0-9.e-]*,/[[1e999,/'; readers .json bad
spoil; both 's/\[\[-*[0-9.e-]*,/[["1",/'; readers .json bad
spoil; both 's/, *\[0, 0, 0, 1\]//;s/\[\[[^]]*\],/[/'; readers .json bad
spoil; both 's/"transform_matrix"/"transform"/'; readers .json bad
spoil; both 's/"file_path"/"path"/'; readers .json bad
spoil; both 's/"camera_angle_x":.*,/"camera_angle_x": 0,/'; readers .json bad
spoil; both 's/"camera_angle_x":.*,/"camera_angle_x": -1e999,/'; readers .json bad
spoil; both '/camera_angle_x/d'; readers .json bad

# What is evaluated on is looked at before anything is learned.
spoil; rm bad/test/*.png
data test/r_0 sf_train bad -o out --stage1 100000000 --levels 2 --log2-hash 8 --threads 1
absent out.jsonl "bad test views"

# ---- models and scenes ----

models() { # PATTERN FILE
  data "$1" sf_export "$2" -o out
  data "$1" sim_render s.snn d --backend float --model "$2" -o out
  absent out "bad model $2"
}
scenes() { # PATTERN FILE
  data "$1" sim_render "$2" d -o out
  data "$1" energy_audit "$2" d --rays 1 --rtl-rays 1
  data "$1" sf_cosim "$2" d --rays 1
  data "$1" sf_cycles "$2" d
  absent out "bad scene $2"
}
each_file() { # FUNCTION GOOD
  $1 none.file none.file
  $1 d d
  for n in 0 1 7 8 9 100 $(($(size_of "$2") / 2)) $(($(size_of "$2") - 1)); do
    head -c "$n" "$2" >cut.file; $1 cut.file cut.file
  done
  { cat "$2"; echo; } >long.file; $1 long.file long.file
  cp "$2" edited.file; poke edited.file 0 377; $1 edited.file edited.file    # header length
  cp "$2" edited.file; poke edited.file 7 177; $1 edited.file edited.file    # header length beyond any file
  cp "$2" edited.file; poke edited.file 8 170; $1 edited.file edited.file    # not JSON
  cp "$2" edited.file; poke edited.file 40 0; $1 edited.file edited.file     # a NUL in the header
  sed 's/"version":"1"/"version":"9"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"t_r":"[0-9]"/"t_r":"9"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"t_r":"[0-9]"/"t_r":"0"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"format":"spikefield/"format":"spokefield/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"dtype":"U8"/"dtype":"I8"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"colour.w4"/"colour.w9"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"shape":\[512,2\]/"shape":[256,4]/' "$2" >edited.file; $1 edited.file edited.file
  printf 'PK\003\004 something else entirely' >other.file; $1 other.file other.file
}
data model.safetensors sf_export model.safetensors --vectors out --data d
data nodir sf_export s.snn --vectors out --data nodir
absent out "vectors of nothing"
each_file models model.safetensors
each_file scenes s.snn

# Floats that are not numbers: -NaN in the first weight of the file.
header=$(od -An -tu8 -N8 model.safetensors | tr -d ' ')
cp model.safetensors nan.file
for i in 0 1 2 3; do poke nan.file $((8 + header + i)) 377; done
models nan.file nan.file
# One weight of C3 becomes 1000: too large for narrower widths, which --fit then leaves out.
cp model.safetensors large.safetensors
at=$(head -c $((8 + header)) model.safetensors | sed -n 's/.*"colour.w5":{[^}]*"data_offsets":\[\([0-9]*\).*/\1/p')
for i in 2 3; do poke large.safetensors $((8 + header + at + i)) $((i == 2 ? 172 : 104)); done
for i in 0 1; do poke large.safetensors $((8 + header + at + i)) 0; done
good sf_export large.safetensors -o large.snn
good sf_export large.safetensors -o large.snn --fit --data d --fit-rays 256 --json
if grep -q "clipped_weights" stdout.txt; then fail "--fit" "figures of the layers before they were cut down"; fi
# A scene's checksum covers every byte behind its header; the weights of a model may be anything finite.
header=$(od -An -tu8 -N8 s.snn | tr -d ' ')
for part in 1 3 5 7 9; do
  cp s.snn edited.file
  at=$((8 + header + ($(size_of s.snn) - 8 - header) * part / 10))
  poke edited.file $at "$(if [ "$(od -An -tu1 -j$at -N1 edited.file | tr -d ' ')" = 1 ]; then echo 2; else echo 1; fi)"
  scenes edited.file edited.file
done
sed 's/"D1.theta":"[0-9]/"D1.theta":"-/' s.snn >edited.file; scenes edited.file edited.file
sed 's/"max_samples":"1024"/"max_samples":"1023"/' s.snn >edited.file; scenes edited.file edited.file
scenes model.safetensors model.safetensors
models s.snn s.snn
usage --steps sim_render s.snn d --steps 9 -o out

# One wrong byte anywhere in a scene's header is refused; in a model's it may be another good number, but never a crash.
header=$(od -An -tu8 -N8 s.snn | tr -d ' ')
for at in $(seq 8 $((header / 30)) $((header + 7))); do
  cp s.snn edited.file
  poke edited.file $at "$(if [ "$(od -An -tc -j$at -N1 edited.file | tr -d ' ')" = 9 ]; then echo 70; else echo 71; fi)"
  data edited.file sim_render edited.file d -o out
done
header=$(od -An -tu8 -N8 model.safetensors | tr -d ' ')
for at in $(seq 9 $((header / 30)) $((header + 7))); do
  cp model.safetensors edited.file
  poke edited.file $at 71
  run sf_export edited.file -o out
  if [ "$status" -eq 0 ]; then passed=$((passed + 1)); rm -f out
  else judge "model with byte $at edited" sf_export 1 edited.file; absent out "model with byte $at edited"; fi
done

# ---- outputs that cannot be written ----

: >plain
train=(d --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1 -q)
writers() { # PATTERN PATH
  data "$1" sf_export model.safetensors -o "$2"
  data "$1" sim_render s.snn d -o "$2"
  data "$1" sim_render s.snn d -o out --png "$2"
  data "$1" sim_render s.snn d -o "$2" --backend float
  data "$1" energy_audit s.snn d --rays 1 --rtl-rays 0 --csv "$2"
  data "$1" sf_train "${train[@]}" -o "$2"
  absent out "unwritable $2"
}
data nosuch energy_audit s.snn d --rays 1 --rtl-rays 0 --tech nosuch
data nosuch energy_audit s.snn d --rays 1000000000 --twin nosuch
data nosuch energy_audit s.snn d --rays 1000000000 --html out --model nosuch
data nosuch energy_audit --compare s.snn s.snn d --rays 1000000000 --tech-b nosuch
(mkdir -p here/model.safetensors && cd here && timeout 60 "$BIN/sf_train" --help) >stdout.txt 2>err
if [ -s stdout.txt ] && [ ! -s err ]; then passed=$((passed + 1)); else fail "sf_train --help" "looks at outputs"; fi
data model.safetensors energy_audit s.snn d --rays 1 --rtl-rays 0 --twin model.safetensors
data nosuch.json energy_audit --compare nosuch.json nosuch.json
printf '{"views": 1}' >none.json
data none.json energy_audit --compare none.json none.json
timeout -k 5 60 "$BIN/sf_train" --help >/dev/full 2>err
status=$?
judge "--help, full disk" sf_train 1 "standard output"
usage --output sf_export model.safetensors -o model.safetensors
usage --nir sf_export s.snn --nir ./s.snn
usage --output sim_render s.snn d -o s.snn
usage --png sim_render s.snn d -o same.out --png same.out
usage --saif sf_cosim s.snn d --saif s.snn
usage --html energy_audit s.snn d --csv same.out --html same.out
usage --output sf_train d -o model.safetensors --fine-tune model.safetensors
data nodir/x sf_cosim s.snn d --junit nodir/x
data nodir/x sf_cosim s.snn d --evidence nodir/x
data nodir/x sf_train "${train[@]}" -o out --summary nodir/x
absent out "unwritable summary"
writers nodir/ nodir/x.out
writers plain plain/x.out
writers /proc /proc/spikefield.out
writers /dev/full /dev/full
mkdir -p folder.out
writers folder.out folder.out
data plain sf_export s.snn --vectors plain/kit --data d
data plain sf_scene simple -o plain --size 4 --train 1 --test 1
data plain sf_scene simple -o plain/deep/er --size 4 --train 1 --test 1
data /proc sf_scene simple -o /proc/spikefield --size 4 --train 1 --test 1
if [ "$(id -u)" -ne 0 ]; then
  mkdir locked && chmod 500 locked
  writers locked locked/x.out
  data locked sf_scene simple -o locked/x --size 4 --train 1 --test 1
fi

# A full disk: files of at most 1 KiB. An output that was there before stays as it was.
full() { # OUTPUT PROGRAM ARGS...
  rm -rf "$1"
  echo old >"$1"
  (ulimit -f 1; exec timeout -k 5 60 "$BIN/$2" "${@:3}" >stdout.txt 2>err </dev/null)
  status=$?
  judge "full disk: ${*:2}" "$2" 1 "$1"
  if [ "$(cat "$1")" = old ]; then passed=$((passed + 1)); else fail "full disk: ${*:2}" "$1 was changed"; fi
  rm -f "$1"
}
full full.out sf_export model.safetensors -o full.out
full full.out sim_render s.snn d -o full.out
full full.out sim_render s.snn d -o full.out --backend float
full full.out energy_audit s.snn d --rays 20 --rtl-rays 0 --json --csv full.out
# What was counted, compared or learned is told, though its file could not be written.
told() { # TEXT PROGRAM ARGS...
  { (ulimit -f 0; exec timeout -k 5 60 "$BIN/$2" "${@:3}" 2>/dev/null </dev/null); echo "status $?"; } | cat >stdout.txt
  if grep -qF -e "$1" stdout.txt && grep -qx "status 1" stdout.txt; then passed=$((passed + 1))
  else fail "full disk: ${*:2}" "nothing is reported, or no failure"; fi
}
told '"samples":' energy_audit s.snn d --rays 20 --rtl-rays 0 --json --csv full.out
told '"samples":' sf_cosim s.snn d --rays 3 --json --junit full.out
full full.out sf_train "${train[@]}" -o full.out --log log.out
# Checkpoints along the way may fail, the model may not: 3 of 4 iterations are followed by one.
(ulimit -f 1; exec timeout -k 5 60 "$BIN/sf_train" "${train[@]}" -o full.out --log log.out --checkpoint-minutes 0 >stdout.txt 2>err </dev/null)
status=$?
if [ "$(grep -c 'warning: cannot write full.out.*the run goes on' err)" -eq 1 ]; then passed=$((passed + 1)); else fail "full disk" "not told once"; fi
sed -i '/warning/d' err
judge "full disk: checkpoints" sf_train 1 full.out
(ulimit -f 1; exec timeout -k 5 60 "$BIN/sf_scene" simple -o fullscene --size 64 --train 1 --test 1 >stdout.txt 2>err </dev/null)
status=$?
judge "full disk: sf_scene" sf_scene 1 fullscene
absent fullscene/transforms_test.json "full disk: sf_scene"
for p in sf_export sim_render energy_audit sf_cosim sf_cycles; do
  rm -rf out
  case $p in sf_cosim) more="--rays 1 --json" ;; energy_audit) more="--rays 1 --rtl-rays 1 --json" ;; *) more=--json ;; esac
  timeout -k 5 60 "$BIN/$p" ${right[$p]} $more >/dev/full 2>err </dev/null
  status=$?
  judge "standard output on a full disk: $p" $p 1 output
done
rm -rf out

# ---- interruption ----

run sf_scene simple -o wide --size 128 --train 3 --test 1 # the cameras of d
stop() { # OUTPUT PROGRAM ARGS...
  timeout --foreground -k 20 --preserve-status -s INT 1 "$BIN/$2" "${@:3}" >stdout.txt 2>err </dev/null
  status=$?
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
  if iconv -f UTF-8 -t UTF-8 stdout.txt >/dev/null; then passed=$((passed + 1)); else fail "$line" "no UTF-8"; fi
done <<'END'
sf_data bytes --json
sim_render s.snn bytes --all -o bytes_all --json -q
sim_render s.snn bytes --verify bytes_all/manifest.json --json -q
energy_audit s.snn bytes --rays 20 --rtl-rays 1 --json -q
END

# Interrupted while it loads, a training leaves what is there.
cp model.safetensors before.safetensors
cp model.safetensors early.safetensors
timeout --foreground -k 20 --preserve-status -s INT 0.02 "$BIN/sf_train" views -o early.safetensors >stdout.txt 2>err </dev/null
status=$?
judge "interrupted at once: sf_train" sf_train 130 ""
if cmp -s before.safetensors early.safetensors; then passed=$((passed + 1)); else fail "interrupted at once" "model lost"; fi

# The evaluation after a training can be interrupted, too: its checkpoint is resumed to the evaluation alone.
brief=(views -o stop.safetensors --stage1 1 --stage2 1 --levels 2 --log2-hash 8)
timeout --foreground -k 20 --preserve-status -s INT 2 "$BIN/sf_train" "${brief[@]}" --psnr-prefixes 30 >stdout.txt 2>err </dev/null
status=$?
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
if grep -q '"iterations":2,.*"views":1' stdout.txt; then passed=$((passed + 1)); else fail "resumed evaluation" "no summary"; fi
run sf_train "${brief[@]}" --resume --quiet
judge "finished: sf_train --resume" sf_train 1 "cannot resume"

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
