#!/bin/bash
# sf_cosim over several processes, interrupted, continued, replayed: always the same result. usage: cosim_split.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"
cd "$work" || exit 1

# alive PID: a zombie that nobody has waited for has ended
alive() { ps -o stat= -p "$1" | grep -qv Z; }

# cosim NAME STATUS ARGS...: JSON without what may differ in NAME.json, message in NAME.err
cosim() {
  local name=$1 want=$2 got
  rm -f evidence*
  "$build/faults/sf_cosim" scene.snn data --quiet --json --evidence evidence "${@:3}" 2>"$name.err" >"$name.all"
  got=$?
  grep -Ev '"(seconds|jobs)":' "$name.all" >"$name.json"
  [ $got -eq "$want" ] || fail "$*: exit status $got, expected $want: $(cat "$name.err")"
}

# ---- any number of processes: totals, and the first difference, which is of the fourth block ----
for jobs in 1 2 3; do
  cosim equal$jobs 0 --rays 60 --block 7 --jobs $jobs
  cosim limit$jobs 0 --rays 1000 --block 7 --jobs $jobs --limit-samples 500
  cosim fault$jobs 1 --rays 200 --block 2 --seed 11 --jobs $jobs --plusarg +fault=3
  cp evidence.json fault$jobs.replay
  cp evidence.fst fault$jobs.fst
  for case in equal limit fault; do
    cmp -s $case$jobs.json ${case}1.json || fail "$case: $jobs processes give another result"
  done
  cmp -s fault$jobs.replay fault1.replay || fail "$jobs processes give another replay file"
done
grep -q '"samples":[[:space:]]*[1-9]' equal1.json || fail "nothing was compared"
[ "$(sed -nE 's/.*"ray":[[:space:]]*([0-9]+).*/\1/p' fault1.json)" -ge 2 ] || fail "the difference is in the first block"
grep -q '"replay_shows_it":[[:space:]]*true' fault1.json || fail "the replay file does not show the difference"

# ---- replay: the same difference from the file alone, from another folder, on a fault build without options ----
mkdir elsewhere
(cd elsewhere && "$build/faults/sf_cosim" --replay ../fault1.replay) 2>replay.err
[ $? -eq 1 ] || fail "replay: no difference"
what() { sed -nE '1s/.*(ray [0-9]+).*(sample [0-9]+: .*), cycle.*/\1 \2/p' "$1"; }
[ "$(what replay.err | sed -E 's/expected.*//')" = "$(what fault1.err | sed -E 's/expected.*//')" ] ||
  fail "replay: '$(cat replay.err)' is not '$(cat fault1.err)'"
[ -s elsewhere/sf_cosim-replay.fst ] && grep -q 'waveform sf_cosim-replay.fst' replay.err || fail "replay: no waveform"
# Each difference says where its evidence lies and how to replay it; the next one's lies beside it.
mkdir 'two of them'
cd 'two of them' || exit 1
for number in '' -2 -3; do
  "$build/faults/sf_cosim" ../scene.snn ../data --rays 60 --seed 7 --quiet --evidence ' my own' --plusarg +fault=2 2>told.err
  [ -s " my own$number.json" ] && [ -s " my own$number.fst" ] || fail "evidence$number: $(ls)"
  grep -qxF "evidence:  my own$number.json, waveform  my own$number.fst" told.err || fail "evidence$number: $(cat told.err)"
  line=$(sed -n 's/^replay: *//p' told.err)
  [ "${line#*sf_cosim }" = "--replay ' my own$number.json'" ] || fail "how to replay it: $line"
  bash -c "$line" 2>told.replay
  [ $? -eq 1 ] && [ "$(what told.replay | sed -E 's/expected.*//')" = "$(what told.err | sed -E 's/expected.*//')" ] ||
    fail "'$line': $(cat told.replay)"
done
"$build/faults/sf_cosim" --replay ' my own.json' --evidence ' my own-2' >told.err 2>&1
[ $? -eq 2 ] && grep -q "would be written over" told.err || fail "a replay over another's evidence: $(cat told.err)"
cd ..
# Without the fault there is nothing to be seen.
sed 's/+fault=3/+fault=0/' fault1.replay >repaired.replay
"$build/faults/sf_cosim" --replay repaired.replay >replay.out 2>&1 && grep -q 'no difference$' replay.out && grep -q '^waveform: sf_cosim-replay.fst$' replay.out ||
  fail "repaired: $(cat replay.out)"
"$build/bin/sf_cosim" --replay fault1.replay >replay.out 2>&1 &&
  grep -q 'no difference; the file was written by another program$' replay.out || fail "another program: $(cat replay.out)"
# The waveform is of the last two samples and of what is in the block with them: that of 41 samples is not much larger
# than that of one or two.
cosim near 1 --rays 60 --seed 7 --plusarg +fault=2
[ "$(stat -c %s fault1.fst)" -lt $((12 * $(stat -c %s evidence.fst))) ] || fail "the waveform is of more than the last samples"

# refused STATUS TEXT ARGS...
refused() {
  "$build/faults/sf_cosim" "${@:3}" >refused.out 2>&1
  [ $? -eq "$1" ] || fail "${*:3}: exit status is not $1"
  grep -qF -- "$2" refused.out || fail "${*:3}: '$2' is not in $(cat refused.out)"
}
refused 2 "--replay" scene.snn --replay fault1.replay
refused 1 "nowhere.json" --replay nowhere.json
sed 's/"seed":.*/"seed": "12x",/' fault1.replay >bad.replay && refused 1 "seed" --replay bad.replay
sed 's/"stall_percent":.*/"stall_percent": 91,/' fault1.replay >bad.replay && refused 1 "stall_percent" --replay bad.replay
sed -E 's/("features":[[:space:]]*\[)-?[0-9]+/\14000/' fault1.replay >bad.replay && refused 1 "features" --replay bad.replay
head -c 700 fault1.replay >bad.replay && refused 1 "bad.replay" --replay bad.replay
cp scene.snn kept.snn && printf x >>scene.snn
refused 1 "the scene has changed" --replay fault1.replay
mv kept.snn scene.snn

# ---- interrupted: no process stays, what was compared is told; continued: as if it had not been ----
"$build/faults/sf_cosim" scene.snn data --rays 100000 --block 2 --jobs 3 --quiet --json --checkpoint part >stopped.json 2>stopped.err &
parent=$!
for ((i = 0; i < 100; i++)); do [ "$(ps -o pid= --ppid $parent | wc -l)" -eq 3 ] && break; sleep 0.1; done
children=$(ps -o pid= --ppid $parent)
sleep 0.7
kill -INT $parent
wait $parent
[ $? -eq 130 ] || fail "interrupted: exit status is not 130"
for child in $children; do alive "$child" && fail "interrupted: process $child is still there"; done
grep -q '"complete":[[:space:]]*false' stopped.json || fail "interrupted: no partial totals"
grep -q 'samples equal; part holds [0-9]* rays, the same command goes on from there' stopped.err || fail "interrupted: $(cat stopped.err)"
done=$(sed -nE 's/.*stopped after .* rays, ([0-9]+) samples equal.*/\1/p' stopped.err)
[ "${done:-0}" -gt 0 ] || fail "interrupted: nothing was done"
limit=$((done + 3000)) # beyond what is finished
cosim part 0 --rays 100000 --block 2 --jobs 2 --limit-samples $limit --checkpoint part
cosim whole 0 --rays 100000 --block 2 --jobs 3 --limit-samples $limit
cmp -s part.json whole.json || fail "an interrupted run that was continued differs"
cp part damaged
printf 'x' | dd of=damaged bs=1 seek=$(($(stat -c %s damaged) / 2)) conv=notrunc status=none
cosim damaged 1 --rays 100000 --block 2 --limit-samples 1 --checkpoint damaged
grep -q "damaged: this checkpoint is damaged" damaged.err || fail "a damaged checkpoint: $(cat damaged.err)"
cosim other 1 --rays 100000 --block 2 --seed 2 --checkpoint part
grep -q "part: this checkpoint is of another" other.err || fail "another run's checkpoint: $(cat other.err)"

# ---- a finished run is continued with more rays, also from a last block that was not full; never with fewer ----
plain() { "$build/bin/sf_cosim" scene.snn data --quiet "$@" 2>&1; }
cosim grown 0 --rays 17 --block 7 --checkpoint grown.part
grep -q '"rays":[[:space:]]*17,' grown.json || fail "17 rays: $(cat grown.json)"
cp grown.part grown.kept
cosim grown 0 --rays 40 --block 7 --jobs 2 --checkpoint grown.part
cosim ungrown 0 --rays 40 --block 7
cmp -s grown.json ungrown.json || fail "a run that was continued with more rays differs: $(diff grown.json ungrown.json | head -n 6)"
cmp -s grown.part grown.kept && fail "the checkpoint of 40 rays is that of 17"
cosim shrunk 2 --rays 20 --block 7 --checkpoint grown.part
grep -q 'grown.part: 35 rays are finished, more than --rays 20' shrunk.err || fail "fewer rays: $(cat shrunk.err)"
plain --rays 1 --block 1 >one.out
grep -q '^1 ray (' one.out && grep -q 'samples/s by 1 process,' one.out || fail "one of each: $(cat one.out)"

# ---- one process stopped, its parent not: no success ----
"$build/faults/sf_cosim" scene.snn data --rays 100000 --block 20 --jobs 2 --limit-samples 20000 --quiet --json >lone.json 2>lone.err &
parent=$!
for ((i = 0; i < 100; i++)); do [ "$(ps -o pid= --ppid $parent | wc -l)" -eq 2 ] && break; sleep 0.1; done
sleep 0.3
kill -TERM "$(ps -o pid= --ppid $parent | head -n 1 | tr -d ' ')"
wait $parent
[ $? -eq 130 ] || fail "one process stopped: exit status is not 130: $(cat lone.err)"
grep -q '"complete":[[:space:]]*false' lone.json || fail "one process stopped: complete"

# ---- killed outright: the processes end, too ----
"$build/faults/sf_cosim" scene.snn data --rays 100000 --jobs 2 --quiet >/dev/null 2>&1 &
parent=$!
for ((i = 0; i < 100; i++)); do [ "$(ps -o pid= --ppid $parent | wc -l)" -eq 2 ] && break; sleep 0.1; done
children=$(ps -o pid= --ppid $parent)
{ kill -KILL $parent && wait $parent; } 2>/dev/null
sleep 0.5
for child in $children; do alive "$child" && fail "killed: process $child is still there"; done

# ---- the campaign: every seed its share, totals, JUnit; what is finished is not run again ----
campaign() { JOBS=2 "$root/tools/cosim_campaign.sh" "$work/b" scene.snn data 400 "1 2" >campaign.out 2>&1; }
mkdir -p b/bin && ln -s "$build/faults/sf_cosim" b/bin/sf_cosim
campaign || fail "campaign: $(cat campaign.out)"
total=$(sed -nE 's/^([0-9]+) samples over 2 seeds, stalls 20 %, 0 differences.*/\1/p' campaign.out)
[ "${total:-0}" -ge 400 ] || fail "campaign: $(cat campaign.out)"
[ "$(grep -c '<testcase.*/testcase>' b/cosim/campaign.xml)" -eq 2 ] || fail "campaign: JUnit"
campaign && [ "$(grep -c 'done before' campaign.out)" -eq 2 ] || fail "campaign: finished seeds are run again"
rm b/cosim/campaign.json && mkdir -p b/cosim/campaign.json.part
campaign && fail "campaign: success without campaign.json"
grep -q 'campaign.json cannot be written' campaign.out || fail "campaign: $(cat campaign.out)"

finish "1, 2, 3 processes, interrupted, continued and replayed: the same result"
