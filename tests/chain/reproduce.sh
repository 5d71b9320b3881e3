#!/bin/bash
# make reproduce on a tiny scene of its own: all runs; interrupted in the middle and continued equals uninterrupted; a
# run that fails; what is run again and what is not.   usage: reproduce.sh BUILD
. "$(dirname "$0")/../tool_run.bash" reproduce "$@"
# trainer LINE: a stand-in in build `part` that runs LINE, notes its arguments and goes on as sf_train.
trainer() {
  rm "$work/part/bin/sf_train"
  printf '%s\n' '#!/bin/bash' "$1" "echo \"\$*\" >>'$work/calls'" "exec '$programs/sf_train' \"\$@\"" >"$work/part/bin/sf_train"
  chmod +x "$work/part/bin/sf_train"
}
reproduce() { run_tool "$@"; }
runs() { echo "$work/$1/reproduce/smoke/textured"; }
times() { (cd "$(runs "$1")" && stat -c '%n %y' ./*/train.json ./*/fixed-0.json 2>/dev/null | sort); }
# What a run found, less its times.
facts() { grep -v '"seconds"\|"samples_per_second"' "$work/$1/reproduce/smoke/results.json"; }

build whole
reproduce whole 0
# 14 of the paper's, one along rays, and every number of steps that the ablations do not train alone.
same=$(count '^\[.* sweep-[1-8] *is \(mode-hybrid\|fixed-t\)')
all=$((14 + 1 + 8 - same))
[ "$same" -ge 3 ] && [ "$(count '^\[.* dB, ')" -eq $all ] || fail "not $all runs"
[ -s "$work/whole/reproduce/smoke/table.md" ] || fail "no table.md"
grep -q 'Problems\|without a result' "$work/whole/reproduce/smoke/table.md" && fail "a run is missing or broken"
page=$work/whole/reproduce/smoke/report.html
python3 -c 'import sys, xml.etree.ElementTree as xml; xml.parse(sys.argv[1])' "$page" || fail "the page is no XML"
[ "$(grep -c '<div class="plate"><img ' "$page")" -eq 14 ] || fail "not truth, twin and three budgets, each with a part, four with errors"
compared=$work/whole/reproduce/smoke/tables/comparators.csv
row() { grep -Eq "^textured,$1,[0-9.]+,[0-9.]+,-?[0-9.]+,[0-9.e-]+,-?[0-9.]+,-?[0-9.]+,$2" "$compared" || { cat "$compared"; fail "comparators: no row $1"; }; }
row '"?PATA, beta = 5e-7 \(full\)"?,[1-8]' 'textured; seed 1'
for t in 4 16 256; do row "\"?twin converted, no training\"?,$t" 'seed 1; 20 random rays'; done
row 'samples of a ray as steps,1 a sample' 'textured; seed 1; 1 view'
for t in 1 2 3 4 5 6 7 8; do row "\"?fixed T, trained alone[^\"]*\"?,$t" 'textured; seed 1'; done
[ "$(grep -c 'best PSNR' "$compared")" -eq 1 ] || fail "comparators: not one best number of steps"
if command -v gnuplot >/dev/null; then
  [ "$(grep -c 'data:image/svg+xml;base64,' "$page")" -eq 8 ] || fail "the page has not 8 plots"
  for plot in psnr-t_r psnr-steps psnr-energy psnr-steps-textured psnr-energy-textured t-star-textured firing-textured; do
    grep -q '</svg>' "$work/whole/reproduce/smoke/plots/$plot.svg" || fail "$plot.svg is not whole"
  done
else
  [ "$(count 'gnuplot-nox')" -eq 1 ] || fail "the missing gnuplot is not named"
fi
echo "whole: $all runs"

# Three processes at once, as a launcher starts them; one is killed: the others take its run, each run is done once, and the
# last one makes the same table.
build dealt
pids=()
for rank in 0 1 2; do
  OMPI_COMM_WORLD_SIZE=3 OMPI_COMM_WORLD_RANK=$rank "$script" "$work/dealt" --profile smoke >"$work/out.$rank" 2>&1 &
  pids+=($!)
done
for ((i = 0; i < 4000; i++)); do
  grep -q ' dB, ' "$work/out.1" && break
  sleep 0.01
done
# shellcheck disable=SC2046
kill -KILL "${pids[1]}" $(pgrep -P "${pids[1]}")
wait "${pids[0]}" || { cat "$work/out.0"; fail "dealt: exit status of process 0"; }
wait "${pids[2]}" || { cat "$work/out.2"; fail "dealt: exit status of process 2"; }
cat "$work"/out.[012] >"$work/out"
[ "$(count '^\[.* dB, ')" -eq $all ] || fail "dealt: not $all runs, each once"
[ "$(grep -l '^wrote ' "$work"/out.[012] | wc -l)" -ge 1 ] || fail "dealt: no table"
for rank in 0 1; do [ "$(grep -c ' dB, ' "$work/out.$rank")" -ge 1 ] || fail "dealt: process $rank had no run"; done
diff <(facts whole) <(facts dealt) >"$work/difference" || { cat "$work/difference"; fail "dealt: results.json differs"; }
for file in table.md tables; do
  diff -r "$work/whole/reproduce/smoke/$file" "$work/dealt/reproduce/smoke/$file" || fail "dealt: $file differs"
done
rm -r "$work/dealt"
echo "dealt: three processes, one killed: the same table"

# Stopped in the middle of a training; SIGTERM once, SIGKILL of script and trainer once.
interrupt() { # SIGNAL RUN
  local signal=$1 log children
  log=$(runs part)/$2/train.jsonl
  setsid "$script" "$work/part" --profile smoke >"$work/out" 2>&1 &
  pid=$!
  for ((i = 0; i < 4000; i++)); do
    [ -s "$log" ] && break
    kill -0 "$pid" 2>/dev/null || fail "over before $2 began"
    sleep 0.005
  done
  children=
  [ "$signal" = TERM ] || children=$(pgrep -P "$pid")
  # shellcheck disable=SC2086
  kill "-$signal" "$pid" $children
  wait "$pid" 2>/dev/null
  status=$?
  flock -w 20 "$work/part/reproduce/smoke/lock" true || fail "something is still at work"
  pid=
  [ ! -e "$(runs part)/fixed-t/train.json" ] || fail "nothing was left to do"
}
build part
trainer :
for run in mode-hybrid mode-decay mode-no-decay; do # until the signal meets a training
  interrupt TERM $run
  [ $status -eq 130 ] || fail "SIGTERM: exit status $status, expected 130"
  [ "$(count 'nothing is lost')" -eq 1 ] || fail "no word about going on"
  [ ! -e "$(runs part)/$run/train.json" ] && break
done
[ -s "$(runs part)/$run/model.safetensors" ] || fail "no checkpoint of $run"
[ ! -e "$(runs part)/$run/train.json" ] || fail "no training was met"
grep -q -- --resume "$work/calls" && fail "--resume without a checkpoint"
times part >"$work/before"
[ -s "$work/before" ] || fail "no run was finished before the interrupt"
interrupt KILL no-stage1
reproduce part 0
[ "$(grep -c -- --resume "$work/calls")" -eq 1 ] || fail "not one training was resumed"
[ "$(count 'finished before')" -ge 4 ] || fail "finished runs were repeated"
times part >"$work/after"
[ -z "$(comm -23 "$work/before" "$work/after")" ] || fail "results of finished runs were written again"
for model in "$(runs whole)"/*/model.safetensors; do
  run=${model%/*}
  cmp "$model" "$(runs part)/${run##*/}/model.safetensors" || fail "${run##*/}: interrupted and continued differs"
done
diff <(facts whole) <(facts part) >"$work/difference" || { cat "$work/difference"; fail "results.json differs"; }
echo "interrupted: the same $all models and results"

# A run that fails: the rest goes on, the report shows it, the next call repeats it alone. Its parameters were changed.
echo "sf_train DATA --seed 2" >"$(runs part)/no-extra/train.cmd"
# shellcheck disable=SC2016
trainer 'case " $* " in *" --no-extra "*) echo "sf_train: planted failure" >&2; exit 1 ;; esac'
reproduce part 1
[ "$(count 'finished before')" -eq $((all - 1)) ] || fail "changed parameters of one run: not $((all - 1)) others kept"
[ "$(count 'no-extra .*FAILED (1): sf_train: planted failure')" -eq 1 ] || fail "the failure is not reported"
grep -q '^- textured, no-extra: failed: sf_train: planted failure$' "$work/part/reproduce/smoke/table.md" || fail "not in the table"
grep -Eq '^\| without L_extra +\| +- ' "$work/part/reproduce/smoke/table.md" || fail "a failed run has figures"
reproduce part 0 --report
ln -sf "$programs/sf_train" "$work/part/bin/sf_train"
reproduce part 0
[ "$(count 'finished before')" -eq $((all - 1)) ] || fail "the failed run was not repeated alone"
diff <(facts whole) <(facts part) >/dev/null || fail "results.json differs after the failure"
echo "failure: reported, repeated alone"

# Other frames: audited again, not trained again.
times part | grep train.json >"$work/before"
energy() { sed -nE 's/.*"energy_spiking_fj":[[:space:]]*([0-9.e+]+).*/\1/p' "$(runs part)/beta-5e-7/prefix-$1-0.json" | head -n 1; }
three=$(energy 3)
[ "$three" != "$(energy 2)" ] || fail "two and three steps cost the same"
echo stopped >"$(runs part)/beta-5e-7/prefix-3.part"
reproduce part 0 --audit-views 2
[ "$(energy 3)" = "$three" ] || fail "an export of other steps was audited"
[ "$(count 'finished before')" -eq 0 ] || fail "new frames were not audited"
times part | grep train.json | cmp - "$work/before" || fail "trained again for other frames"
[ -s "$(runs part)/fixed-t/audit-1.json" ] || fail "the second frame was not audited"
flock -s "$work/part/reproduce/smoke/lock" "$script" "$work/part" --profile smoke >"$work/out" 2>&1 && fail "two at once"
[ "$(count 'another run of profile smoke, with other parameters,')" -eq 1 ] || fail "the other run is not named"

# Profile scenes: both backbones of a scene in the Blender layout, by the clock; twin, audit, co-simulation.
data=$work/part/reproduce/smoke-data/textured
"$script" "$work/part" --profile scenes --scenes "$data" --minutes 0.03 --audit-downscale 2 --cosim-rays 4 --rtl-rays 0 \
  --train '--hidden 32 --samples 512' >"$work/out" 2>&1 || fail "profile scenes: exit status $?"
[ "$(count '^\[.* dB, ')" -eq 4 ] || fail "profile scenes: not 4 runs"
table=$work/part/reproduce/scenes/table.md
for row in textured-ingp textured-tensorf; do
  grep -Eq "^\| $row +\| ${row#*-} +\| +(5e-07|2e-06) \| +0 \| +[0-9.]+ \| +[0-9.]+ \|.* [0-9]+ \| +0 \|$" "$table" || { cat "$table"; fail "no row of $row"; }
done
grep -q 'Problems\|without a result' "$table" && fail "profile scenes: a run is missing or broken"
echo "scenes: two backbones"

# Profile paper at a tiny length: the planes with two of their budgets, a second seed of the learned runs; a probe that is kept.
paper() {
  "$script" "$work/part" --profile paper --scenes "$data" --backbones tensorf --betas '5e-7 5e-8' --seeds "$1" --stage1 4 --stage2 12 \
    --probe 32 --samples 512 --audit-views 1 --prefix-views 1 --eval-views 1 --rtl-rays 0 --convert-rays 20 --steps 2 --train '--hidden 32 --voxels 24' "${@:2}" >"$work/out" 2>&1 ||
    fail "profile paper: exit status $?"
}
out=$work/part/reproduce/paper
paper 1
[ "$(count '^\[.* dB, ')" -eq 3 ] || fail "profile paper: not 3 runs"
[ "$(count '^textured-tensorf: .* s an iteration, as a probe of 32 says')" -eq 1 ] || fail "profile paper: no estimate"
[ "$(count '^reproduce: 3 runs, about ')" -eq 1 ] || fail "profile paper: no estimate of all"
cp "$out/textured-tensorf/probe.jsonl" "$work/before"
paper '1 2'
[ "$(count 'finished before')" -eq 3 ] || fail "profile paper: the first seed was repeated"
[ "$(count '^\[.*textured-tensorf/seed-2 .* dB, ')" -eq 3 ] || fail "profile paper: no second seed"
cmp -s "$out/textured-tensorf/probe.jsonl" "$work/before" || fail "profile paper: probed again"
for seed in 1 2; do
  run=$out/textured-tensorf
  [ $seed -eq 1 ] || run=$run/seed-2
  grep -Eq "\"seed\":[[:space:]]*$seed,$" "$run/ann/train.json" || fail "profile paper: another seed than $seed"
  [ -s "$run/ann/frame-0.png" ] && [ -s "$run/beta-5e-8/truth-0.png" ] || fail "profile paper: no pictures"
done
cmp -s "$out/textured-tensorf/ann/model.safetensors" "$run/ann/model.safetensors" && fail "profile paper: two seeds are one"
grep -Eq '^\| beta = 5e-8 +\| +[0-9.]+ \+- [0-9.]+ \| 33.04 \|.* seeds 1 2; 1 view of 32 x 32; 1 audited frame of 32 x 32 \|$' "$out/table.md" ||
  { cat "$out/table.md"; fail "profile paper: no row of beta = 5e-8"; }
grep -q '^TensoRF,33.14,0.963,-,as printed' "$out/tables/models-ordinary-blender.csv" || fail "profile paper: no ordinary models"
echo "paper: two seeds"

# While the run that the twin's energy needs is at work elsewhere, the twin is trained. It is counted afterwards.
run=$out/textured-tensorf/seed-3
mkdir -p "$run"
timeout 60 flock "$run/.beta-5e-7.lock" sh -c "until [ -s '$run/ann/train.json' ]; do sleep 0.05; done" &
paper 3
wait $! || fail "profile paper: the twin was not trained ahead"
[ "$(count '^\[.* ann  *trained; counted when the spiking run is done,')" -eq 1 ] || fail "profile paper: not said that the twin was trained"
[ "$run/ann/train.json" -ot "$run/beta-5e-7/train.json" ] && [ -s "$run/ann/float-0.json" ] || fail "profile paper: the twin was trained again, or not counted"
[ "$(count '^\[.* dB, ')" -eq 3 ] && [ "$(cat "$run/ann/status")" = "done" ] || fail "profile paper: not 3 runs of seed 3"
echo "paper: the twin ahead"

# The twin, one budget and what they are held against, with the planes: nothing else.
paper 1 --runs comparators
[ "$(count '^\[.* dB, ')" -eq 3 ] && [ "$(count 'finished before')" -eq 2 ] || fail "comparators: not 3 runs more"
grep -Eq '^textured-tensorf,samples of a ray as steps,1 a sample,' "$out/tables/comparators.csv" || fail "comparators: no planes along rays"
grep -Eq '^textured-tensorf,.*twin converted, no training.*,256,' "$out/tables/comparators.csv" || fail "comparators: no converted planes"
echo "comparators: planes"

# Runs that fail before they say of what kind the scene is: a scene without any other run.
cp -r "$data" "$work/failing"
"$script" "$work/part" --profile paper --scenes "$work/failing" --backbones tensorf --betas 5e-7 --probe 0 --train '--nosuch' --audit-downscale 64 >"$work/out" 2>&1 &&
  fail "runs with a wrong option: success"
[ "$(count '^reproduce: failing will fail with --audit-downscale 64: ')" -eq 1 ] || { cat "$work/out"; fail "not said before the runs"; }
[ "$(count 'failing-tensorf .*FAILED (2): ')" -ge 2 ] || { cat "$work/out"; fail "a wrong option: not both runs failed"; }
[ "$(count '^## Averages over the scenes')" -eq 1 ] && [ "$(count '^## Averages over the scenes: TensoRF, Synthetic')" -eq 1 ] ||
  fail "failed runs are of another kind: $(grep '^## Averages' "$work/out")"
echo "failed: of the scene's kind"

for bad in "--profile fast" "--stage1 x" "--audit-views 0" "--steps 9" "--nosuch 1" "--stage1" "--prefix-runs some" "--minutes 3" \
  "--profile scenes --betas 2" "--betas 5e-7" "--probe 3" "--seeds x" "--seeds 0" "--seed-runs some" "--runs some" "--profile scenes --runs paper" "--profile scenes --stage1 3" "--profile scenes --minutes 0" "--profile scenes --backbones x"; do
  # shellcheck disable=SC2086
  reproduce part 2 $bad
  [ "$(wc -l <"$work/out")" -eq 1 ] || fail "$bad: not one line"
done
"$script" "$work/part" --scenes "$work/nowhere" >"$work/out" 2>&1 && fail "scenes from nowhere"
[ "$(count nowhere)" -eq 1 ] || fail "the missing folder is not named"
mkdir -p "$work"/scenes/{a,b/a,.c}
touch "$work"/scenes/{a,b/a,.c}/transforms_train.json
only() { "$script" "$work/part" --scenes "$work/scenes" --only "$1" >"$work/out" 2>&1; }
only 'a/' && fail "an empty scene was trained"
[ -d "$work/part/reproduce/quick/a/ann" ] || fail "a/: not in a folder of its name"
for bad in "a b/a//" ".c" "a/."; do
  only "$bad"
  got="$? $(wc -l <"$work/out")"
  [ "$got" = "1 1" ] || fail "--only '$bad': exit status and lines are $got"
done
echo "parameters: ok"
