#!/bin/bash
# Plants one fault after another in a copy of the RTL and sees sf_cosim catch and locate each. usage: cosim_faults.sh BUILD
NEURONS=72 # programmed sooner; fault 2 is in neuron 64
. "$(dirname "$0")/../small_scene.bash" "$@"

# expect FAULT STATUS TEXT...: exit status, and each text in the first difference
expect() {
  local fault=$1 want=$2 got
  shift 2
  rm -f "$work"/evidence*
  "$build/faults/sf_cosim" "$work/scene.snn" "$work/data" --rays 100 --seed 7 --limit-samples 1000 --quiet --json \
    --evidence "$work/evidence" --plusarg "+fault=$fault" >"$work/$fault.json" 2>"$work/$fault.err"
  got=$?
  [ $got -eq "$want" ] || fail "fault $fault: exit status $got, expected $want: $(cat "$work/$fault.err")"
  tr -d '\n\t ' <"$work/$fault.json" | sed -E 's/.*"first_difference":(null|\{[^}]*\}).*/\1/' >"$work/$fault.first"
  for text in "$@"; do
    grep -qF "$text" "$work/$fault.first" || fail "fault $fault: '$text' is not in $(cat "$work/$fault.first")"
  done
  echo "fault $fault: $(cat "$work/$fault.err" "$work/$fault.first")"
}

field() { sed -E "s/.*\"$2\":([0-9-]+).*/\1/" "$work/$1.first"; }

expect 0 0 null
expect 1 1 '"layer":"C2"' '"neuron":37,' '"wire":"membrane"'
[ "$(field 1 step)" -ge 1 ] || fail "fault 1: step 0 rounds nothing in hybrid mode"
# A difference whose evidence cannot be written is one, in every report.
mkdir "$work/gone" && cd "$work/gone" && rmdir "$work/gone" || exit 1 # no file can be there
"$build/faults/sf_cosim" "$work/scene.snn" "$work/data" --rays 100 --seed 7 --limit-samples 1000 --quiet --json \
  --junit "$work/lost.xml" --plusarg +fault=1 >"$work/lost.json" 2>"$work/lost.err"
got=$?
cd "$work" || exit 1
[ $got -eq 1 ] && grep -q 'C2.*no evidence: .*sf_cosim-difference' "$work/lost.err" && ! grep -q '^evidence:' "$work/lost.err" && grep -q '"no_evidence":' "$work/lost.json" &&
  grep -q '<failure' "$work/lost.xml" || fail "a difference without evidence: $(cat "$work/lost.err")"
# What the report counts is of the samples that it names: the counters of the chunk with the difference are read, too.
samples=$(sed -nE 's/^\t"samples":\t([0-9]+),$/\1/p' "$work/1.json")
counted=$(sed -nE 's/^\t\t"samples":\t([0-9]+),$/\1/p' "$work/1.json" | tail -n 1)
sops=$(sed -nE 's/^\t\t\t"sop":\t([0-9]+),$/\1/p' "$work/1.json" | head -n 1)
[ "${samples:-0}" -gt 0 ] && [ "$samples" = "$counted" ] && [ "${sops:-0}" -gt 0 ] ||
  fail "fault 1: ${samples:-no} samples, counts of ${counted:-no} with ${sops:-no} SOP"
expect 2 1 '"layer":"C2"' '"step":1,' '"neuron":64,' '"wire":"row"' '"expected":1,' '"actual":0,'
expect 3 1 '"layer":"C1"' '"step":2,' '"wire":"spikes"' '"sample_exact":true'
[ "$(field 3 actual)" -eq $(($(field 3 expected) + 1)) ] || fail "fault 3: the counter is not one too high"
expect 7 1 '"wire":"samples"'
expect 8 1 '"wire":"rays"'
# A result that is not the one that was shown while it waited.
expect 9 1
grep -qE 'result changed before it was taken at cycle [0-9]+' "$work/9.err" || fail "fault 9: $(cat "$work/9.err")"
# says FAULT TEXT: what a register access, a stream or the simulation itself does wrong
says() {
  expect "$1" 1
  grep -qE "$2" "$work/$1.err" || fail "fault $1: $(cat "$work/$1.err")"
}
says 10 'layer D1 step 0 mac' # a counter's answer follows an address that is no longer on offer
says 11 'register 018 refused'
says 12 'register 1[0-9a-f]+ refused'
says 13 'register [0-9a-f]+ answered before it was asked'
says 18 'register [0-9a-f]+ answered before it was asked'
says 14 'hang at cycle'
says 16 'tap beat after the last sample'
says 17 'the simulation ended by itself'
cp "$work/evidence.json" "$work/end.json"
for how in "--replay $work/end.json --evidence $work/end-again" \
  "$work/scene.snn $work/data --rays 20 --plusarg +fault=17 --saif $work/end.saif"; do
  # shellcheck disable=SC2086
  "$build/faults/sf_cosim" $how --quiet >"$work/end.out" 2>&1
  [ $? -eq 1 ] && grep -q 'the simulation ended by itself' "$work/end.out" || fail "$how: $(cat "$work/end.out")"
done
# A word that no block reads is refused: the run would look like one with a fault that is not seen.
refused() { # TEXT PROGRAM ARGUMENT...
  "${@:2}" --quiet >"$work/word.out" 2>&1
  [ $? -eq 2 ] && grep -qF -- "$1" "$work/word.out" || fail "${*:2}: $(head -n 3 "$work/word.out")"
}
refused '--plusarg +fault=1 would change nothing: the block in this program reads no such word' \
  "$build/bin/sf_cosim" "$work/scene.snn" "$work/data" --rays 1 --plusarg +fault=1
refused '--plusarg +fault=1 would change nothing' \
  "$build/bin/energy_audit" "$work/scene.snn" "$work/data" --rays 1 --rtl-rays 1 --plusarg +fault=1
refused '--plusarg +fuss=1 would change nothing: the block in this program reads only fault=' \
  "$build/faults/sf_cosim" "$work/scene.snn" "$work/data" --rays 1 --plusarg +fuss=1
refused '--plusarg fault=1: expected +NAME' "$build/faults/sf_cosim" "$work/scene.snn" "$work/data" --rays 1 --plusarg fault=1
# A rounding that truncates is one LSB too low.
[ "$(field 1 actual)" -eq $(($(field 1 expected) - 1)) ] || fail "fault 1: the membrane is not one too low"
finish "14 planted faults caught and located, none without a fault"
