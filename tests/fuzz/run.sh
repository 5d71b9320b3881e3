#!/bin/bash
# Fuzzes targets, JOBS of them at a time.   usage: run.sh BUILD SECONDS JOBS TARGET...    run.sh --installed CLANG
# Inputs that reach something new stay in BUILD/fuzz/corpus/TARGET for the next time, findings in
# BUILD/fuzz/findings/TARGET, the processor time spent since the last finding in BUILD/fuzz/spent/TARGET, kept every ten
# minutes. Exits with 1 when there was a finding.
set -u
if [ "$1" = --installed ]; then
  echo 'int LLVMFuzzerTestOneInput(void) { return 0; }' |
    "$2" -x c -fsanitize=fuzzer,address,undefined -o /dev/null - 2>/dev/null && exit 0
  echo "fuzz: $2 with its sanitizer libraries is not installed: \`make deps-fuzz\` installs clang and libclang-rt-dev" >&2
  exit 1
fi
build=$1 seconds=$2 jobs=$3 patience=${FUZZ_PATIENCE:-10} slice=600 # seconds of one input, of one call
shift 3
here=$(dirname "$0")
out=$build/fuzz
seeds=$out/seeds
mkdir -p "$out/tmp" "$out/spent" && rm -rf "$seeds" && "$build/tests/fuzz/seeds" "$seeds" || exit 1
TMPDIR=$(cd "$out/tmp" && pwd)
export TMPDIR
export LC_ALL=C TIMEFORMAT='%U %S'
trap 'rm -rf "$TMPDIR"' EXIT
set -m # a process group each, so that stopping reaches the fuzzers
trap 'for group in $(jobs -p); do kill -TERM -- "-$group" 2>/dev/null; done; wait; exit 130' INT TERM
found=0

number() { # of the line "stat::NAME: value"
  sed -n "s/^stat::$1: *//p" "$2" | tail -n 1
}

# libFuzzer measures a timeout by the clock: on a busy machine the input has not had the time. True where it has.
needs_long() { # TARGET INPUT
  { ! (ulimit -t "$patience" && exec "$out/bin/fuzz_$1" -timeout=3600 "$2") >/dev/null 2>&1; } 2>/dev/null
}

# Adds to what was spent before; a finding begins anew. Prints hours.
spend() { # TARGET STATUS "USER SYSTEM"
  local file=$out/spent/$1 before=0
  [ -s "$file" ] && before=$(cat "$file")
  awk -v before="$before" -v found="$2" '{ printf "%.1f\n", found ? 0 : before + $1 + $2 }' <<<"$3" >"$file.part" &&
    mv "$file.part" "$file"
  awk '{ printf "%.2f", $1 / 3600 }' "$file"
}

fuzz() { # TARGET
  local target=$1 end=$((SECONDS + seconds)) runs=0
  local corpus=$out/corpus/$target findings=$out/findings/$target log=$out/$target.log
  local sources options status last artifact clock hours left count
  mkdir -p "$corpus" "$findings"
  sources=("$corpus" "$seeds/$target")
  [ -d "$here/regressions/$target" ] && sources+=("$here/regressions/$target")
  options=(-timeout="$patience" -rss_limit_mb=2048 -malloc_limit_mb=512 -print_final_stats=1 -artifact_prefix="$findings/")
  [ -f "$here/$target.dict" ] && options+=(-dict="$here/$target.dict")
  while :; do
    left=$((end > SECONDS ? end - SECONDS : 1))
    clock=$({ time "$out/bin/fuzz_$target" -max_total_time=$((left < slice ? left : slice)) "${options[@]}" \
      "${sources[@]}" >"$log" 2>&1; } 2>&1)
    status=$?
    artifact=$(sed -n 's/.*Test unit written to //p' "$log" | tail -n 1)
    [[ $artifact == "$findings"/timeout-* ]] && ! needs_long "$target" "$artifact" && rm "$artifact" && status=0
    count=$(number number_of_executed_units "$log")
    runs=$((runs + ${count:-0}))
    hours=$(spend "$target" $status "$clock")
    [ $status -eq 0 ] && [ $SECONDS -lt $end ] || break
  done
  last=$(grep -a 'cov: ' "$log" | tail -n 1)
  printf '  %-11s %10s %8s %9s %9s %7s %7s  %s\n' "$target" "$runs" "$(number average_exec_per_sec "$log")" \
    "$(sed -n 's/.*cov: \([0-9]*\).*/\1/p' <<<"$last")" "$(sed -n 's/.*ft: \([0-9]*\).*/\1/p' <<<"$last")" \
    "$(find "$corpus" -type f | wc -l)" "$hours" "$([ $status -eq 0 ] && echo none || echo FOUND)"
  [ $status -eq 0 ] && return
  grep -aE 'ERROR: |SUMMARY: |runtime error: |does not hold: ' "$log" | head -n 4 | sed 's/^/    /'
  echo "    replay: $out/bin/fuzz_$target ${artifact:-(no input was kept, see $log)}"
  return 1
}

printf '  %-11s %10s %8s %9s %9s %7s %7s  %s\n' target runs runs/s edges features corpus hours findings
running=0
for target in "$@"; do
  if [ $running -ge "$jobs" ]; then
    wait -n || found=1
    running=$((running - 1))
  fi
  fuzz "$target" &
  running=$((running + 1))
done
while [ $running -gt 0 ]; do
  wait -n || found=1
  running=$((running - 1))
done
exit $found
