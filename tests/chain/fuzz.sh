#!/bin/bash
# Every fuzzing target over its seeds and over what fuzzing once found.   usage: fuzz.sh BUILD
set -u
build=${1:?usage: fuzz.sh BUILD}
here=$(cd "$(dirname "$0")" && pwd)/../fuzz
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
  grep -q "^| \`$target\` |" "$here/../../docs/fuzzing.md" || { failed=1; echo "FAILED $target: no row in docs/fuzzing.md"; }
  inputs=("$work/seeds/$target")
  [ -d "$here/regressions/$target" ] && inputs+=("$here/regressions/$target")
  if result=$(ulimit -v "$limit" && timeout -k 5 60 "$build/tests/fuzz/$target" "${inputs[@]}" 2>&1); then
    echo "$target: $result"
  else
    failed=1
    echo "FAILED $target: $(ulimit -v "$limit" && FUZZ_VERBOSE=1 timeout -k 5 60 "$build/tests/fuzz/$target" "${inputs[@]}" 2>&1 | tail -n 20)"
  fi
done

# run.sh on stand-ins that end as libFuzzer does at a timeout: `nap` slept through its first one, which is none, so it is
# called again; `spin` needs the processor for ever.
mkdir -p "$work/standins/tests/fuzz" "$work/standins/fuzz/bin"
printf '#!/bin/bash\nmkdir -p "$1"\n' >"$work/standins/tests/fuzz/seeds"
cat >"$work/standins/fuzz/bin/fuzz_nap" <<'END'
#!/bin/bash
echo >>"$0.calls"
name=${0##*/fuzz_}
findings=${0%/bin/*}/findings/$name
if [ $# -eq 2 ]; then # alone with the input
  [ "$name" = nap ] && exit 0
  while :; do :; done
fi
echo "#9 REDUCE cov: 3 ft: 4"
echo "stat::number_of_executed_units: 10"
[ "$name" = nap ] && [ "$(wc -l <"$0.calls")" -gt 1 ] && sleep 3 && exit 0
echo one >"$findings/timeout-1"
echo "Test unit written to $findings/timeout-1"
exit 70
END
cp "$work/standins/fuzz/bin/fuzz_nap" "$work/standins/fuzz/bin/fuzz_spin"
chmod +x "$work"/standins/{tests/fuzz/seeds,fuzz/bin/*}
table=$(FUZZ_PATIENCE=1 "$here/run.sh" "$work/standins" 2 1 nap spin 2>&1) && failed=1 && echo "FAILED: a timeout is no finding"
grep -qE '^ +nap +20 .* none$' <<<"$table" && grep -qE '^ +spin +10 .* FOUND$' <<<"$table" || failed=1
[ ! -e "$work/standins/fuzz/findings/nap/timeout-1" ] && [ -e "$work/standins/fuzz/findings/spin/timeout-1" ] || failed=1
[ "$(wc -l <<<"$table")" -eq 4 ] || failed=1 # nothing of a killed process
echo "$table"
exit $failed
