#!/bin/bash
# make reproduce: for every scene the runs of the paper's tables, their audits, and one report beside the paper.
# Finished runs are kept, an interrupted training goes on from its checkpoint, changed parameters start a run again. The same
# command may run any number of times at once, on many machines (docs/scale.md): each run is taken by one of them.
set -u
export LC_ALL=C
usage="usage: reproduce.sh BUILD [options]
  --profile NAME       quick (default); smoke (a procedural scene of its own, seconds); paper (10 000 + 30 000 iterations: every
                       scene with the backbones and budgets that the paper gives its kind, and the ablations, for days); scenes:
                       every scene with its backbones, twin and spiking, a time budget each
  --scenes FOLDER      a scene in the Blender layout, or a folder of scenes; profiles scenes and paper: any layout
  --only 'NAME...'     these scenes alone (quick: lego and mic, or the first two; paper, scenes: all)
  --seeds 'N...'       one run each, means and spreads in the tables (the seed of --seed)
  --seed-runs WHICH    runs of the further seeds: all, or learned (twin and budgets alone)
  --runs WHICH         all, paper (the paper's alone), or comparators (twin, beta = 5e-7, and what they are held against)
  --minutes M          scenes: training budget of a run (15)
  --backbones 'B...'   scenes, paper: ingp, tensorf or both (Blender: both, LLFF: tensorf, others: ingp)
  --betas 'B...'       scenes, paper: budgets of the spiking runs, of 5e-9, 5e-8, 1e-7, 5e-7 and 1e-6 (scenes: 5e-7)
  --probe N            paper: iterations that are timed before the first run of a kind (64; 0: none)
  --report             no runs: tables and plots of what is there
  --stage1 N, --stage2 N, --samples N, --steps T, --seed S, --downscale F    for sf_train, every run
  --train 'OPTIONS'    further options of sf_train, every run
  --eval-views N       held-out views for PSNR and SSIM (0 = all)
  --prefix-views N     held-out views for the PSNR after every step (0 = none)
  --prefix-runs WHICH  learned (the three betas and the ANN) or all
  --audit-views N      held-out frames for the fixed-point core and the energy audit, spread over the split
  --audit-downscale F  these frames of 1/F of the full size (0 = by the layout, as --downscale)
  --rtl-rays N         rays of every audit that the Verilog accelerator counts, too
  --convert-rays N     rays on which the twin is measured as integrate-and-fire neurons (0 = none)
  --cosim-rays N       rays of every scene through RTL and fixed-point core in lockstep
Results: BUILD/reproduce/PROFILE/{table.md,results.json,report.html,tables/,plots/}; runs in SCENE/RUN/ and SCENE/seed-N/RUN/."

die() { echo "reproduce: $1" >&2; exit "${2:-2}"; }
[ $# -ge 1 ] || die "missing argument BUILD (see reproduce.sh --help)"
if [ "$1" = --help ] || [ "$1" = -h ]; then echo "$usage"; exit 0; fi
build=$1
shift
bin=$build/bin

# ---- parameters ----

profile=quick
for ((i = 1; i <= $#; i++)); do
  if [ "${!i}" = --profile ]; then j=$((i + 1)); profile=${!j:-}; fi
done
declare -A set=([seed]=1 [steps]=8 [samples]=16384 [downscale]=0 [train]="" [rtl-rays]=4 [cosim-rays]=0 [minutes]=0 [probe]=0 [convert-rays]=0)
case $profile in
  quick)
    set+=([stage1]=400 [stage2]=1200 [eval-views]=8 [prefix-views]=1 [prefix-runs]=learned [audit-views]=1 [audit-downscale]=2)
    set+=([convert-rays]=500)
    ;;
  paper)
    set+=([stage1]=10000 [stage2]=30000 [eval-views]=0 [prefix-views]=16 [prefix-runs]=all [audit-views]=8 [audit-downscale]=0)
    set+=([samples]=0 [probe]=64 [convert-rays]=2000)
    ;;
  smoke)
    set+=([stage1]=30 [stage2]=40 [eval-views]=1 [prefix-views]=1 [prefix-runs]=all [audit-views]=1 [audit-downscale]=0)
    set+=([samples]=512 [rtl-rays]=0 [convert-rays]=20)
    set+=([train]="--levels 4 --log2-hash 10 --finest-res 32 --lattice 64 --occ-res 16 --hidden 32")
    ;;
  scenes)
    set+=([minutes]=15 [eval-views]=0 [prefix-views]=0 [prefix-runs]=learned [audit-views]=1 [audit-downscale]=0)
    set+=([samples]=0 [cosim-rays]=400)
    ;;
  *) die "--profile '$profile' is unknown: expected quick, paper, scenes or smoke" ;;
esac
scenes="" only="" report_only="" chosen="" betas="" seeds="" seed_runs=all which_runs=all
while [ $# -gt 0 ]; do
  name=${1#--}
  case $1 in
    --report) report_only=1; shift; continue ;;
    --help | -h) echo "$usage"; exit 0 ;;
  esac
  [ $# -ge 2 ] || die "$1 needs a value (see reproduce.sh --help)"
  case $1 in
    --profile) ;;
    --scenes) scenes=$2 ;;
    --only) only=$2 ;;
    --train) set[train]="${set[train]}${set[train]:+ }$2" ;;
    --minutes)
      [ "$profile" = scenes ] || die "$1 belongs to --profile scenes"
      [[ $2 =~ ^[0-9]{1,5}(\.[0-9]{1,3})?$ && ! $2 =~ ^[0.]*$ ]] || die "--minutes '$2' is not a number above 0"
      set[minutes]=$2 ;;
    --backbones | --betas)
      [[ $profile =~ ^(scenes|paper)$ ]] || die "$1 belongs to --profile scenes or paper"
      if [ "$1" = --betas ]; then
        [[ $2 =~ ^((5e-9|5e-8|1e-7|5e-7|1e-6)( |$))+$ ]] ||
          die "--betas '$2' is unknown: expected some of 5e-9, 5e-8, 1e-7, 5e-7, 1e-6"
        betas=$2
      else
        [[ $2 =~ ^((ingp|tensorf)( |$))+$ ]] || die "--backbones '$2' is unknown: expected ingp, tensorf or both"
        chosen=$2
      fi ;;
    --seeds)
      [[ $2 =~ ^([1-9][0-9]{0,8}( |$))*$ ]] || die "--seeds '$2' are not whole numbers from 1"
      seeds=$2 ;;
    --seed-runs)
      [[ $2 =~ ^(learned|all)$ ]] || die "--seed-runs '$2' is unknown: expected learned or all"
      seed_runs=$2 ;;
    --runs)
      [[ $2 =~ ^(all|paper|comparators)$ ]] || die "--runs '$2' is unknown: expected all, paper or comparators"
      [ "$profile" != scenes ] || die "$1 does not belong to --profile scenes"
      which_runs=$2 ;;
    --probe)
      [ "$profile" = paper ] || die "$1 belongs to --profile paper"
      [[ $2 =~ ^[0-9]{1,9}$ ]] || die "--probe '$2' is not a whole number"
      set[probe]=$((10#$2)) ;;
    --prefix-runs)
      [[ $2 =~ ^(learned|all)$ ]] || die "--prefix-runs '$2' is unknown: expected learned or all"
      set[$name]=$2 ;;
    --stage1 | --stage2)
      [ "$profile" != scenes ] || die "$1: profile scenes has a time budget (--minutes)"
      [[ $2 =~ ^[0-9]{1,9}$ ]] || die "$1 '$2' is not a whole number"
      set[$name]=$((10#$2)) ;;
    --samples | --steps | --seed | --downscale | --eval-views | --prefix-views | --audit-views | \
      --audit-downscale | --rtl-rays | --cosim-rays | --convert-rays)
      [[ $2 =~ ^[0-9]{1,9}$ ]] || die "$1 '$2' is not a whole number"
      set[$name]=$((10#$2)) ;;
    *) die "unknown option $1 (see reproduce.sh --help)" ;;
  esac
  shift 2
done
for name in audit-views steps; do [ "${set[$name]}" -ge 1 ] || die "--$name starts at 1"; done
[ "${set[steps]}" -le 8 ] || die "--steps ${set[steps]} is out of range: 1..8"
out=$build/reproduce/$profile
for program in sf_train sf_convert sf_export sim_render energy_audit sf_report sf_scene; do
  [ -x "$bin/$program" ] || die "$bin/$program is missing: run make first" 1
done

# shellcheck source=tools/reproduce_runs.sh
. "${BASH_SOURCE[0]%/*}/reproduce_runs.sh"
# shellcheck source=tools/reproduce_plan.sh
. "${BASH_SOURCE[0]%/*}/reproduce_plan.sh"
# shellcheck source=tools/deal.sh
. "${BASH_SOURCE[0]%/*}/deal.sh"

# ---- the report ----

report() {
  [ -d "$out" ] || die "$out: no runs yet (make reproduce PROFILE=$profile SCENES=folder)" 1
  rm -f "$out"/plots/*.gp "$out"/plots/*.svg "$out"/tables/*.csv
  "$bin/sf_report" "$out"
  local status=$?
  [ -e "$out/table.md" ] || return $status
  plots || status=1
  "$bin/sf_report" "$out" --page || status=1
  return $status
}

if [ -n "$report_only" ]; then
  report
  exit
fi

# ---- scenes ----

is_scene() {
  local mark
  for mark in transforms_train.json transforms.json poses_bounds.npy sparse colmap/sparse; do
    [ ! -e "$1/$mark" ] || return 0
  done
  return 1
}
# Profiles whose scenes have several backbones, and any layout.
by_layout() { [ "$profile" = scenes ] || [ "$profile" = paper ]; }
is_wanted() { if by_layout; then is_scene "$1"; else is_blender "$1"; fi; }
is_blender() { [ -e "$1/transforms_train.json" ] && [ -e "$1/transforms_test.json" ]; }
paths=()
mkdir -p "$out" || exit 1
child="" stop=""
smoke_data() {
  [ ! -e "$data/complete" ] || return 0
  rm -rf "$data"
  "$bin/sf_scene" textured -o "$data" --size 32 --train 10 --test 2 >/dev/null && touch "$data/complete"
}
if [ "$profile" = smoke ]; then
  data=$build/reproduce/smoke-data/textured
  mkdir -p "${data%/*}" && alone "${data%/*}/lock" smoke_data || exit 1
  paths=("$data")
else
  [ -n "$scenes" ] || die "--scenes FOLDER is missing (make reproduce SCENES=folder)"
  [ -d "$scenes" ] || die "$scenes: no such folder (make reproduce SCENES=folder)" 1
  scenes=$(cd "$scenes" && pwd -P) || exit 1
  if is_scene "$scenes"; then
    paths=("$scenes")
  else
    for folder in "$scenes"/*/; do is_wanted "${folder%/}" && paths+=("${folder%/}"); done
    if [ -z "$only" ] && [ "$profile" = quick ] && [ ${#paths[@]} -gt 2 ]; then
      if is_blender "$scenes/lego" && is_blender "$scenes/mic"; then only="lego mic"; else paths=("${paths[@]:0:2}"); fi
    fi
    if [ -n "$only" ]; then
      paths=()
      for name in $only; do
        while [[ $name == */ ]]; do name=${name%/}; done
        is_scene "$scenes/$name" || die "$scenes/$name: no scene there" 1
        paths+=("$scenes/$name")
      done
    fi
  fi
  [ ${#paths[@]} -gt 0 ] || die "$scenes: no scene $(by_layout || echo "with transforms_train.json and transforms_test.json ")there" 1
fi
declare -A path_of=() # a scene's results are in a folder of its name
for data in "${paths[@]}"; do
  name=${data##*/}
  [[ $name == [!.]* ]] || die "$data: the folder of a scene needs a name that begins without a dot" 1
  [ -z "${path_of[$name]:-}" ] || die "${path_of[$name]} and $data: two scenes named $name" 1
  path_of[$name]=$data
done

settings() { # the whole plan hangs on them
  local name
  echo "$version; ${paths[*]}; runs $which_runs; backbones $chosen; betas $betas; seeds $seeds $seed_runs"
  for name in "${!set[@]}"; do echo "$name ${set[$name]}"; done | sort
}
version=$("$bin/sf_train" --version)
join_others "$(settings)" || die "another run of profile $profile, with other parameters, is at work in $out" 1
trap on_signal INT TERM HUP

# ---- what is run ----

# What sf_data understands of the scene: its layout, its number of held-out views. Says at once what its runs will fail of.
look_at_data() {
  local json size wrong
  for size in downscale audit-downscale; do
    wrong=$("$bin/sf_data" "$data" --downscale "${set[$size]}" 2>&1 >/dev/null) && continue
    echo "reproduce: ${data##*/} will fail with --$size ${set[$size]}: ${wrong##*sf_data: }"
    break
  done
  json=$("$bin/sf_data" "$data" --json 2>/dev/null)
  layout=$(sed -nE 's/^[[:space:]]*"layout":[[:space:]]*"([a-z]+)".*/\1/p' <<<"$json" | head -n 1)
  frames=$(sed '1,/^[[:space:]]*"test":/d' <<<"$json" | grep -c '^[[:space:]]*"name":')
}

# ---- all runs of a unit ----

# Which held-out views are audited: spread evenly over the split.
choose_views() {
  local n i
  n=${set[audit-views]} views=
  [ "$frames" -ge 1 ] || frames=1
  [ "$n" -le "$frames" ] || n=$frames
  for ((i = 0; i < n; i++)); do views="$views${views:+ }$((i * frames / n))"; done
}

# The options that all runs of a unit share: before and behind a run's own.
prepare_unit() {
  data_id=$(cd "$data" && pwd -P && {
    cat transforms*.json poses_bounds.npy {,colmap/}sparse/{,0/}{cameras,images,points3D}.{bin,txt} 2>/dev/null
    find -L . -type f -regextype egrep -iregex '.*\.(png|jpe?g)' -printf '%p %s\n' | sort
  } | cksum)
  choose_views
  common="--steps ${set[steps]}"
  [ "${set[samples]}" -eq 0 ] || common="$common --samples ${set[samples]}"
  common="$common --downscale ${set[downscale]}${set[train]:+ ${set[train]}}"
  behind="--seed $seed"
  [ "$backbone" = - ] || behind="$behind --backbone $backbone"
  timed="$common"
  if [ "$profile" = scenes ]; then
    common="--minutes ${set[minutes]} $common"
  else
    common="--stage1 ${set[stage1]} --stage2 ${set[stage2]} --input-mode hybrid $common" # the paper's neuron
  fi
  common="$common --eval-views ${set[eval-views]}"
}

start_run() { # NAME
  local prefixes="--psnr-prefixes ${set[prefix-views]}" rest=
  [ "$profile" != scenes ] || prefixes=
  [ "${set[prefix-runs]}" = learned ] || rest=$prefixes
  t_r=$(number "$out/$scene/beta-5e-7/train.json" t_r)
  # shellcheck disable=SC2086
  case $1 in
    ann) one_run ann --net ann $prefixes ;;
    beta-*) one_run "$1" --beta "${1#beta-}" $prefixes ;;
    mode-*) one_run "$1" --beta 5e-7 --input-mode "${1#mode-}" --fixed-steps "${set[steps]}" $rest ;;
    no-*) one_run "$1" --beta 5e-7 "--$1" $rest ;;
    fixed-t-minus-1) fixed_run "$1" $((${t_r:-0} - 1)) $rest ;;
    fixed-t) fixed_run "$1" "${t_r:-0}" $rest ;;
    fixed-t-plus-1) fixed_run "$1" $((${t_r:-0} + 1)) $rest ;;
    along-ray) one_run along-ray --beta 5e-7 --steps-along-ray ;;
    sweep-*) sweep_run "$1" "${1#sweep-}" $rest ;;
  esac
}

# What a run needs of another: the twin's energy is of the samples of a spiking run, the first that there is in the order of
# the report; t_r is that of beta-5e-7; the sweep leaves out what the ablations have.
needs() { # NUMBER OF A RUN: the numbers
  local run=${run_name[$1]} scene=${unit_scene[run_unit[$1]]} other
  needed=
  case $run in
    ann)
      for other in beta-5e-7 beta-1e-7 beta-1e-6 beta-5e-8 beta-5e-9; do
        needed=${number_of[$scene/$other]:-}
        [ -z "$needed" ] || break
      done ;;
    fixed-*) needed=${number_of[$scene/beta-5e-7]:-} ;;
    sweep-*) for other in $swept_before; do needed="$needed ${number_of[$scene/$other]:-}"; done ;;
  esac
}
settled() { # NUMBER
  local file=$out/${unit_scene[run_unit[$1]]}/${run_name[$1]}/status text
  text=$(cat "$file" 2>/dev/null)
  [ "$text" = "done" ] || { [ -n "$text" ] && [ "$text" != "not finished" ] && since_we_began "$file"; }
}
ready() { # NUMBER
  local other
  needs "$1"
  for other in $needed; do
    [ -n "${seen[other]:-}" ] || { is_free "${lock_of[other]}" && settled "$other"; } || return
  done
}
# The twin can be trained before the run that its energy needs.
can_train_ahead() { # NUMBER
  local dir=$out/${unit_scene[run_unit[$1]]}/${run_name[$1]}
  [ "${run_name[$1]}" = ann ] && [ -z "${seen[$1]:-}" ] && [ -z "$stop" ] && [ ! -s "$dir/train.json" ] && ! settled "$1"
}
work_ahead() {
  local i
  for i in "${!run_name[@]}"; do
    can_train_ahead "$i" && claim "${lock_of[i]}" || continue
    if can_train_ahead "$i"; then # nobody was faster
      training_alone=1
      visit "$i"
      training_alone=
      [ -s "$dir/train.json" ] || seen[i]=1 # it failed
    fi
    release
    return 0
  done
  return 1
}
visit() { # NUMBER
  local unit=${run_unit[$1]}
  index=$1
  if [ "$unit" != "$prepared" ]; then
    data=${unit_data[unit]} frames=${unit_frames[unit]} scene=${unit_scene[unit]} backbone=${unit_backbone[unit]} seed=${unit_seed[unit]}
    names=${unit_runs[unit]}
    prepare_unit
    prepared=$unit
  fi
  start_run "${run_name[$1]}"
}

# Before the first run: how long a run of each kind will train.
probe_all() {
  local i key seconds=0
  for i in "${!unit_scene[@]}"; do
    key=${unit_scene[i]%%/*}
    [ -z "$stop" ] && [ -z "${probed[$key]:-}${finished[$key]:-}" ] && [ "${left[$key]:-0}" -gt 0 ] || continue
    data=${unit_data[i]} frames=${unit_frames[i]} scene=$key backbone=${unit_backbone[i]} seed=${unit_seed[i]}
    prepare_unit
    claim "$out/$key/.probe.lock" || continue # another process does
    probe
    release
  done
  [ -z "$stop" ] || return 0
  for key in "${!left[@]}"; do seconds=$((seconds + ${left[$key]} * ${probed[$key]:-0})); done
  [ $seconds -eq 0 ] || echo "reproduce: $total runs, about $(clock $seconds) of training"
}

started=$SECONDS index=0 failures=0 ticker_pid="" total=0 prepared="" training_alone=""
layouts=() frames_of=()
plan
[ "${set[probe]}" -eq 0 ] || probe_all
deal
if [ -n "$stop" ]; then
  echo "reproduce: stopped; nothing is lost: the same command goes on (make reproduce-report shows what is there)" >&2
  exit 130
fi
# Nor is a failure told here: a launcher would end the others.
if [ "$elsewhere" -gt 0 ]; then
  echo "reproduce: nothing is left for this process; others are at work on $elsewhere of $total runs, the last one makes the table"
  exit 0
fi
failures=0
for i in "${!run_name[@]}"; do
  [[ $(cat "$out/${unit_scene[run_unit[i]]}/${run_name[i]}/status" 2>/dev/null) != failed* ]] || failures=$((failures + 1))
done
alone "$out/report.lock" report || failures=$((failures + 1))
[ $failures -eq 0 ] || die "$failures of the steps above failed; the same command tries them again" 1
