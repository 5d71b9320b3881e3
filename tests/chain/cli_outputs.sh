#!/bin/bash
# Outputs that cannot be written, full disks: exit status 1, one line, what was there before is still there.
# usage: cli_outputs.sh BUILD
. "$(dirname "$0")/../cli_run.bash" "$@"

: >plain
train=(d --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1 -q)
writers() { # PATTERN PATH
  data "$1" sf_export model.safetensors -o "$2"
  data "$1" sim_render s.snn d -o "$2"
  data "$1" sim_render s.snn d -o out --png "$2"
  data "$1" sim_render s.snn d -o "$2" --backend float
  data "$1" energy_audit s.snn d --rays 1 --rtl-rays 0 --csv "$2"
  data "$1" sf_train "${train[@]}" -o "$2"
  absent out "unwritable $2"
}
data nosuch energy_audit s.snn d --rays 1 --rtl-rays 0 --tech nosuch
data nosuch energy_audit s.snn d --rays 1000000000 --twin nosuch
data nosuch energy_audit s.snn d --rays 1000000000 --html out --model nosuch
data nosuch energy_audit --compare s.snn s.snn d --rays 1000000000 --tech-b nosuch
(mkdir -p here/model.safetensors && cd here && timeout 60 "$BIN/sf_train" --help) >stdout.txt 2>err
check "sf_train --help" "looks at outputs" [ -s stdout.txt ]
check "sf_train --help" "looks at outputs" [ ! -s err ]
data model.safetensors energy_audit s.snn d --rays 1 --rtl-rays 0 --twin model.safetensors
data nosuch.json energy_audit --compare nosuch.json nosuch.json
printf '{"views": 1}' >none.json
data none.json energy_audit --compare none.json none.json
timeout -k 5 60 "$BIN/sf_train" --help >/dev/full 2>err
status=$?
judge "--help, full disk" sf_train 1 "standard output"
usage --output sf_export model.safetensors -o model.safetensors
usage --nir sf_export s.snn --nir ./s.snn
usage --output sim_render s.snn d -o s.snn
usage --png sim_render s.snn d -o same.out --png same.out
usage --saif sf_cosim s.snn d --saif s.snn
usage --html energy_audit s.snn d --csv same.out --html same.out
usage --png sim_render s.snn d -o out --png d/test/r_0.png
usage --csv energy_audit s.snn d --csv d/transforms_test.json
usage --summary sf_train d -o out --summary ./d/transforms_train.json
usage --output sf_train d -o model.safetensors --fine-tune model.safetensors
data nodir/x sf_cosim s.snn d --junit nodir/x
data nodir/x sf_cosim s.snn d --evidence nodir/x
data nodir/x sf_train "${train[@]}" -o out --summary nodir/x
absent out "unwritable summary"
writers nodir/ nodir/x.out
writers plain plain/x.out
writers /proc /proc/spikefield.out
writers /dev/full /dev/full
mkdir -p folder.out
writers folder.out folder.out
data plain sf_export s.snn --vectors plain/kit --data d
data plain sf_scene simple -o plain --size 4 --train 1 --test 1
data plain sf_scene simple -o plain/deep/er --size 4 --train 1 --test 1
data /proc sf_scene simple -o /proc/spikefield --size 4 --train 1 --test 1
if [ "$(id -u)" -ne 0 ]; then
  mkdir locked && chmod 500 locked
  writers locked locked/x.out
  data locked sf_scene simple -o locked/x --size 4 --train 1 --test 1
fi

# A full disk: files of at most 1 KiB. An output that was there before stays as it was.
full() { # OUTPUT PROGRAM ARGS...
  rm -rf "$1"
  echo old >"$1"
  (ulimit -f 1; exec timeout -k 5 60 "$BIN/$2" "${@:3}" >stdout.txt 2>err </dev/null)
  status=$?
  judge "full disk: ${*:2}" "$2" 1 "$1"
  check "full disk: ${*:2}" "$1 was changed" [ "$(cat "$1")" = old ]
  rm -f "$1"
}
full full.out sf_export model.safetensors -o full.out
full full.out sim_render s.snn d -o full.out
full full.out sim_render s.snn d -o full.out --backend float
full full.out energy_audit s.snn d --rays 20 --rtl-rays 0 --json --csv full.out
# What was counted, compared or learned is told, though its file could not be written.
told() { # TEXT PROGRAM ARGS...
  { (ulimit -f 0; exec timeout -k 5 60 "$BIN/$2" "${@:3}" 2>/dev/null </dev/null); echo "status $?"; } | cat >stdout.txt
  if grep -qF -e "$1" stdout.txt && grep -qx "status 1" stdout.txt; then passed=$((passed + 1))
  else fail "full disk: ${*:2}" "nothing is reported, or no failure"; fi
}
told '"samples":' energy_audit s.snn d --rays 20 --rtl-rays 0 --json --csv full.out
told '"samples":' sf_cosim s.snn d --rays 3 --json --junit full.out
full full.out sf_train "${train[@]}" -o full.out --log log.out
# Checkpoints along the way may fail, the model may not: 3 of 4 iterations are followed by one.
(ulimit -f 1; exec timeout -k 5 60 "$BIN/sf_train" "${train[@]}" -o full.out --log log.out --checkpoint-minutes 0 >stdout.txt 2>err </dev/null)
status=$?
check "full disk" "not told once" [ "$(grep -c 'warning: cannot write full.out.*the run goes on' err)" -eq 1 ]
sed -i '/warning/d' err
judge "full disk: checkpoints" sf_train 1 full.out
# What a run's model replaces is kept until the run is finished: a finished model, also where a second run is interrupted.
kept=(d --stage1 2 --levels 2 --log2-hash 8 --threads 1 -q -o kept.out --log log.out)
timeout 60 "$BIN/sf_train" "${kept[@]}" --stage2 2 >stdout.txt 2>err && cp kept.out first.out
for again in 1 2; do
  timeout -s INT -k 60 3 "$BIN/sf_train" "${kept[@]}" --stage2 1000000 --seed 2 --checkpoint-minutes 0 >stdout.txt 2>err
  check "an interrupted run" "the finished model is lost (run $again)" cmp -s first.out kept.out.before
done
check "an interrupted run" "it does not say where the model is" grep -q 'kept.out; what was there is kept.out.before' <(
  rm kept.out.before && timeout -s INT -k 60 3 "$BIN/sf_train" "${kept[@]}" --stage2 1000000 --checkpoint-minutes 0 2>&1)
rm kept.out.before && timeout 60 "$BIN/sf_train" "${kept[@]}" --stage2 2 >stdout.txt 2>err
check "a finished run" "another model" cmp -s first.out kept.out
absent kept.out.before "a finished run"
# A log without room does not cost the model.
rm -f learned.out && timeout -k 5 60 "$BIN/sf_train" "${train[@]}" -o learned.out --log /dev/full >stdout.txt 2>err </dev/null
status=$?
judge "full disk: log" sf_train 1 "the model is saved: learned.out"
check "full disk: log" "no model" [ -s learned.out ]
(ulimit -f 1; exec timeout -k 5 60 "$BIN/sf_scene" simple -o fullscene --size 64 --train 1 --test 1 >stdout.txt 2>err </dev/null)
status=$?
judge "full disk: sf_scene" sf_scene 1 fullscene
absent fullscene/transforms_test.json "full disk: sf_scene"
for p in sf_export sim_render energy_audit sf_cosim sf_cycles; do
  rm -rf out
  case $p in sf_cosim) more="--rays 1" ;; energy_audit) more="--rays 1 --rtl-rays 1" ;; *) more= ;; esac
  timeout -k 5 60 "$BIN/$p" ${right[$p]} $more --json -q >/dev/full 2>err </dev/null
  status=$?
  judge "standard output on a full disk: $p" $p 1 output
done
rm -rf out

finish
