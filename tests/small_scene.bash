# For scripts of tests/chain that try programs on a small scene:   . small_scene.bash BUILD
# Gives build, root (of the source), work (a folder that goes at the end) with scene.snn and data/ in it, fail and finish.
set -u
build=$(cd "${1:?usage: $0 BUILD}" && pwd) || exit 2
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd) || exit 2
work=$(mktemp -d "${TMPDIR:-/tmp}/sf_chain.XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
failures=0

fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
finish() { # TEXT: the last line of a script where nothing failed
  [ $failures -eq 0 ] && echo "$1"
  exit $((failures > 0))
}

"$build/faults/make_scene" "$work/scene.snn" || exit 1
"$build/bin/sf_scene" "${SF_FAULT_SCENE:-simple}" -o "$work/data" --size 32 --train 1 --test 2 >/dev/null || exit 1
