#!/bin/bash
# Fuzzes targets one after another.   usage: run.sh BUILD SECONDS TARGET...    run.sh --installed CLANG
# Inputs that reach something new stay in BUILD/fuzz/corpus/TARGET for the next time, findings in
# BUILD/fuzz/findings/TARGET. Exits with 1 when there was one.
set -u
if [ "$1" = --installed ]; then
  echo 'int LLVMFuzzerTestOneInput(void) { return 0; }' |
    "$2" -x c -fsanitize=fuzzer,address,undefined -o /dev/null - 2>/dev/null && exit 0
  echo "fuzz: $2 with its sanitizer libraries is not installed: \`make deps-fuzz\` installs clang and libclang-rt-dev" >&2
  exit 1
fi
build=$1 seconds=$2
shift 2
here=$(dirname "$0")
out=$build/fuzz
seeds=$out/seeds
mkdir -p "$out/tmp" && rm -rf "$seeds" && "$build/tests/fuzz/seeds" "$seeds" || exit 1
TMPDIR=$(cd "$out/tmp" && pwd)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
trap 'exit 130' INT TERM
found=0

number() { # of the line "stat::NAME: value"
  sed -n "s/^stat::$1: *//p" "$2" | tail -n 1
}

printf '  %-11s %10s %8s %9s %9s %7s  %s\n' target runs runs/s edges features corpus findings
for target in "$@"; do
  corpus=$out/corpus/$target findings=$out/findings/$target log=$out/$target.log
  mkdir -p "$corpus" "$findings"
  sources=("$corpus" "$seeds/$target")
  [ -d "$here/regressions/$target" ] && sources+=("$here/regressions/$target")
  options=(-max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=512 -print_final_stats=1
    -artifact_prefix="$findings/")
  [ -f "$here/$target.dict" ] && options+=(-dict="$here/$target.dict")
  "$out/bin/fuzz_$target" "${options[@]}" "${sources[@]}" >"$log" 2>&1
  status=$?
  last=$(grep -a 'cov: ' "$log" | tail -n 1)
  printf '  %-11s %10s %8s %9s %9s %7s  %s\n' "$target" "$(number number_of_executed_units "$log")" \
    "$(number average_exec_per_sec "$log")" "$(sed -n 's/.*cov: \([0-9]*\).*/\1/p' <<<"$last")" \
    "$(sed -n 's/.*ft: \([0-9]*\).*/\1/p' <<<"$last")" "$(find "$corpus" -type f | wc -l)" \
    "$([ $status -eq 0 ] && echo none || echo FOUND)"
  if [ $status -ne 0 ]; then
    found=1
    grep -aE 'ERROR: |SUMMARY: |runtime error: |does not hold: ' "$log" | head -n 4 | sed 's/^/    /'
    artifact=$(sed -n 's/.*Test unit written to //p' "$log" | tail -n 1)
    echo "    replay: $out/bin/fuzz_$target ${artifact:-(no input was kept, see $log)}"
  fi
done
exit $found
