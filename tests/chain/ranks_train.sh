#!/bin/bash
# sf_train as ranks of mpirun: whatever their number, the model is that of one process, also when a rank is killed or all
# are interrupted and another number goes on. Ranks that are not alike are refused.   usage: ranks_train.sh BUILD
. "$(dirname "$0")/../ranks_run.bash" "$@"

# ---- sf_train: model and log, both fields, the twin, a charge; with other numbers of threads, too ----
"$bin/sf_scene" textured -o photos --size 16 --train 6 --test 3 >/dev/null
small="--samples 768 --occ-res 16 --hidden 16 --stage1 6 --stage2 28 --seed 3 --psnr-prefixes 1 --eval-views 2 --no-scaling"
grid="--levels 6 --log2-hash 9"
train() { # NAME RANKS ARGS...: 0 ranks for no launcher
  local launch=()
  [ "$2" -eq 0 ] || launch=(job "$2")
  "${launch[@]}" "$bin/sf_train" photos $small -q --json -o "$1.model" "${@:3}" >"$1.json" 2>"$1.err"
}
timeless() { sed -E 's/"(seconds|samples_per_second|model|ranks|sent_bytes)":[^,]*,//g' "$1"; }
alike() { # NAME REFERENCE TEXT
  cmp -s "$1.model" "$2.model" || fail "$3: the model differs"
  cmp -s <(timeless "$1.model.jsonl") <(timeless "$2.model.jsonl") || fail "$3: the log differs"
  cmp -s <(timeless "$1.json") <(timeless "$2.json") || fail "$3: the report differs"
}
for net in "grid 0 $grid" "grid 2 $grid" "grid 3 $grid --threads 2" "grid 8 $grid" "twin 0 $grid --net ann" "twin 4 $grid --net ann" \
  "charge 0 $grid --fixed-steps 3 --charge 1" "charge 3 $grid --fixed-steps 3 --charge 1" \
  "planes 0 --backbone tensorf --voxels 20" "planes 2 --backbone tensorf --voxels 20" "planes 3 --backbone tensorf --voxels 20"; do
  read -r name ranks args <<<"$net"
  train $name$ranks $ranks $args || fail "sf_train, $ranks ranks, $args: $(cat $name$ranks.err)"
  alike $name$ranks ${name}0 "$ranks ranks, $args"
done
grep -q '"measured":[1-9]' grid0.json || fail "no iteration ran all steps"
grep -q '"sent_bytes":[1-9]' grid2.json || fail "two ranks did not speak to each other"

# ---- sf_train: killed, interrupted; --resume with another number of ranks ----
small=${small/--stage2 28/--stage2 250} # long enough to be met at work
train long 0 $grid || fail "sf_train, a longer run: $(cat long.err)"
begin() { # ARGS...: a job that is at work
  rm -f cut.model*
  mpirun --oversubscribe -n 3 "$bin/sf_train" photos "$@" $grid -q --json -o cut.model --checkpoint-minutes 0 >cut.json 2>cut.err &
  parent=$!
  await cut.model
  for _ in $(seq 600); do [ -s cut.model.jsonl ] && break; sleep 0.05; done
}
for how in "-KILL 1 2" "-KILL 0 0" "-KILL 2 3"; do
  read -r signal victim others <<<"$how"
  unset OMPI_MCA_odls_base_sigkill_timeout
  begin $small
  pid=$(pid_of "$victim" $parent) begun=$(date +%s)
  kill "$signal" "$pid"
  wait $parent && fail "sf_train, $how: success"
  [ $(($(date +%s) - begun)) -le 10 ] || fail "sf_train, $how: the job ended after $(($(date +%s) - begun)) s"
  grep -q "process rank $victim .* exited on signal 9" cut.err || fail "sf_train, $how: no line names the rank: $(cat cut.err)"
  train cut "$others" --resume || fail "sf_train, $how: going on: $(cat cut.err)"
  cmp -s cut.model long.model || fail "sf_train, $how: going on with $others ranks gives another model"
done
# mpirun takes its time before it passes an interrupt on: a job without an end. Alone it goes on until it is interrupted again.
endless=${small/--stage2 250/--stage2 1000000}
export OMPI_MCA_odls_base_sigkill_timeout=5
begin $endless
kill -INT $parent
wait $parent && fail "sf_train, interrupted job: success"
first=$(sed -n 's/.*interrupted at iteration \([0-9]*\); continue with --resume.*/\1/p' cut.err)
log_lines=$(wc -l <cut.model.jsonl)
interrupt '[ "$(wc -l <cut.model.jsonl)" -gt "$log_lines" ]' /dev/null again.err "$bin/sf_train" photos $endless $grid -q -o cut.model --resume
second=$(sed -n 's/.*interrupted at iteration \([0-9]*\); continue with --resume.*/\1/p' again.err)
[ "${first:-0}" -gt 0 ] && [ "${second:-0}" -gt "$first" ] || fail "sf_train, interrupted job: $(cat cut.err again.err)"
unset OMPI_MCA_odls_base_sigkill_timeout
mkdir dark && "$bin/sf_scene" textured -o dark/photos --size 16 --train 6 --test 3 >/dev/null
cp photos/train/r_1.png dark/photos/train/r_0.png
refused 1 "has another data set than rank 0" -n 1 "$bin/sf_train" photos $small -q -o x.model : -n 1 -wdir "$work/dark" "$bin/sf_train" photos $small -q -o x.model

# ---- other CPUs: floats differ, so they are refused ----
narrow=(-n 1 env SPIKEFIELD_CPU=portable)
if grep -q avx2 /proc/cpuinfo; then
  refused 1 "has another instruction set than rank 0" -n 1 "$bin/sf_train" photos $small $grid -q -o x.model : "${narrow[@]}" "$bin/sf_train" photos $small $grid -q -o x.model
  grep -q 'SPIKEFIELD_CPU' refused.out || fail "no word about what the ranks may share: $(cat refused.out)"
else
  echo "one CPU alone: no refusal tried"
fi

# ---- a full disk on one rank ----
tight=("$bin/sf_train" photos ${small/--stage2 250/--stage2 28} $grid -q -o tight.model)
refused 1 "sf_train: cannot write tight.model" -n 1 bash -c "$(full 1)" "${tight[@]}" : -n 1 "${tight[@]}"
[ ! -e tight.model ] || fail "sf_train, a full disk: half a model is there"

finish "sf_train on 1, 2, 3, 4, 8 ranks, killed, interrupted and continued: what one process gives"
