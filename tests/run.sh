#!/bin/bash
# Runs the named tests, JOBS at a time (default: one per processor), and ends with one closing line; BUILD/tests/junit.xml.
# usage: run.sh BUILD NAME...     A name is a Check program in BUILD/tests, or one of the scripts below.
build=$1
shift
here=$(dirname "$0")
logs=$build/tests/logs
mkdir -p "$logs"
export OMP_WAIT_POLICY=${OMP_WAIT_POLICY:-passive} # threads that spin slow each other down on a busy machine
export CK_TIMEOUT_MULTIPLIER=${CK_TIMEOUT_MULTIPLIER:-10} # a timeout ends what hangs; it is no measure of speed
set -m # a group for each test, so that an interrupt ends all of it, and tests that interrupt programs can
trap 'trap - INT TERM; for job in $(jobs -p); do kill -- "-$job"; done 2>/dev/null; wait; exit 130' INT TERM

# run NAME: its verdict goes to the terminal, and with its seconds into logs/NAME.result.
run() {
  local name=$1 start command status verdict
  start=$(date +%s)
  case $name in
    cli) command=("$here/test_cli.sh" "$build/bin") ;;
    reproduce) command=("$here/test_reproduce.sh" "$build") ;;
    pareto) command=("$here/test_pareto.sh" "$build") ;;
    fuzz) command=("$here/test_fuzz.sh" "$build") ;;
    chain) command=("$here/chain.sh" "$build") ;;
    firmware) command=("$here/test_firmware.sh" "$build") ;;
    golden_bench) command=("$here/golden_bench.sh" "$build") ;;
    other_dut) command=("$here/other_dut.sh" "$build") ;;
    html) command=("$here/html.sh" "$build") ;;
    kit) command=("$here/kit.sh" "$build") ;;
    activity) command=("$here/activity.sh" "$build") ;;
    lanes) command=("$here/lanes.sh" "$build") ;;
    mutate) command=("$here/mutate/units.py" "$build" --sample) ;;
    formal) command=("$here/formal/run.sh" "$build" --quick) ;;
    install) command=("$here/install.sh" "$build") ;;
    golden_set) command=("$here/golden_set.sh" "$build") ;;
    cosim_split) command=("$here/cosim_split.sh" "$build") ;;
    audit_report) command=("$here/audit_report.sh" "$build") ;;
    audit_faults) command=("$here/audit_faults.sh" "$build") ;;
    cosim_faults) command=("$here/cosim_faults.sh" "$build") ;;
    house) command=("$here/house.sh" "$build") ;;
    synth) command=("$here/test_synth.sh") ;;
    package) command=("$here/test_package.sh") ;;
    safetensors) command=(python3 "$here/crosscheck_safetensors.py" "$build/tests/test_base") ;;
    quality) command=("$here/quality.sh" "$build") ;;
    nir) command=(python3 "$here/crosscheck_nir.py" "$build/tests/test_nir") ;;
    *) command=("$build/tests/$name") ;;
  esac
  "${command[@]}" >"$logs/$name.log" 2>&1 </dev/null
  status=$?
  if [ $status -eq 0 ]; then
    verdict="ok$(sed -n 's/^\([a-z0-9]*\): not on this machine$/, without \1/p' "$logs/$name.log" | sort -u | tr -d '\n')"
  elif [ $status -eq 77 ] || { [[ $name == safetensors || $name == nir || $name == mutate ]] && ! command -v python3 >/dev/null; }; then
    verdict="skipped: $(tail -n 1 "$logs/$name.log")"
  else
    verdict="FAILED ($status), see $logs/$name.log"
  fi
  set -- $(($(date +%s) - start)) "$verdict"
  echo "$*" >"$logs/$name.result"
  echo "$(
    printf '  %-16s %4d s  %s' "$name" "$@"
    [ "${verdict%% *}" != FAILED ] || { echo && tail -n 20 "$logs/$name.log"; }
  )" # in one piece
}

rm -f "$logs"/*.result
for name in "$@"; do
  while [ "$(jobs -rp | wc -l)" -ge "${JOBS:-$(nproc)}" ]; do wait -n; done
  run "$name" &
done
wait

passed=0 failed=0 skipped=0
for name in "$@"; do
  read -r seconds verdict <"$logs/$name.result" || verdict=FAILED
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
