#!/bin/bash
# make pareto on a tiny model of its own: points against sim_render; a variant build; interrupted and continued equals
# uninterrupted; a point that fails; other parameters start again.   usage: pareto.sh BUILD
. "$(dirname "$0")/../tool_run.bash" pareto "$@"
export OPT=-O0 CFLAGS=-g0
# point LINE: a stand-in in build `part`, always the same program, runs LINE and goes on as sf_point.
point() {
  echo "$1" >"$work/line"
  rm "$work/part/bin/sf_point"
  printf '%s\n' '#!/bin/bash' ". '$work/line'" "exec '$programs/sf_point' \"\$@\"" >"$work/part/bin/sf_point"
  chmod +x "$work/part/bin/sf_point"
}
pareto() { run_tool "$@"; }
points() { echo "$work/$1/pareto/smoke/points"; }
number() { sed -nE "s/.*\"$2\":[[:space:]]*(-?[0-9.e+-]+).*/\1/p" "$1" | head -n 1; }
facts() { (cd "$(points "$1")" && grep -v '"samples_per_second"' ./*.json); }

build whole
echo "TRANS_FRAC=20" >"$work/whole/arch" # as it is without
pareto whole 0
[ "$(count '^\[.* dB, elapsed')" -eq 12 ] || fail "not 12 points"
sweep=$work/whole/pareto/smoke
[ "$(wc -l <"$sweep/points.csv")" -eq 13 ] || fail "points.csv has not 12 rows"
grep -q '^## Pareto front' "$sweep/table.md" || fail "no front in table.md"
grep -q 'not available' "$sweep/points.csv" || fail "the missing RTL cost is not named"
[ "$(number "$(points whole)/tiny-AC_FRAC=4.json" ac_frac)" = 4 ] || fail "the variant has no 4 fraction bits"
[ "$(number "$(points whole)/tiny.json" ac_frac)" = 8 ] || fail "the centre has no 8 fraction bits"
[ "$(cat "$work/whole/pareto/variant/TRANS_FRAC-20-AC_FRAC-4/arch")" = "TRANS_FRAC=20 AC_FRAC=4" ] || fail "the variant has lost the build's widths"
if command -v gnuplot >/dev/null; then
  for plot in widths front-energy front-bytes front-traffic; do
    grep -q '</svg>' "$sweep/plots/$plot.svg" || fail "$plot.svg is not whole"
  done
fi
[ "$(number "$(points whole)/tiny-H_SHIFT=1.json" h_shift)" = 1 ] || fail "the variant does not keep all bits of h but one"
echo "whole: 12 points"

# The same picture as sim_render makes of the exported scene.
data=$work/whole/pareto/smoke-data
for options in "" "--weight-bits 4 --grid-bits 5 --leak-bits 6 --feature-bits 9"; do
  # shellcheck disable=SC2086
  {
    "$programs/sf_export" "$data/tiny.safetensors" -o "$work/s.snn" $options >/dev/null
    "$programs/sf_point" "$data/tiny.safetensors" "$data" --view 1 --json $options >"$work/point.json"
  }
  "$programs/sim_render" "$work/s.snn" "$data" --view 1 -o "$work/s.exr" --json >"$work/fixed.json" 2>/dev/null
  ours=$(printf '%.9f' "$(number "$work/point.json" psnr_truth_db)") theirs=$(printf '%.9f' "$(number "$work/fixed.json" psnr)")
  [ "$ours" = "$theirs" ] || fail "'$options': PSNR $ours, sim_render $theirs"
  awk -v mj="$(number "$work/point.json" energy_mj)" -v fj="$(number "$work/fixed.json" energy_fj)" \
    'BEGIN { d = mj * 1e12 / fj - 1; exit !(d < 1e-12 && d > -1e-12) }' || fail "'$options': energy differs from sim_render"
  awk -v excess="$(number "$work/point.json" excess_squared_error)" -v psnr="$ours" -v loss="$(number "$work/point.json" loss_db)" \
    'BEGIN { d = excess - 10 ^ (-psnr / 10) + 10 ^ (-(psnr + loss) / 10); exit !(d < 1e-9 && d > -1e-9) }' || fail "'$options': excess squared error"
done
echo "points: as sim_render"

build part
point 'sleep 0.1'
setsid "$script" "$work/part" --profile smoke --variants none >"$work/out" 2>&1 &
pid=$!
for ((i = 0; i < 4000; i++)); do
  [ "$(find "$work/part/pareto/smoke/points" -name '*.json' 2>/dev/null | wc -l)" -ge 3 ] && break
  kill -0 "$pid" 2>/dev/null || fail "over before it was interrupted"
  sleep 0.01
done
# Again while it goes on: bash can lose a signal that comes while it expands a command substitution.
for ((i = 0; i < 20; i++)); do
  kill -TERM "$pid" 2>/dev/null || break
  sleep 0.3
done
wait "$pid"
[ $? -eq 130 ] || fail "SIGTERM: not exit status 130"
pid=
done_before=$(find "$(points part)" -name '*.json' | wc -l)
[ "$done_before" -lt 9 ] || fail "nothing was left to do"
[ -z "$(find "$(points part)" -name '*.part')" ] || fail "a part of a point was left"
pareto part 0 --variants none
[ "$(count 'finished before')" -eq "$done_before" ] || fail "finished points were repeated"
rm "$(points whole)"/tiny-AC_FRAC=4*.json "$(points whole)"/tiny-H_SHIFT=1*.json
diff <(facts whole) <(facts part) >"$work/difference" || { cat "$work/difference"; fail "an interrupted sweep differs"; }
echo "interrupted: the same points"

# shellcheck disable=SC2016
point 'case " $* " in *" --leak-bits 6 "*) echo "sf_point: planted failure" >&2; exit 1 ;; esac'
rm "$(points part)/tiny-leak-bits=6.json"
pareto part 1 --variants none
[ "$(count 'leak-bits=6 *FAILED: sf_point: planted failure')" -eq 1 ] || fail "the failure is not reported"
[ "$(count '^wrote ')" -ge 1 ] || fail "no report beside the failure"
point :
pareto part 0 --variants none
[ "$(count 'finished before')" -eq 8 ] || fail "the failed point was not repeated alone"
pareto part 0 --variants none --every 3
[ "$(count 'finished before')" -eq 0 ] || fail "points of other pixels were kept"
echo "#" >>"$work/part/bin/sf_point"
pareto part 0 --variants none --every 3
[ "$(count 'finished before')" -eq 0 ] || fail "points of another program were kept"
SLURM_STEP_NUM_TASKS=2 SLURM_PROCID=1 "$script" "$work/part" --profile smoke --variants none --every 5 >"$work/other" 2>&1 &
pareto part 0 --variants none --every 5
wait $! || { cat "$work/other"; fail "two at once: exit status of the other"; }
cat "$work/other" >>"$work/out"
[ "$(count '^\[.* PSNR .* dB, against')" -eq 9 ] || fail "two at once: not 9 points, each once"
[ "$(count '^wrote ')" -ge 1 ] || fail "two at once: no table"
pareto part 0 --report
[ "$(count '^## ')" -ge 5 ] || fail "--report prints no tables"
echo '{"name": "x"' >"$(points part)/tiny-steps=1.json"
pareto part 1 --report
[ "$(count 'tiny-steps=1.json')" -eq 1 ] || fail "the broken point is not named"
echo "failure: reported, repeated alone"

flock -s "$work/part/pareto/smoke/lock" "$script" "$work/part" --profile smoke >"$work/out" 2>&1 && fail "two at once"
[ "$(count 'another run of profile smoke, with other parameters,')" -eq 1 ] || fail "the other run is not named"
for bad in "--profile fast" "--every x" "--every 0" "--variants some" "--nosuch 1" "--view" "--model m"; do
  # shellcheck disable=SC2086
  pareto part 2 $bad
  [ "$(wc -l <"$work/out")" -eq 1 ] || fail "$bad: not one line"
done
pareto part 1 --model "$work/nowhere" --data "$work"
[ "$(count nowhere)" -eq 1 ] || fail "the missing model is not named"
# A TensoRF model: widths that it has, and words for planes.
"$programs/sf_train" "$data" -o "$work/planes.safetensors" --backbone tensorf --voxels 16 --rays 128 --samples 512 --stage1 100 --stage2 100 \
  --steps 2 --occ-res 16 --hidden 16 --eval-views 1 --quiet >/dev/null || fail "the TensoRF model was not trained"
build planes
echo "TRANS_FRAC=20" >"$work/planes/arch"
mkdir "$work/planes/pareto" && ln -s "$work/whole/pareto/variant" "$work/planes/pareto/" # built above
pareto planes 0 --model "$work/planes.safetensors" --data "$data"
sweep=$work/planes/pareto/smoke
[ "$(count '^\[.* dB, elapsed')" -eq 9 ] || fail "TensoRF: not 9 points"
[ "$(wc -l <"$sweep/points.csv")" -eq 10 ] || fail "TensoRF: points.csv has not 9 rows"
[ -z "$(find "$sweep/points" -name '*feature*' -o -name '*H_SHIFT*')" ] || fail "TensoRF: points of widths that it has not"
for line in '^## entries of planes and lines, bits' '^## weights and basis matrix, bits' '^- n: planes, points along the longest axis, [12]' \
  '(weights, entries of planes and lines, states)' '^| w4 g4 |'; do
  grep -q "$line" "$sweep/table.md" || fail "TensoRF: no '$line' in table.md"
done
grep -Eq 'hash|grid|inputs|current >>' "$sweep/table.md" && fail "TensoRF: words of a hash grid in table.md"
grep -Eq 'grid entries|inputs f|current >>' "$sweep"/plots/*.gp && fail "TensoRF: words of a hash grid in a plot"
grep -q "title 'entries of planes and lines, bits'" "$sweep/plots/widths.gp" || fail "TensoRF: planes have no line in widths.gp"
if command -v gnuplot >/dev/null; then
  for plot in widths front-energy front-bytes front-traffic; do
    grep -q '</svg>' "$sweep/plots/$plot.svg" || fail "TensoRF: $plot.svg is not whole"
  done
fi
cp "$work/whole/pareto/smoke/points/tiny.json" "$sweep/points/"
pareto planes 1 --report
[ "$(count 'fields of different kinds')" -eq 1 ] || fail "a hash grid in a sweep of planes"
"$programs/sf_point" "$work/planes.safetensors" "$data" --feature-bits 9 >"$work/out" 2>&1 && fail "TensoRF: --feature-bits is taken"
[ "$(count 'those of a TensoRF scene have 12')" -eq 1 ] || fail "TensoRF: --feature-bits: not said why"
echo "TensoRF: its own widths"

mkdir "$work/a" "$work/b"
cp "$data/tiny.safetensors" "$work/a/t.safetensors"
cp "$data/tiny.safetensors" "$work/b/t.safetensors"
pareto part 1 --variants none --model "$data/tiny.safetensors $work/a/t.safetensors $work/b/t.safetensors" --data "$data"
[ "$(count 'two points would be named t-steps=')" -eq 1 ] || fail "two models of one name"

# Makefile: a folder keeps its widths.
refused() { # ARCH
  make -s -C "$(dirname "$script")/.." B="$work/built" ARCH="$1" help >"$work/out" 2>&1 && fail "ARCH='$1' in a folder of other widths"
  [ "$(count 'need a folder of their own')" -eq 1 ] || fail "ARCH='$1': not refused"
}
mkdir -p "$work/built/obj"
refused AC_FRAC=4
echo AC_FRAC=4 >"$work/built/arch"
refused ""
# What has a name in arch.def but one value.
make -s -C "$(dirname "$script")/.." B="$work/narrow" ARCH="AC_FRAC=4 MEMBRANE_BITS=20" help >"$work/out" 2>&1 && fail "MEMBRANE_BITS=20 is taken"
[ "$(count "'MEMBRANE_BITS=20': MEMBRANE_BITS is no parameter")" -eq 1 ] || fail "MEMBRANE_BITS: not said why"
echo "parameters: ok"
