#!/bin/bash
# What tests/run.sh makes of tests that are skipped, or that leave a part out: allowed on a user's machine, failures in
# continuous integration.   usage: skips.sh BUILD
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "skips: $1" >&2; cat "$work/out" >&2; exit 1; }
mkdir "$work/tests"
planted() { printf '#!/bin/bash\n%s\n' "$2" >"$work/tests/$1" && chmod +x "$work/tests/$1"; }
planted whole 'echo "amx: not on this machine"'
planted skipped 'echo "skipped: no browser"; exit 77'
planted partly 'echo "iverilog: not installed"'
planted broken 'exit 1'

# tried CI STATUS CLOSING-LINE NAME...: what run.sh says of them
tried() {
  local status=0
  CI=$1 ./run.sh "$work" "${@:4}" >"$work/out" 2>&1 || status=$?
  [ "$status" -eq "$2" ] || fail "CI='$1', ${*:4}: exit status $status, expected $2"
  grep -qxF -e "$3" "$work/out" || fail "CI='$1', ${*:4}: not '$3'"
}
tried '' 0 "2 passed, 0 failed, 1 skipped" whole partly skipped
grep -q ' partly .*ok, without iverilog$' "$work/out" || fail "what was left out is not named"
tried '' 1 "0 passed, 0 failed, 1 skipped" skipped
tried true 0 "1 passed, 0 failed, 0 skipped" whole
tried true 1 "1 passed, 1 failed, 0 skipped" whole skipped
grep -q ' skipped .*FAILED: skipped: skipped: no browser; with CI=true' "$work/out" || fail "the reason is not named"
tried true 1 "1 passed, 1 failed, 0 skipped" whole partly
grep -q ' partly .*FAILED: without iverilog, and with CI=true' "$work/out" || fail "what was left out is not named"
grep -q '<failure' "$work/tests/junit.xml" || fail "junit.xml knows of no failure"
tried '' 1 "1 passed, 1 failed, 0 skipped" whole broken
# A Python of the build's own comes first.
mkdir -p "$work/python/bin"
printf '#!/bin/sh\necho own\n' >"$work/python/bin/python3" && chmod +x "$work/python/bin/python3"
planted which '[ "$(python3)" = own ]'
tried '' 0 "1 passed, 0 failed, 0 skipped" which
echo "skips: ok"
