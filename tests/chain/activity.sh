#!/bin/bash
# SAIF and VCD of a co-simulated run: what must hold of any run, what the harness knows of this one, and every bit of both
# files against each other, counted by a program of its own.   usage: activity.sh BUILD
. "$(dirname "$0")/../chain.bash" "$@"
export LC_ALL=C
learn m 32 --steps 3
# run OPTIONS...
program=$build/bin/sf_cosim scene=m
run() {
  "$program" "$work/$scene.snn" "$work/data" --rays 100 --quiet --json "$@" >"$work/out" 2>"$work/err"
}
number() { sed -nE "s/.*\"$1\":[[:space:]]*([0-9]+).*/\1/p" "$work/out"; }
# of NAME in FILE, top level: prints T1 TC
top() { sed -nE "s/^    \($1 \(T0 [0-9]+\) \(T1 ([0-9]+)\) \(TX [0-9]+\) \(TC ([0-9]+)\).*/\1 \2/p" "$2"; }

# The whole stream, 100 MHz: a cycle is 10000 ps.
run --stalls 0 --clock 100 --saif "$work/all.saif" || fail "a SAIF file of the stream"
cycles=$(number cycles) samples=$(number samples)
[ "${cycles:-0}" -gt 17000 ] || fail "${cycles:-no} cycles: one piece of the waveform alone"
[ "${samples:-0}" -gt 100 ] || fail "${samples:-no} samples"
duration=$(sed -nE 's/^\(DURATION ([0-9]+)\)$/\1/p' "$work/all.saif")
[ "$duration" = $((10000 * cycles)) ] || fail "duration $duration of $cycles cycles"
[ "$(top clk_i "$work/all.saif")" = "$((5000 * cycles)) $((2 * cycles - 1))" ] || fail "toggles of the clock"
[ "$(top rst_ni "$work/all.saif")" = "$duration 0" ] || fail "the reset"
# Each sample: two result beats; D2 and C3 a tap beat each, D1, C1 and C2 one for each of the 3 steps.
[ "$(top m_axis_tvalid_o "$work/all.saif" | cut -d' ' -f1)" = $((10000 * 2 * samples)) ] || fail "result beats"
[ "$(top tap_valid_o "$work/all.saif" | cut -d' ' -f1)" = $((10000 * 11 * samples)) ] || fail "tap beats"
awk -v d="$duration" '/\(T0 / { gsub(/[()]/, ""); bits++; if ($3 + $5 + $7 != d || $7 != 0) { print; exit 1 } }
  END { if (bits < 50000) { print bits " bits"; exit 1 } }' "$work/all.saif" >"$work/out" || fail "T0 + T1 + TX is not the duration"
[ "$(grep -c '(INSTANCE u_plif\|(INSTANCE u_core\|(INSTANCE u_csr' "$work/all.saif")" -ge 2 ] || fail "instances"

run --saif "$work/one.saif" --depth 1 || fail "--depth 1"
[ "$(grep -c '(INSTANCE' "$work/one.saif")" = 1 ] || fail "--depth 1 has more than one instance"

# A window of the stream with stalls, by both.
run --saif "$work/w.saif" --vcd "$work/w.vcd" --window 300,419 || fail "a window"
[ "$(number cycles)" = 120 ] || fail "a window of 120 cycles has $(number cycles)"
if command -v python3 >/dev/null; then
  python3 "$root/tests/vcd_activity.py" "$work/w.vcd" "$work/w.saif" >"$work/out" 2>&1 && cat "$work/out" || fail "VCD and SAIF differ"
  # One toggle more, of one bit: seen.
  sed -E '0,/\(TC [1-9][0-9]*\)/s//(TC 77777)/' "$work/w.saif" >"$work/wrong.saif"
  python3 "$root/tests/vcd_activity.py" "$work/w.vcd" "$work/wrong.saif" >"$work/out" 2>&1 && fail "a wrong SAIF file passes"
else
  echo "the VCD was not counted"; echo "python3: not installed"
fi
# Pieces of the waveform make no difference: the window cut in two adds up to it.
run --saif "$work/a.saif" --window 300,340 && run --saif "$work/b.saif" --window 341,419 || fail "half a window"
awk 'FNR == 1 { file++ } /\(T0 / { gsub(/[()]/, ""); if (file < 3) t[FNR] += $5; else if (t[FNR] != $5) { print; exit 1 } }' \
  "$work/a.saif" "$work/b.saif" "$work/w.saif" >"$work/out" || fail "two halves are not the whole"

# The block from rays to pixels, with either field, without stalls. Its memory gives a line in two beats.
"$build/bin/sf_train" "$work/data" -o "$work/vm.safetensors" --backbone tensorf --stage1 2 --stage2 2 --samples 256 --rays 64 \
  --voxels 16 --occ-res 16 --hidden 32 --quiet >/dev/null && "$build/bin/sf_export" "$work/vm.safetensors" -o "$work/vm.snn" --steps 3 >/dev/null ||
  fail "a scene with planes"
# of NET in INSTANCE, wherever it is: prints its cycles at 1
inside() { awk -v i="$2" -v n="($1" '$1 == "(INSTANCE" && $2 == i { on = 1 } on && $1 == n { print substr($5, 1, length($5) - 1) / 10000; exit }' "$work/rays.saif"; }
rays() { # SCENE RAYS TAP-BEATS NET INSTANCE: beats of a sample; the output of the field that rests
  scene=$1
  run --rays "$2" --stalls 0 --clock 100 --saif "$work/rays.saif" --top sf_ray_top || fail "$1: a SAIF file of rays"
  scene=m
  local beats=$3 samples misses cycles
  samples=$(number samples) misses=$(number misses) cycles=$(number cycles)
  [ "${samples:-0}" -gt 20 ] && [ "${misses:-0}" -gt 100 ] && [ "$(number lookups)" -gt "$misses" ] || fail "$1: ${samples:-no} samples, ${misses:-no} lines"
  [ "$(grep -c '^(INSTANCE' "$work/rays.saif")" = 1 ] && grep -q '^(INSTANCE sf_ray_top' "$work/rays.saif" || fail "$1: not of sf_ray_top"
  high() { # NET CYCLES
    [ "$(top "$1" "$work/rays.saif" | cut -d' ' -f1)" = $((10000 * $2)) ] || fail "$scene: $1 is not high in $2 cycles"
  }
  high m_axis_tvalid_o "$2"
  high m_axi_arvalid_o "$misses"
  high m_axi_rvalid_i $((2 * misses))
  high tap_valid_o $((beats * samples))
  [ "$(top clk_i "$work/rays.saif")" = "$((5000 * cycles)) $((2 * cycles - 1))" ] || fail "$1: toggles of the clock"
  [ "$(inside "$4" "$5")" = 0 ] || fail "$1: $4 of $5 is high in $(inside "$4" "$5") cycles"
}
rays m 12 11 line_valid_o u_planes
rays vm 1 7 m_axis_tvalid_o u_encoder
for instance in u_light u_reads u_mix u_basis u_waves u_activation u_composite u_csr u_track u_encoder u_cache u_core u_plif; do
  grep -q "^ *(INSTANCE $instance" "$work/rays.saif" || fail "no instance $instance"
done
run --rays 6 --saif "$work/rays.saif" --vcd "$work/rays.vcd" --window 300,379 --top sf_ray_top || fail "a window of rays"
[ "$(number cycles)" = 80 ] || fail "a window of 80 cycles has $(number cycles)"
if command -v python3 >/dev/null; then
  python3 "$root/tests/vcd_activity.py" "$work/rays.vcd" "$work/rays.saif" >"$work/out" 2>&1 || fail "VCD and SAIF of rays differ"
fi
rm -f "$work"/rays.*
# A planted fault, a miss counted too many: no file.
program=$build/faults/sf_cosim
run --rays 12 --saif "$work/rays.saif" --top sf_ray_top --plusarg +fault=13
[ $? -eq 1 ] && grep -q 'field lines missed: core [0-9]*, accelerator' "$work/err" && [ ! -e "$work/rays.saif" ] || fail "a wrong counter of the field"
program=$build/bin/sf_cosim

# No room, here for files of more than 2000 KiB: the file and the cause, of the waveform in between and of the file itself.
full() { # CAUSE OPTIONS...
  (ulimit -f 2000 && run "${@:2}") && fail "${*:2}: success without room"
  grep -qF "sf_cosim: cannot write $1: File too large" "$work/err" || fail "${*:2}: the cause is not told"
}
full "$work/full.saif.piece.fst" --saif "$work/full.saif"
full "$work/full.vcd" --vcd "$work/full.vcd" --window 0,799
[ -z "$(find "$work" -name 'full*')" ] || fail "left behind: $(ls "$work")"
# A disk that is full stops a write and keeps what fits: Verilator's writer then reads what is not there.
if unshare -rm true 2>/dev/null; then
  export -f run
  export work program scene
  for kib in 16 1500; do
    for file in saif vcd; do
      mkdir -p "$work/disk"
      unshare -rm bash -c "mount -t tmpfs -o size=${kib}k none '$work/disk' && run --$file '$work/disk/a.$file'; echo \$?; ls -A '$work/disk'" >"$work/status"
      [ "$(tail -n +1 "$work/status" | tr '\n' ' ')" = '1 ' ] && [ "$(grep -c "sf_cosim: cannot write $work/disk/.*No space left on device" "$work/err")" -eq 1 ] ||
        fail "--$file on a disk of $kib KiB: $(cat "$work/status" "$work/err")"
    done
  done
else
  echo "unshare: a full disk was not tried"
fi

# Refusals, and nothing left behind.
run --saif "$work/no.saif" --window 9,3 && fail "a window backwards"
run --window 1,2 && fail "a window of nothing"
run --saif "$work/no.saif" --window 9000000,9000001 && fail "a window behind the end"
grep -q 'but the stream has' "$work/err" || fail "a window behind the end is not explained"
[ ! -e "$work/no.saif" ] || fail "a file of a refused run"
[ -z "$(find "$work" -name '*.fst' -o -name '*.sf-*')" ] || fail "left behind: $(ls "$work")"
finish "SAIF and VCD agree"
