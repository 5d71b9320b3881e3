#!/bin/bash
# make pareto: one model at many widths, each a point: quality, energy, bytes, speed. Table, CSV and plots name the points
# that no other beats. Finished points are kept; other parameters start again. The same command may run any number of times at
# once, on many machines (docs/scale.md): each point is taken by one of them.
set -u
export LC_ALL=C
usage="usage: pareto.sh BUILD [options]
  --profile NAME    quick (default), full (more pixels, more of the grid), smoke (a tiny model of its own, seconds)
  --model 'FILE...' trained models; the first is swept, the others (other table sizes: sf_train --log2-hash; of TensoRF
                    other planes: --voxels) are points at the widest widths. Default: the demo's, made when it is missing
  --data FOLDER     its scene in the Blender layout; default: the demo's
  --view K          held-out view (default 0)
  --every N         every Nth pixel of it along both axes (quick 4, full 2)
  --variants WHICH  builds of other widths of arch.def: all (default) or none
  --report          no points: table and plots of what is there
Results: BUILD/pareto/PROFILE/{table.md,points.csv,plots/}; points in points/ beside them."
die() { echo "pareto: $1" >&2; exit "${2:-2}"; }
[ $# -ge 1 ] || die "missing argument BUILD (see pareto.sh --help)"
if [ "$1" = --help ] || [ "$1" = -h ]; then echo "$usage"; exit 0; fi
build=$1
shift
bin=$build/bin
tools=$(cd "${BASH_SOURCE[0]%/*}" && pwd)

# ---- parameters ----

profile=quick model="" data="" view=0 every="" with_variants=all report_only=""
while [ $# -gt 0 ]; do
  case $1 in
    --report) report_only=1; shift; continue ;;
    --help | -h) echo "$usage"; exit 0 ;;
  esac
  [ $# -ge 2 ] || die "$1 needs a value (see pareto.sh --help)"
  case $1 in
    --profile) profile=$2 ;;
    --model) model=$2 ;;
    --data) data=$2 ;;
    --view | --every)
      [[ $2 =~ ^[0-9]{1,6}$ ]] || die "$1 '$2' is not a whole number"
      if [ "$1" = --view ]; then view=$((10#$2)); else every=$((10#$2)); fi ;;
    --variants)
      [[ $2 =~ ^(all|none)$ ]] || die "--variants '$2' is unknown: expected all or none"
      with_variants=$2 ;;
    *) die "unknown option $1 (see pareto.sh --help)" ;;
  esac
  shift 2
done
# One parameter at a time (the widest value is the centre), then the grid of those that matter most.
weights="7 6 5 4 3" features="11 10 9 8" grids="7 6 5 4 3" leaks="10 8 6 4"
variants="AC_FRAC=6 AC_FRAC=4 AC_FRAC=2 AC_FRAC=0 TRANS_FRAC=18 TRANS_FRAC=16 H_SHIFT=1"
low_weights="6 5 4" # narrow weights make small sums: h need not lose 3 bits
case $profile in
  quick) grid_weights="8 6 5 4" grid_grids="8 6 5 4" near=1 default_every=4 ;;
  full) grid_weights="8 7 6 5 4" grid_grids="8 7 6 5 4" near=8 default_every=2 ;;
  smoke)
    weights="4" features="9" grids="4" leaks="6" variants="AC_FRAC=4 H_SHIFT=1" low_weights=
    grid_weights="8 4" grid_grids="8 4" near=0 default_every=2 ;;
  *) die "--profile '$profile' is unknown: expected quick, full or smoke" ;;
esac
every=${every:-$default_every}
[ "$every" -ge 1 ] || die "--every starts at 1"
[ -z "$model" ] || [ -n "$data" ] || die "--model needs --data FOLDER (make pareto MODEL=file DATA=folder)"
[ -z "$data" ] || [ -n "$model" ] || die "--data needs --model FILE (make pareto MODEL=file DATA=folder)"
for program in sf_point sf_pareto sf_train sf_scene; do
  [ -x "$bin/$program" ] || die "$bin/$program is missing: run make first" 1
done
out=$build/pareto/$profile
# shellcheck disable=SC2034 # read by reproduce_runs.sh; dir is where the log goes
dir=$out child="" stop=""
arch=$(cat "$build/arch" 2>/dev/null) # widths that the build has already
# shellcheck source=tools/reproduce_runs.sh
. "$tools/reproduce_runs.sh"
# shellcheck source=tools/deal.sh
. "$tools/deal.sh"

report() {
  [ -e "$out/centre" ] || die "$out: no points yet (make pareto PROFILE=$profile)" 1
  rm -f "$out"/plots/*.gp "$out"/plots/*.svg
  "$bin/sf_pareto" "$out" && plots
}

if [ -n "$report_only" ]; then
  report
  exit
fi

# ---- the model ----

mkdir -p "$out/points" || exit 1
trap on_signal INT TERM HUP

smoke_model() {
  [ ! -e "$data/complete" ] || return 0
  rm -rf "$data"
  "$bin/sf_scene" textured -o "$data" --size 32 --train 10 --test 2 >/dev/null &&
    "$bin/sf_train" "$data" -o "$model" --stage1 30 --stage2 60 --samples 512 --levels 4 --log2-hash 10 \
      --finest-res 32 --lattice 64 --occ-res 16 --hidden 32 --steps 3 --quiet >/dev/null && touch "$data/complete"
}
demo_model() {
  [ ! -s "$model" ] || return 0
  echo "pareto: $model is missing; making it (make demo)"
  run "$tools/demo.sh" "$build"
}
if [ -z "$model" ]; then
  if [ "$profile" = smoke ]; then
    data=$build/pareto/smoke-data model=$build/pareto/smoke-data/tiny.safetensors
    alone "$build/pareto/smoke.lock" smoke_model || die "the tiny model could not be made" 1
  else
    model=$build/demo/model.safetensors
    [ -n "$data" ] || data=$build/demo/scene
    alone "$build/pareto/demo.lock" demo_model || die "make demo failed" 1
  fi
fi
[ -d "$data" ] || die "$data: no such folder" 1
read -ra models <<<"$model"
for file in "${models[@]}"; do [ -s "$file" ] || die "$file: no such model" 1; done

# ---- points ----

name_of() { # FILE VARIANT OPTIONS...: the file name of a point
  local file=${1##*/} variant=$2
  shift 2
  local options=$*
  options=${options// --/-} options=${options#--}
  echo "${file%.safetensors}${variant:+-$variant}${options:+-${options// /=}}"
}

# The program of a variant, built when it is missing; its log is BUILD/pareto/variant/NAME.log.
variant_program() {
  local folder widths="${arch:+$arch }$1"
  [ -n "$1" ] || { program=$bin/sf_point; return 0; }
  folder=${widths//=/-}
  folder=$(cd "$build" && pwd)/pareto/variant/${folder// /-}
  program=$folder/bin/sf_point
  mkdir -p "${folder%/*}" && alone "$folder.lock" run env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -C "$tools/.." B="$folder" ARCH="$widths" "$program" \
    >"$folder.log" 2>&1 && return
  { grep -m 1 -i 'error:' "$folder.log" || last_line "$folder.log"; } >>"$out/log"
  return 1
}

line() ( # WHAT
  left=0
  [ $fresh -eq 0 ] || left=$(((SECONDS - started) * (total - index) / fresh))
  printf '[%*d/%d] %-44s %s, elapsed %s, ETA %s\n' ${#total} $index "$total" "$name" "$1" "$(clock $((SECONDS - started)))" \
    "$(clock $left)"
)

point() { # FILE VARIANT OPTIONS...
  local file=$1 variant=$2 program
  [ -z "$stop" ] || return 0
  name=$(name_of "$@") index=$((index + 1))
  shift 2
  if [ -s "$out/points/$name.json" ]; then
    if since_we_began "$out/points/$name.json"; then line "finished elsewhere"; else line "finished before"; fi
    return
  fi
  rm -f "$out/points/$name.failed"
  fresh=$((fresh + 1))
  if variant_program "$variant" &&
    output "$out/points/$name.json" "$program" "$file" "$data" --view "$view" --every "$every" --json "$@"; then
    line "PSNR $(printf '%.2f dB, against float %.2f dB' "$(number "$out/points/$name.json" psnr_truth_db)" \
      "$(number "$out/points/$name.json" psnr_float_db)")"
  elif [ -z "$stop" ]; then
    failures=$((failures + 1))
    touch "$out/points/$name.failed"
    line "FAILED: $(last_line "$out/log")"
  fi
}

settings() (
  echo "models: $(cksum "${models[@]}"); data: $(cd "$data" && pwd -P) $(cat "$data"/transforms*.json | cksum)
view $view, every $every, $("$bin/sf_point" --version) $(cksum <"$bin/sf_point")${arch:+, $arch}"
)
drop_points() { rm -f "$out"/points/* "$out/log"; }
join_others "$(settings)" drop_points || die "another run of profile $profile, with other parameters, is at work in $out" 1
started=$SECONDS index=0 fresh=0 failures=0 total=1
first=${models[0]}
alone "$out/centre.lock" point "$first" ""
[ -z "$stop" ] || exit 130
[ $failures -eq 0 ] || exit 1
echo "$name" >"$out/centre"
t_r=$(number "$out/points/$name.json" t)
steps_max=$(number "$out/points/$name.json" T)
# Widths that a decoder does not have: its inputs have one, and there is no h.
if grep -q '"backbone":[[:space:]]*"tensorf"' "$out/points/$name.json"; then
  features="" variants=${variants/ H_SHIFT=1/}
fi

plan=()
add() { plan+=("$*"); } # FILE|VARIANT|OPTIONS
# Only what differs from the centre is an option, so that a point has one name.
add_grid() {
  local w g t
  for w in $grid_weights; do
    for g in $grid_grids; do
      for ((t = t_r - near; t <= t_r + near; t++)); do
        if [ "$t" -lt 1 ] || [ "$t" -gt "$steps_max" ]; then continue; fi
        local options=()
        [ "$w" = 8 ] || options+=(--weight-bits "$w")
        [ "$g" = 8 ] || options+=(--grid-bits "$g")
        [ $t = "$t_r" ] || options+=(--steps "$t")
        [ ${#options[@]} -eq 0 ] || add "$first||${options[*]}"
      done
    done
  done
}
for bits in $weights; do add "$first||--weight-bits $bits"; done
for bits in $features; do add "$first||--feature-bits $bits"; done
for bits in $grids; do add "$first||--grid-bits $bits"; done
for bits in $leaks; do add "$first||--leak-bits $bits"; done
# What rounds a state at every step is tried over the longest unrolling, too.
for bits in $leaks; do add "$first||--leak-bits $bits --steps $steps_max"; done
for ((t = 1; t <= steps_max; t++)); do [ $t -eq "$t_r" ] || add "$first||--steps $t"; done
for file in "${models[@]:1}"; do add "$file||--steps $t_r"; done
add_grid
if [ "$with_variants" = all ]; then
  for variant in $variants; do
    add "$first|$variant|"
    [[ $variant != AC_FRAC=* ]] || add "$first|$variant|--steps $steps_max"
    [ "$variant" != H_SHIFT=1 ] || for bits in $low_weights; do add "$first|$variant|--weight-bits $bits"; done
  done
fi
mapfile -t plan < <(printf '%s\n' "${plan[@]}" | awk '!seen[$0]++')
twice=$(
  for entry in "${plan[@]}"; do
    IFS='|' read -r file variant options <<<"$entry"
    # shellcheck disable=SC2086
    name_of "$file" "$variant" $options
  done | sort | uniq -d | head -n 1
)
[ -z "$twice" ] || die "--model: two points would be named $twice; give the models other file names" 1
total=$((1 + ${#plan[@]}))
declare -a plan_name=()
for entry in "${plan[@]}"; do
  IFS='|' read -r file variant options <<<"$entry"
  # shellcheck disable=SC2086
  plan_name+=("$(name_of "$file" "$variant" $options)")
  lock_of+=("$out/points/.${plan_name[-1]}.lock")
done
ready() { true; }
settled() { [ -s "$out/points/${plan_name[$1]}.json" ] || since_we_began "$out/points/${plan_name[$1]}.failed"; }
visit() { # NUMBER
  local file variant options
  IFS='|' read -r file variant options <<<"${plan[$1]}"
  index=$(($1 + 1))
  # shellcheck disable=SC2086
  point "$file" "$variant" $options
}
deal
if [ -n "$stop" ]; then
  echo "pareto: stopped; nothing is lost: the same command goes on (pareto.sh $build --report shows what is there)" >&2
  exit 130
fi
if [ "$elsewhere" -gt 0 ]; then
  echo "pareto: nothing is left for this process; others are at work on $elsewhere of $total points, the last one makes the table"
  exit 0
fi
failures=0
for name in "${plan_name[@]}"; do [ -s "$out/points/$name.json" ] || failures=$((failures + 1)); done
alone "$out/report.lock" report || failures=$((failures + 1))
[ $failures -eq 0 ] || die "$failures of the steps above failed; the same command tries them again" 1
