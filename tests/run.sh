#!/bin/bash
# Runs the named tests, JOBS at a time (default: three for two processors, because many wait), and ends with one closing
# line; BUILD/tests/junit.xml.
# usage: run.sh BUILD NAME...     A name is a Check program in BUILD/tests, or a script of tests/chain, which gets BUILD and
# exits with 77 where this machine lacks what it needs. A line "NAME: not installed" in its output says that only a part was
# left out for want of NAME. With CI set (CI=true) neither is allowed: such a test has failed.
build=$1
shift
here=$(dirname "$0")
logs=$build/tests/logs
mkdir -p "$logs"
export OMP_WAIT_POLICY=${OMP_WAIT_POLICY:-passive} # threads that spin slow each other down on a busy machine
export CK_TIMEOUT_MULTIPLIER=${CK_TIMEOUT_MULTIPLIER:-10} # a timeout ends what hangs; it is no measure of speed
[ ! -x "$build/python/bin/python3" ] || PATH=$(cd "$build/python/bin" && pwd):$PATH # made by `make python`
set -m # a group for each test, so that an interrupt ends all of it, and tests that interrupt programs can
trap 'trap - INT TERM; for job in $(jobs -p); do kill -- "-$job"; done 2>/dev/null; wait; exit 130' INT TERM

# run NAME: its seconds, its seconds of processor time and its verdict go to the terminal and into logs/NAME.result.
run() {
  local name=$1 start command status verdict TIMEFORMAT='%U %S'
  start=$(date +%s)
  if [ -f "$build/tests/$name" ]; then
    command=("$build/tests/$name")
  elif [ -f "$here/chain/$name.sh" ]; then
    command=("$here/chain/$name.sh" "$build")
  else
    command=(python3 "$here/chain/$name.py" "$build")
  fi
  { time "${command[@]}" >"$logs/$name.log" 2>&1 </dev/null; } 2>"$logs/$name.processor"
  status=$?
  if [ $status -eq 0 ]; then
    verdict="ok$(sed -n 's/^\([a-z0-9-]*\): not \(on this machine\|installed\)$/, without \1/p' "$logs/$name.log" | sort -u | tr -d '\n')"
    if [ "${CI:-}" ] && grep -q '^[a-z0-9-]*: not installed$' "$logs/$name.log"; then
      verdict="FAILED: ${verdict#ok, }, and with CI=$CI nothing may be left out: make deps deps-ci python"
    fi
  elif [ $status -eq 77 ] || { [ "${command[0]}" = python3 ] && ! command -v python3 >/dev/null; }; then
    verdict="skipped: $(tail -n 1 "$logs/$name.log")"
    [ ! "${CI:-}" ] || verdict="FAILED: $verdict; with CI=$CI no test may be skipped: make deps deps-ci python"
  else
    verdict="FAILED ($status), see $logs/$name.log"
  fi
  set -- $(($(date +%s) - start)) "$(awk '{ s = $1 + $2 } END { printf "%d", s }' "$logs/$name.processor")" "$verdict"
  echo "$*" >"$logs/$name.result"
  echo "$(
    printf '  %-22s %4d s %5d s cpu  %s' "$name" "$@"
    [[ $verdict != FAILED* ]] || { echo && tail -n 20 "$logs/$name.log"; }
  )" # in one piece
}

jobs=${JOBS:-$((($(nproc) * 3 + 1) / 2))}
# What took longest last time begins, after what is new.
mapfile -t ordered < <(for name in "$@"; do
  seconds=99999
  read -r seconds _ 2>/dev/null <"$logs/$name.result"
  echo "$seconds $name"
done 2>/dev/null | sort -s -k1,1nr | cut -d' ' -f2)
rm -f "$logs"/*.result
for name in "${ordered[@]}"; do
  while [ "$(jobs -rp | wc -l)" -ge "$jobs" ]; do wait -n; done
  run "$name" &
done
wait

passed=0 failed=0 skipped=0
for name in "$@"; do
  read -r seconds _ verdict <"$logs/$name.result" || verdict=FAILED
  case $verdict in
    ok*) passed=$((passed + 1)) inside= ;;
    skipped*) skipped=$((skipped + 1)) inside='<skipped/>' ;;
    *) failed=$((failed + 1)) inside='<failure message="see the log"/>' ;;
  esac
  echo "  <testcase classname=\"tests\" name=\"$name\" time=\"$seconds\">$inside</testcase>"
done >"$logs/junit"
{
  echo "<?xml version=\"1.0\" encoding=\"UTF-8\"?>"
  echo "<testsuite name=\"spikefield\" tests=\"$#\" failures=\"$failed\" skipped=\"$skipped\">"
  cat "$logs/junit"
  echo "</testsuite>"
} >"$build/tests/junit.xml"
echo "$passed passed, $failed failed, $skipped skipped"
[ $failed -eq 0 ] && [ $passed -gt 0 ]
