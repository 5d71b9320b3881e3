# shellcheck shell=bash disable=SC2034,SC2154
# Which runs `make reproduce` has: by scene, backbone and seed. Sourced by reproduce.sh, whose variables it reads.

# The backbones that the paper trains on data of this kind; profiles of one backbone: none is named.
backbones_of() {
  by_layout || { echo -; return; }
  case ${chosen:-$1} in
    blender) echo ingp tensorf ;;
    llff) echo tensorf ;;
    colmap | ingp) echo ingp ;;
    *) echo "${chosen:-ingp}" ;;
  esac
}

# The budgets of a backbone, the reference of ablations first.
betas_of() {
  if [ -n "$betas" ]; then
    echo "$betas"
  elif [ "$profile" = scenes ]; then
    echo 5e-7
  elif [ "$1" = tensorf ]; then
    echo 5e-7 5e-8 5e-9
  else
    echo 5e-7 1e-7 1e-6
  fi
}

ablations="mode-hybrid mode-decay mode-no-decay no-stage1 no-extra no-penalty no-budget fixed-t-minus-1 fixed-t fixed-t-plus-1"
# What PATA is held against: membranes along the ray; every number of steps trained alone, as a search by hand would.
comparators() {
  local t
  echo -n "along-ray"
  for ((t = 1; t <= set[steps]; t++)); do echo -n " sweep-$t"; done
}
swept_before="mode-hybrid fixed-t-minus-1 fixed-t fixed-t-plus-1" # runs of one number of steps
# BACKBONE LAYOUT SEED: names of runs.
runs_of() (
  # shellcheck disable=SC2046 # words
  set -- "$1" "$2" "$3" $(betas_of "$1")
  [ "$which_runs" != comparators ] || { echo "beta-5e-7 ann $(comparators)"; return; }
  echo -n "beta-$4 ann"
  for beta in "${@:5}"; do echo -n " beta-$beta"; done
  [ "$3" = "${set[seed]}" ] || [ "$seed_runs" = all ] || return 0
  [ "$profile" != scenes ] || return 0
  [ "$profile" != paper ] || [ "$1 $2" = "ingp blender" ] || return 0
  echo -n " $ablations"
  [ "$which_runs" = paper ] || echo -n " $(comparators)"
)

# One unit of the plan is a scene with a backbone and a seed.
unit_data=() unit_frames=() unit_scene=() unit_backbone=() unit_seed=() unit_runs=()
# All runs, each with its unit; by scene and run, which number it has.
run_name=() run_unit=()
declare -A number_of=()
# By scene and backbone: runs to do, finished ones, their seconds, seconds that a probe says of one.
declare -A left=() finished=() spent=() probed=()
plan_unit() { # BACKBONE LAYOUT SEED
  local scene=${data##*/} key run runs
  [ "$1" = - ] || scene=$scene-$1
  key=$scene
  [ "$3" = "${set[seed]}" ] || scene=$scene/seed-$3
  runs=$(runs_of "$@")
  unit_data+=("$data") unit_frames+=("$frames") unit_scene+=("$scene") unit_backbone+=("$1") unit_seed+=("$3")
  unit_runs+=("$runs")
  mkdir -p "$out/$scene" || exit 1
  [ "$1" = - ] || echo "$2 $1" >"$out/$key/kind" # for the report, where no run gets as far as to say it
  for run in $runs; do
    number_of[$scene/$run]=$total
    run_name+=("$run") run_unit+=($((${#unit_scene[@]} - 1))) lock_of+=("$out/$scene/.$run.lock")
    total=$((total + 1))
    if [ "$(cat "$out/$scene/$run/status" 2>/dev/null)" = "done" ]; then
      finished[$key]=$((${finished[$key]:-0} + 1))
      spent[$key]=$((${spent[$key]:-0} + $(cat "$out/$scene/$run/wall" 2>/dev/null || echo 0)))
    else
      left[$key]=$((${left[$key]:-0} + 1))
    fi
  done
}

# The first seed of every scene comes first.
plan() {
  local backbone seed i
  for i in "${!paths[@]}"; do
    data=${paths[i]}
    look_at_data
    layouts+=("$layout") frames_of+=("$frames")
  done
  for seed in ${seeds:-${set[seed]}}; do
    for i in "${!paths[@]}"; do
      data=${paths[i]} frames=${frames_of[i]}
      for backbone in $(backbones_of "${layouts[i]}"); do plan_unit "$backbone" "${layouts[i]}" "$seed"; done
    done
  done
}
