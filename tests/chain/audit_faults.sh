#!/bin/bash
# Plants a miscount in each of the counts and sees energy_audit catch and locate it. usage: audit_faults.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"

# expect FAULT STATUS TEXT...: exit status, and each text in the one line on stderr
expect() {
  local fault=$1 want=$2 got
  shift 2
  SF_FAULT=$fault "$build/faults/energy_audit" "$work/scene.snn" "$work/data" --rays 400 --rtl-rays 24 --recount-rays 60 \
    --seed 7 --quiet --json --tech share/tech/45nm.tech --plusarg "+fault=$fault" >"$work/$fault.json" 2>"$work/$fault.err"
  got=$?
  [ $got -eq "$want" ] || fail "fault $fault: exit status $got, expected $want: $(cat "$work/$fault.err")"
  for text in "$@"; do
    grep -qE "$text" "$work/$fault.err" || fail "fault $fault: '$text' is not in: $(cat "$work/$fault.err")"
  done
  echo "fault $fault: $(cat "$work/$fault.err")"
}

expect 0 0
grep -q '"core_equals_rtl_equals_recount":	true' "$work/0.json" || fail "without a fault the three counts differ"
# The accelerator's counter: one spike of C1 at step 2 too many, in one sample.
expect 3 1 'ray [0-9]+ \(view .*, pixel [0-9]+,[0-9]+\)' 'spikes of layer C1 at step 2: core [0-9]+, accelerator [0-9]+$'
grep -q '"core_equals_rtl_equals_recount":	false' "$work/3.json" || fail "the report does not say that the counts differ"
core=$(sed -E 's/.*core ([0-9]+), accelerator ([0-9]+)$/\1/' "$work/3.err")
rtl=$(sed -E 's/.*core ([0-9]+), accelerator ([0-9]+)$/\2/' "$work/3.err")
[ "$rtl" -eq $((core + 1)) ] || fail "fault 3: the counter is not one too high"
# The core: one SOP too many in C2 at step 1.
expect 4 1 'ray [0-9]+, sample [0-9]+: SOP of layer C2 at step 1: core [0-9]+, recount [0-9]+$'
core=$(sed -E 's/.*core ([0-9]+), recount ([0-9]+)$/\1/' "$work/4.err")
recount=$(sed -E 's/.*core ([0-9]+), recount ([0-9]+)$/\2/' "$work/4.err")
[ "$core" -eq $((recount + 1)) ] || fail "fault 4: the core does not count one too many"
# The recount: neuron 63, which fires in every sample, is overlooked.
expect 5 1 'ray [0-9]+, sample 0: .* core [0-9]+, recount [0-9]+$'
# The vector core alone: a sample less than the portable core.
expect 6 1 'ray [0-9]+, MAC of layer D1 at step 0: vector core [0-9]+, portable core [0-9]+$'
# The accelerator's global counters: a sample, a ray too many.
expect 7 1 'ray [0-9]+ \(view .*samples: core [0-9]+, accelerator [0-9]+$'
expect 8 1 'ray [0-9]+ \(view .*rays: core [0-9]+, accelerator [0-9]+$'
# The field's cache: the portable core asks once too often, the vector core misses once too often.
expect 11 1 'ray [0-9]+, sample 0: field look-ups: core [0-9]+, recount [0-9]+$'
expect 12 1 'ray [0-9]+, field lines missed: vector core [0-9]+, portable core [0-9]+$'
# The accelerator's cache: its counter of misses is one too high.
expect 13 1 'ray [0-9]+ \(view .*field lines missed: core [0-9]+, accelerator [0-9]+$'
core=$(sed -E 's/.*core ([0-9]+), accelerator ([0-9]+)$/\1/' "$work/13.err")
rtl=$(sed -E 's/.*core ([0-9]+), accelerator ([0-9]+)$/\2/' "$work/13.err")
[ "$rtl" -eq $((core + 1)) ] || fail "fault 13: the counter is not one too high"
finish "9 planted miscounts caught and located, none without a fault"
