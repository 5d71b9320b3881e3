#!/bin/bash
# Counts how many mutants of the engine's control modules and of sf_csr the tests of the co-simulation kill.
# usage: engine.sh FOLDER --checkers "TEST..." [--mutants N] MODULE...
# FOLDER has the checkers, linked with an accelerator that holds every mutant, and rtl/mutants, their list
# (operators.py); SF_MUTANT=N in the environment chooses one. --mutants: at most so many per module, spread evenly over
# it, the same ones every time. Killed: a checker fails, crashes or hangs; the checkers run in the order given, the first
# that kills ends it. Results are kept in FOLDER/results, so that an interrupted run goes on where it was, until one of
# the checkers changes. Exit 0 nothing unexplained survived, 1 not.
# Equivalent: listed with its reason in tests/mutate/equivalent-engine; a listed one that is killed is reported as stale.
set -u
cd "$(dirname "$0")/../.." || exit 1
case ${1:-} in '' | -*) sed -n '2,9s/^# //p' "$0"; exit 2 ;; esac
folder=$1 checkers=() mutants=100000 modules=()
shift
while [ $# -gt 0 ]; do
  case $1 in
    --mutants) mutants=$2; shift ;;
    --checkers) read -ra checkers <<<"$2"; shift ;;
    *) modules+=("$1") ;;
  esac
  shift
done
limit=${MUTANT_LIMIT:-200} # seconds per checker; a loaded machine must not make a hang of a slow one
jobs=${MUTANT_JOBS:-2}
list=$folder/rtl/mutants known=tests/mutate/equivalent-engine
export folder limit checkers_of_mutant="${checkers[*]}"
export CK_FORK=no
trap 'exit 130' INT TERM

# judge MUTANT: "MUTANT killed CHECKER STATUS" (124: it hung) or "MUTANT survived"
judge() {
  local checker status
  for checker in $checkers_of_mutant; do
    SF_MUTANT=$1 timeout "$limit" "$folder/$checker" >/dev/null 2>&1
    status=$?
    [ $status -eq 0 ] || { echo "$1 killed $checker $status"; return; }
  done
  echo "$1 survived"
}
export -f judge

key=$(for checker in "${checkers[@]}"; do cat "$folder/$checker" || echo missing; done | sha256sum)
if [ "$(cat "$folder/key" 2>/dev/null)" != "$key" ]; then
  for checker in "${checkers[@]}"; do
    SF_MUTANT=0 timeout "$limit" "$folder/$checker" >/dev/null 2>&1 || { echo "mutate: $checker fails without a mutant" >&2; exit 1; }
  done
  rm -f "$folder/results"
  echo "$key" >"$folder/key"
fi
touch "$folder/results"

# sample MODULE: numbers of its mutants
sample() {
  awk -v module="$1" -v most="$mutants" '$2 == module { n[++count] = $1 }
    END { take = count < most ? count : most; for (i = 0; i < take; i++) print n[int(i * count / take) + 1] }' "$list"
}

total_killed=0 total_left=0 failures=0 json=
printf '%-16s %8s %8s %11s %9s %8s %8s\n' module mutants killed equivalent survived score seconds
for module in "${modules[@]}"; do
  start=$SECONDS killed=0 equivalent=0 left=0 survivors=
  numbers=$(sample "$module")
  [ -n "$numbers" ] || { echo "mutate: no mutants of $module" >&2; exit 2; }
  grep -vxFf <(cut -d' ' -f1 "$folder/results") <<<"$numbers" | xargs -r -P "$jobs" -I{} bash -c 'judge {}' >>"$folder/results"
  for m in $numbers; do
    what=$(sed -n "${m}s/^[0-9]* //p" "$list")
    result=$(grep "^$m " "$folder/results")
    case $result in
      *killed*)
        killed=$((killed + 1))
        if grep -qF "$what |" "$known"; then
          echo "$known: $what is killed: remove the line" >&2
          failures=$((failures + 1))
        fi ;;
      *survived*)
        if grep -qF "$what |" "$known"; then equivalent=$((equivalent + 1)); else
          left=$((left + 1))
          survivors+="  $what"$'\n'
        fi ;;
      *) echo "mutate: no result of mutant $m" >&2; exit 1 ;;
    esac
  done
  counted=$((killed + left))
  printf '%-16s %8d %8d %11d %9d %7s%% %8d\n%s' "$module" $((counted + equivalent)) $killed $equivalent $left \
    "$(bc <<<"scale=1; 100 * $killed / $counted")" $((SECONDS - start)) "$survivors"
  json+="${json:+,}{\"module\":\"$module\",\"mutants\":$((counted + equivalent)),\"killed\":$killed,\"equivalent\":$equivalent,\"survived\":$left}"
  total_killed=$((total_killed + killed)) total_left=$((total_left + left))
done
total=$((total_killed + total_left))
echo "{\"killed\":$total_killed,\"not_equivalent\":$total,\"modules\":[$json]}" >"$folder/mutate.json"
printf 'score %d / %d = %s %%, JSON in %s\n' $total_killed $total "$(bc <<<"scale=2; 100 * $total_killed / $total")" "$folder/mutate.json"
[ $total_left -eq 0 ] && [ $failures -eq 0 ]
