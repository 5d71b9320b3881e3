#!/bin/bash
# Every fuzzing target over its seeds and over what fuzzing once found.   usage: test_fuzz.sh BUILD
set -u
build=${1:?usage: test_fuzz.sh BUILD}
here=$(cd "$(dirname "$0")" && pwd)/fuzz
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-fuzz-XXXXXX") || exit 2
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
export TMPDIR=$work OMP_NUM_THREADS=1
# A small file must not cost gigabytes. The sanitizers need the address space, but limit each allocation.
export ASAN_OPTIONS=${ASAN_OPTIONS:-}:max_allocation_size_mb=512
limit=$([ "${SANITIZED:-}" ] && echo unlimited || echo 700000)
failed=0
"$build/tests/fuzz/seeds" "$work/seeds" || exit 1
for source in "$here"/fuzz_*.c; do
  target=$(basename "$source" .c)
  target=${target#fuzz_}
  inputs=("$work/seeds/$target")
  [ -d "$here/regressions/$target" ] && inputs+=("$here/regressions/$target")
  if result=$(ulimit -v "$limit" && timeout -k 5 60 "$build/tests/fuzz/$target" "${inputs[@]}" 2>&1); then
    echo "$target: $result"
  else
    failed=1
    echo "FAILED $target: $(ulimit -v "$limit" && FUZZ_VERBOSE=1 timeout -k 5 60 "$build/tests/fuzz/$target" "${inputs[@]}" 2>&1 | tail -n 20)"
  fi
done
exit $failed
