#!/bin/bash
# Mutants of a small C file: a planted survivor is reported as one, others are killed or equivalent, verdicts are kept, and
# the time's end is kept. Every equivalent that is listed for the product's files is one of their mutants.
# usage: mutate_c.sh BUILD
set -u
/usr/bin/python3 -c 'import clang.cindex' 2>/dev/null || { echo "mutate_c: skipped: python3-clang-14 is not installed"; exit 77; }
here=$(cd "$(dirname "$0")/../.." && pwd)
build=$(cd "$1" && pwd)
MAKEFLAGS='' make -s -C "$here" B="$build" listed-c || exit 1

cd "$here" || exit 1
work=$build/mutate-c/sample
sample=tests/mutate/sample
rm -rf "$work"
mkdir -p "$work/mutate-c" "$work/tests" "$work/obj/tests/mutate"
gcc -c tests/mutate/first_failure.c -o "$work/obj/tests/mutate/first_failure.o" && gcc -c $sample/mean.c -o "$work/mean.o" &&
  gcc -c $sample/test_mean.c -o "$work/test_mean.o" && ar rc "$work/mean.a" "$work/mean.o" || exit 1
commands="gcc -O2 -c $sample/mean.c -o $work/mean.o
gcc -o $work/tests/test_mean $work/test_mean.o $work/mean.a"
echo "$commands" >"$work/mutate-c/commands"
${commands##*$'\n'} || exit 1

fail() {
  echo "mutate_c: $1"
  cat "$work/log" "$work/mutate-c/results"
  exit 1
}
# campaign STATUS OPTION...
campaign() {
  local status=$1
  shift
  tests/mutate/c_mutants.py "$work" $sample/mean.c --jobs 2 --equivalents "$work/equivalent" "$@" >"$work/log" 2>&1
  local got=$?
  [ $got -eq "$status" ] || fail "exit status $got instead of $status with $*"
}
# verdict MUTANT VERDICT CHECKER
verdict() {
  grep -qF "{\"mutant\": \"$sample/mean.c sample_mean: $1\", \"verdict\": \"$2\"" "$work/mutate-c/results" || fail "$1 is not $2"
}

: >"$work/equivalent"
campaign 1 --minutes 0.0001
grep -q 'time is over with 0 of 1' "$work/log" || fail "programs were measured behind the time's end"
campaign 0 --reach-only
campaign 0 --minutes 0.0001
[ ! -s "$work/mutate-c/results" ] || fail "mutants were judged behind the time's end"
campaign 1
verdict '/ -> * in `sum / n`' killed
verdict '++ turned in `i++`' killed
verdict 'without 1 * in `1 * x[i]`' equivalent
verdict '< -> <= in `n < 1`' survived
grep -qF "survived: $sample/mean.c:7: $sample/mean.c sample_mean: < -> <= in \`n < 1\`" "$work/log" || fail "the survivor has no line"
grep -qxF '    + if (n <= 1) return 0;' "$work/log" || fail "the survivor's change is not shown"
[ "$(grep -c '  survived:' "$work/log")" = "$(grep -c '"survived"' "$work/mutate-c/results")" ] || fail "survivors are missing"
grep -q '^| tests/mutate/sample/mean.c |' "$work/mutate-c/mutate.md" || fail "no table in Markdown"

# All are kept: the same again judges none, and a sample is of them.
before=$(sort "$work/mutate-c/results")
campaign 1
[ "$(sort "$work/mutate-c/results")" = "$before" ] || fail "verdicts were not kept"
campaign 1 --sample 30

# With its reason a survivor is no failure; an entry that is killed, or no mutant, is one.
sed -n "s|^  survived: [^ ]* \(.*\)|\1 \| for this test|p" "$work/log" >"$work/equivalent"
campaign 0 --sample 30
echo "$sample/mean.c sample_mean: / -> * in \`sum / n\` | not so" >>"$work/equivalent"
campaign 1
echo "$sample/mean.c sample_mean: no such change | not so" >>"$work/equivalent"
campaign 1
echo "$(grep -c . "$work/mutate-c/results") mutants of $sample/mean.c, verdicts as planted"
