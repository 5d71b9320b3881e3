#!/bin/bash
# Runs tests and a co-simulation of a coverage build and adds up what they covered. usage: coverage.sh BUILD TEST...
# Fails under 95 % of the lines. KEEP=1 adds to what is there.
set -u
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$1" && pwd)
shift
points=$build/points
[ -n "${KEEP:-}" ] || rm -f "$points"/* "$build"/merged.dat
cd "$here/.." || exit 1

# One file per accelerator is left behind: some hundreds, which are merged as soon as a test has ended.
merge() {
  verilator_coverage --write "$build/sum.dat" $([ -e "$build/merged.dat" ] && echo "$build/merged.dat") "$points"/*.dat || exit 1
  mv "$build/sum.dat" "$build/merged.dat"
  rm -f "$points"/*.dat
}

export CK_TIMEOUT_MULTIPLIER=30
for name in "$@"; do
  echo "  $name"
  "$build/tests/$name" >"$build/$name.log" 2>&1 || { cat "$build/$name.log"; exit 1; }
  merge
done
echo "  sf_cosim"
"$build/faults/make_scene" "$build/scene.snn" && "$build/bin/sf_scene" simple -o "$build/scene" --size 32 --train 1 --test 2 >/dev/null || exit 1
"$build/bin/sf_cosim" "$build/scene.snn" "$build/scene" --rays 40 --block 10 --jobs 2 --quiet >"$build/cosim.log" || exit 1
merge

verilator_coverage --write-info "$build/lcov.info" "$build/merged.dat" || exit 1
"$here/coverage_table.awk" "$build/merged.dat" || low=1
"$build/coverage_report" "${FUNCTIONAL:-0}" || low=1
exit ${low:-0}
