#!/bin/bash
# Programs as ranks of mpirun: whatever their number, what comes out is what one process gives, also when a rank is killed
# or all are interrupted and another number goes on. Ranks that are not alike are refused. (ranks_train.sh: sf_train.)
# usage: ranks.sh BUILD
. "$(dirname "$0")/../ranks_run.bash" "$@"

# ---- a program that is started by itself knows nothing of MPI ----
for program in sf_cosim sim_render energy_audit sf_train; do
  LD_DEBUG=files "$bin/$program" --version 2>&1 | grep -q 'libmpi' && fail "$program loads MPI without a launcher"
done

# ---- sf_cosim: totals, checkpoint, JUnit; the first difference and its evidence ----
cosim() { # NAME RANKS ARGS...: 0 ranks for no launcher
  local launch=()
  [ "$2" -eq 0 ] || launch=(job "$2")
  rm -f evidence*
  "${launch[@]}" "$build/faults/sf_cosim" scene.snn data --quiet --json --evidence evidence "${@:3}" >"$1.json" 2>"$1.err"
}
for ranks in 0 1 2 4; do
  cosim equal$ranks $ranks --rays 24 --block 5 --checkpoint equal$ranks.part --junit equal$ranks.xml ||
    fail "$ranks ranks: $(cat equal$ranks.err)"
  for file in equal$ranks.json equal$ranks.part equal$ranks.xml; do same $file ${file/equal$ranks/equal0} "$ranks ranks"; done
done
grep -q '"samples":[[:space:]]*[1-9]' equal4.json || fail "nothing was compared"
for ranks in 0 4; do
  cosim fault$ranks $ranks --rays 100 --block 2 --seed 11 --plusarg +fault=3 && fail "$ranks ranks: the planted fault is not seen"
  cp evidence.json fault$ranks.replay
done
same fault4.json fault0.json "planted fault"
same fault4.replay fault0.replay "planted fault"

# ---- sf_cosim: a rank is killed, all are interrupted; the same command goes on with another number ----
for how in "-KILL 2" "-KILL 0" "-INT job"; do
  read -r signal victim <<<"$how"
  rm -f part
  # From its request to end until it kills mpirun gives a second, which on a crowded machine may be too short to be told.
  [ "$victim" = job ] && export OMPI_MCA_odls_base_sigkill_timeout=3 || unset OMPI_MCA_odls_base_sigkill_timeout
  mpirun --oversubscribe -n 3 "$build/faults/sf_cosim" scene.snn data --rays 100000 --block 2 --quiet --json --checkpoint part >cut.json 2>cut.err &
  parent=$!
  await part
  [ "$victim" = job ] && pid=$parent || pid=$(pid_of "$victim" $parent)
  pids=$(ps -o pid= --ppid $parent) begun=$(date +%s)
  kill "$signal" "$pid"
  wait $parent && fail "$how: success"
  [ $(($(date +%s) - begun)) -le 10 ] || fail "$how: the job ended after $(($(date +%s) - begun)) s"
  for rank in $pids; do gone "$rank" || fail "$how: process $rank is still there"; done
  case $how in
    -KILL*) grep -q "process rank $victim .* exited on signal 9" cut.err || fail "$how: no line names the rank: $(cat cut.err)" ;;
    *) grep -q 'part holds [0-9]* rays, the same command goes on from there' cut.err || fail "$how: $(cat cut.err)" ;;
  esac
  cosim again 2 --rays 100000 --block 2 --checkpoint part --limit-samples 600 || fail "$how: going on: $(cat again.err)"
  [ -e whole.json ] || cosim whole 0 --rays 100000 --block 2 --limit-samples 600
  # A job that got further than the limit before the signal has to be compared with as much.
  done=$(sed -nE 's/.*"samples":[[:space:]]*([0-9]+),/\1/p' again.json | head -n 1)
  whole=$(sed -nE 's/.*"samples":[[:space:]]*([0-9]+),/\1/p' whole.json | head -n 1)
  [ "$done" = "$whole" ] || cosim whole 0 --rays 100000 --block 2 --limit-samples "$done"
  same again.json whole.json "$how: going on"
done

# ---- refused ----
mkdir other && cp "$bin/sf_cosim" other && printf x >>other/sf_cosim && cp scene.snn other
"$bin/sf_scene" simple -o other/data --size 32 --train 1 --test 3 >/dev/null
options=(scene.snn data --rays 20 -q)
refused 1 "has another program than rank 0" -n 1 "$bin/sf_cosim" "${options[@]}" : -n 1 other/sf_cosim "${options[@]}"
refused 1 "has another scene or data set than rank 0" -n 2 "$bin/sf_cosim" "${options[@]}" : -n 1 -wdir "$work/other" "$bin/sf_cosim" "${options[@]}"
grep -q '^sf_cosim: rank 2' refused.out || fail "the rank is not named: $(cat refused.out)"
refused 1 "has another command line than rank 0" -n 1 "$bin/sf_cosim" "${options[@]}" : -n 1 "$bin/sf_cosim" "${options[@]}" --seed 2
refused 2 "for a program that no launcher started" -n 2 "$bin/sf_cosim" "${options[@]}" --jobs 2
refused 2 "has to be given to ranks" -n 2 "$bin/sim_render" scene.snn data -o x.exr
[ "$(grep -c '^sim_render: ' refused.out)" -eq 1 ] || fail "each rank tells of a wrong command line: $(cat refused.out)"

# ---- sim_render: the set, its verdicts, a set that is mended ----
"$bin/sf_scene" simple -o views --size 12 --train 1 --test 10 >/dev/null
"$bin/sim_render" scene.snn views --all -o one -q >/dev/null || fail "sim_render --all"
job 4 "$bin/sim_render" scene.snn views --all -o four -q >/dev/null 2>render.err || fail "sim_render, 4 ranks: $(cat render.err)"
diff -r one four >diff.out || fail "4 ranks render another set: $(cat diff.out)"
mkdir cut
mpirun --oversubscribe -n 3 "$bin/sim_render" scene.snn views --all -o cut -q >/dev/null 2>cut.err &
parent=$!
await cut/manifest.json
pid=$(pid_of 1 $parent)
kill -KILL "$pid"
wait $parent
job 2 "$bin/sim_render" scene.snn views --all -o cut -q >/dev/null 2>render.err || fail "sim_render goes on: $(cat render.err)"
rm -f cut/.*.sf-* # of the rank that was killed
diff -r one cut >diff.out || fail "a set that was mended differs: $(cat diff.out)"
mkdir -p written # one rank cannot write
refused 1 "sim_render: rank 1 on " -n 1 "$bin/sim_render" "$work/scene.snn" "$work/views" --all -o written -q : \
  -n 1 -wdir "$work/other" "$bin/sim_render" "$work/scene.snn" "$work/views" --all -o written -q
grep -q 'cannot write written/view_' refused.out || fail "a rank cannot write: $(cat refused.out)"
cp one/view_0003.exr cut/view_0001.exr
"$bin/sim_render" scene.snn views --verify cut/manifest.json -q --json >verify0.json 2>/dev/null && fail "another picture is not seen"
job 4 "$bin/sim_render" scene.snn views --verify cut/manifest.json -q --json >verify4.json 2>/dev/null && fail "4 ranks do not see another picture"
same verify4.json verify0.json "verdicts"
grep -q 'view_0001.exr: plane' verify4.json || fail "the picture is not named"

# ---- energy_audit: report, CSV ----
"$bin/sf_scene" simple -o frame --size 110 --train 1 --test 1 >/dev/null
audit=(scene.snn frame --rtl-rays 1 --recount-rays 100 -q --json --csv audit.csv)
"$bin/energy_audit" "${audit[@]}" >audit0.json && mv audit.csv audit0.csv
job 4 "$bin/energy_audit" "${audit[@]}" >audit4.json 2>audit.err || fail "energy_audit: $(cat audit.err)"
same audit4.json audit0.json "audit"
same audit.csv audit0.csv "audit"

# ---- other CPUs: integers are equal ----
narrow=(-n 1 env SPIKEFIELD_CPU=portable)
job 1 "$bin/sim_render" scene.snn views --all -o mixed -q : "${narrow[@]}" "$bin/sim_render" scene.snn views --all -o mixed -q >/dev/null 2>render.err ||
  fail "sim_render on two CPUs: $(cat render.err)"
diff -r one mixed >diff.out || fail "two CPUs render another set: $(cat diff.out)"
cosim=("$build/faults/sf_cosim" scene.snn data --quiet --json --rays 24 --block 5)
job 1 "${cosim[@]}" : "${narrow[@]}" "${cosim[@]}" >mixed.json 2>mixed.err || fail "sf_cosim on two CPUs: $(cat mixed.err)"
same mixed.json equal0.json "two CPUs"
job 1 "$bin/energy_audit" "${audit[@]}" : "${narrow[@]}" "$bin/energy_audit" "${audit[@]}" >mixed.json 2>mixed.err ||
  fail "energy_audit on two CPUs: $(cat mixed.err)"
same mixed.json audit0.json "two CPUs"

# ---- a full disk on one rank ----
refused 1 "sim_render: rank 1 on " -n 1 "$bin/sim_render" scene.snn views --all -o tight -q : -n 1 bash -c "$(full 1)" "$bin/sim_render" scene.snn views --all -o tight -q
grep -q 'tight/view_[0-9]*.exr.*: File too large' refused.out || fail "a full disk: the file is not named: $(cat refused.out)"
job 2 "$bin/sim_render" scene.snn views --all -o tight -q >/dev/null 2>render.err || fail "after a full disk: $(cat render.err)"
diff -r one tight >diff.out || fail "after a full disk: another set: $(cat diff.out)"

finish "1, 2, 3, 4 ranks, killed, interrupted and continued: what one process gives"
