# shellcheck shell=bash disable=SC2154
# One run of `make reproduce`: training, export, renderings, audits, and what is printed about it. Sourced by
# reproduce.sh, whose variables it reads: set[], bin, out, data, data_id, scene, views, common, behind, timed, version, total, left[],
# finished[], spent[], probed[]; and by pareto.sh for run, output, keep, number, clock and plots.

# ---- one program at a time, stopped by SIGINT, SIGTERM or SIGHUP ----
# A trap that is pending when bash expands a command substitution breaks its parser. So this shell expands at most one in
# a command (the trap runs between commands); functions that need more have a body in parentheses.

on_signal() {
  stop=1
  [ -n "$child" ] && kill -TERM "$child" 2>/dev/null
}

# run COMMAND...: in a session of its own, so that a Ctrl-C reaches it once, through us. Inherits the lock.
run() {
  local code
  [ -z "$stop" ] || return 130
  setsid "$@" </dev/null &
  child=$!
  [ -z "$stop" ] || kill -TERM "$child" 2>/dev/null # a signal before the assignment
  wait "$child"
  code=$?
  while kill -0 "$child" 2>/dev/null; do # a signal interrupted wait, not the child
    wait "$child"
    code=$?
  done
  child=
  [ -z "$stop" ] || return 130
  return $code
}

# Draws the scripts of $out/plots.
plots() {
  local script failed=0
  if ! command -v gnuplot >/dev/null; then
    echo "no plots: gnuplot is missing (Debian package gnuplot-nox); the scripts are in $out/plots"
    return 0
  fi
  for script in "$out"/plots/*.gp; do
    [ -e "$script" ] || continue
    (cd "$out/plots" && gnuplot "${script##*/}") >"$out/plots/gnuplot.log" 2>&1 && continue
    echo "$script: $(tail -n 1 "$out/plots/gnuplot.log")" >&2
    failed=1
  done
  rm -f "$out/plots/gnuplot.log"
  [ $failed -eq 0 ] && echo "plots: $out/plots/*.svg"
  return $failed
}

# ---- progress ----

clock() { printf '%d:%02d:%02d' $(($1 / 3600)) $(($1 / 60 % 60)) $(($1 % 60)); }

# Seconds of a run of a scene with a backbone ($1): the mean of those that are finished, in this call or before; the probe's; the
# mean of all; the time budget; in the very first run from its iterations ($2).
run_seconds() (
  runs=0 seconds=0
  for key in "${!finished[@]}"; do runs=$((runs + ${finished[$key]})) seconds=$((seconds + ${spent[$key]})); done
  if [ "${finished[$1]:-0}" -gt 0 ]; then
    echo $((${spent[$1]} / ${finished[$1]}))
  elif [ -n "${probed[$1]:-}" ]; then
    echo "${probed[$1]}"
  elif [ $runs -gt 0 ]; then
    echo $((seconds / runs))
  elif [ "$profile" = scenes ]; then
    minutes=${set[minutes]%.*}
    echo $((60 * ${minutes:-0} + 30))
  elif [ "${2:-0}" -gt 0 ]; then
    echo $(((SECONDS - run_started) * (set[stage1] + set[stage2]) / $2))
  fi
)

eta() (
  seconds=$((run_started - SECONDS))
  for key in "${!left[@]}"; do
    [ "${left[$key]}" -gt 0 ] || continue
    one=$(run_seconds "$key" "${1:-}")
    [ -n "$one" ] || { echo "ETA -"; return; }
    seconds=$((seconds + ${left[$key]} * one))
  done
  echo "ETA $(clock $((seconds > 0 ? seconds : 0)))"
)
# WHAT [ITERATION]
say() (
  printf '[%*d/%d] %-28s %s, elapsed %s, %s\n' ${#total} "$index" "$total" "$scene $name" "$1" "$(clock $((SECONDS - started)))" "$(eta "${2:-}")"
)

# On a terminal the line of a run moves.
ticker() {
  local iteration what
  trap - INT TERM HUP
  while sleep 1; do
    iteration=$(tail -n 1 "$dir/train.jsonl" 2>/dev/null | sed -nE 's/^\{"iteration":([0-9]+).*/\1/p')
    what="iteration ${iteration:-0}"
    [ "$profile" = scenes ] || what="$what of $((set[stage1] + set[stage2]))"
    [ -e "$dir/train.json" ] && what="rendering and counting"
    printf '\r\033[K%s' "$(say "$what" "$iteration")" >&2
  done
}
start_ticker() {
  ticker_pid=
  [ -t 2 ] || return 0
  ticker 7>&- 8>&- 9>&- &
  ticker_pid=$!
}
stop_ticker() {
  [ -n "$ticker_pid" ] || return 0
  kill "$ticker_pid" 2>/dev/null
  wait "$ticker_pid" 2>/dev/null
  printf '\r\033[K' >&2
  ticker_pid=
}
# ---- one run ----

last_line() { grep -v '^[[:space:]]*$' "$1" 2>/dev/null | tail -n 1 | cut -c -300; }

# output FILE COMMAND...: standard output to FILE unless it is there already; FILE is whole or absent.
output() {
  local file=$1 code
  shift
  [ -s "$file" ] && return 0
  run "$@" >"$file.part" 2>>"$dir/log"
  code=$?
  if [ $code -eq 0 ]; then mv "$file.part" "$file"; else rm -f "$file.part"; fi
  return $code
}

train() {
  local code resume=()
  [ -s "$dir/train.json" ] && return 0
  [ -s "$dir/model.safetensors" ] && resume=(--resume)
  # shellcheck disable=SC2086
  run "$bin/sf_train" "$data" $train_options --quiet -o "$dir/model.safetensors" --log "$dir/train.jsonl" \
    --summary "$dir/train.json" "${resume[@]}" >>"$dir/log" 2>&1
  code=$?
  if [ $code -eq 1 ] && [ ${#resume[@]} -gt 0 ] && last_line "$dir/log" | grep -q 'cannot resume'; then
    # Killed between the last checkpoint and the summary: there is only the finished model, without optimiser.
    rm -f "$dir/model.safetensors" "$dir/train.jsonl"
    # shellcheck disable=SC2086
    run "$bin/sf_train" "$data" $train_options --quiet -o "$dir/model.safetensors" --log "$dir/train.jsonl" \
      --summary "$dir/train.json" >>"$dir/log" 2>&1
    code=$?
  fi
  return $code
}

# Times iterations of the scene with its backbone, all time steps unrolled; the log is kept, so that a call that goes on has it.
probe() {
  local log=$out/$scene/probe.jsonl rate
  mkdir -p "$out/$scene" || return
  if ! keep "$out/$scene/probe.cmd" "sf_train DATA $timed $behind; ${set[probe]}; $data_id"; then rm -f "$log"; fi
  if [ ! -s "$log" ]; then
    # shellcheck disable=SC2086
    run "$bin/sf_train" "$data" $timed --stage1 $((set[probe] / 4)) --stage2 $((set[probe] - set[probe] / 4)) --no-scaling --eval-views 1 \
      --beta 5e-7 $behind --quiet -o "$out/$scene/probe.safetensors" --log "$log.part" >"$out/$scene/probe.log" 2>&1 &&
      mv "$log.part" "$log"
    rm -f "$out/$scene"/probe.safetensors "$log.part"
  fi
  rate=$(sed -nE 's/^\{"iteration":([0-9]+),.*"seconds":([0-9.]+),.*/\1 \2/p' "$log" 2>/dev/null |
    awk 'NR == 1 { n = $1; s = $2 } END { if ($1 > n) printf "%.4f", ($2 - s) / ($1 - n) }')
  [ -n "$rate" ] || return 0
  probed[$scene]=$(awk -v r="$rate" -v n=$((set[stage1] + set[stage2])) 'BEGIN { printf "%d", r * n + 1 }')
  echo "$scene: $rate s an iteration, as a probe of ${set[probe]} says: about $(clock "${probed[$scene]}") of training a run"
}

render() { # FILE SCENE VIEW ARGUMENTS...
  local file=$1 snn=$2 view=$3
  shift 3
  output "$file" "$bin/sim_render" "$snn" "$data" --view "$view" --downscale "${set[audit-downscale]}" --json --quiet \
    -o "$dir/frame.exr" "$@"
  local code=$?
  rm -f "$dir/frame.exr"
  return $code
}

audit() { # FILE SCENE VIEW
  output "$1" "$bin/energy_audit" "$2" "$data" --view "$3" --downscale "${set[audit-downscale]}" --seed "${set[seed]}" \
    --rtl-rays "${set[rtl-rays]}" --json --quiet
}

evaluate_ann() {
  local view reference="" beta
  for beta in 5e-9 5e-8 1e-6 1e-7 5e-7; do # the last one counts; src/report/load.c takes the same
    [ -s "$out/$scene/beta-$beta/scene.snn" ] && reference=$out/$scene/beta-$beta/scene.snn
  done
  if [ -z "$reference" ]; then
    echo "its energy needs the fixed-point scene of a spiking run, which failed" >>"$dir/log"
    return 1
  fi
  for view in $views; do
    render "$dir/float-$view.json" "$reference" "$view" --backend float --model "$dir/model.safetensors" --steps 1 \
      --png "$dir/frame-$view.png" --truth "$dir/truth-$view.png" || return
  done
  [ "${set[convert-rays]}" -gt 0 ] || return 0
  output "$dir/convert.json" "$bin/sf_convert" "$dir/model.safetensors" "$data" --rays "${set[convert-rays]}" --seed "${set[seed]}" \
    --downscale "${set[downscale]}" --json
}

evaluate_snn() {
  local view t steps
  output "$dir/export.json" "$bin/sf_export" "$dir/model.safetensors" -o "$dir/scene.snn" --json || return
  for view in $views; do
    render "$dir/fixed-$view.json" "$dir/scene.snn" "$view" --backend fixed --png "$dir/frame-$view.png" || return
    render "$dir/float-$view.json" "$dir/scene.snn" "$view" --backend float --model "$dir/model.safetensors" \
      --truth "$dir/truth-$view.png" || return
    audit "$dir/audit-$view.json" "$dir/scene.snn" "$view" || return
  done
  if [ "${set[cosim-rays]}" -gt 0 ]; then
    output "$dir/cosim.json" "$bin/sf_cosim" "$dir/scene.snn" "$data" --rays "${set[cosim-rays]}" --seed "${set[seed]}" \
      --evidence "$dir/cosim-difference" --json --quiet || return
  fi
  [ "$profile" != scenes ] && [ "$name" = beta-5e-7 ] && [[ $scene != */* ]] || return 0 # prefixes: for the plots
  rm -f "$dir"/prefix-*.part "$dir/prefix.snn" # of a run that was stopped: the scene may be of other steps
  for ((t = 1; t <= set[steps]; t++)); do
    for view in $views; do
      [ -s "$dir/prefix-$t-$view.json" ] && continue
      output "$dir/prefix-$t.part" "$bin/sf_export" "$dir/model.safetensors" -o "$dir/prefix.snn" --steps "$t" --json || return
      audit "$dir/prefix-$t-$view.json" "$dir/prefix.snn" "$view" || return
      rm -f "$dir/prefix-$t.part"
    done
  done
  rm -f "$dir/prefix.snn"
}

# keep FILE TEXT: true if FILE holds TEXT already, else writes it.
keep() {
  [ "$(cat "$1" 2>/dev/null)" = "$2" ] && return 0
  printf '%s\n' "$2" >"$1"
  return 1
}

# Writes the parameters beside the results and drops the results of others.
prepare() {
  local evaluation
  mkdir -p "$dir" || return 1
  if [ "$(cat "$dir/train.cmd" 2>/dev/null)" != "sf_train DATA $train_options" ] ||
    [ "$(cat "$dir/data" 2>/dev/null)" != "$data_id" ]; then
    rm -rf "$dir"
    mkdir -p "$dir" || return 1
    keep "$dir/version" "$version"
    keep "$dir/data" "$data_id"
    keep "$dir/train.cmd" "sf_train DATA $train_options" # last: whoever is killed before begins here again
  fi
  evaluation="sim_render, energy_audit: views $views, --downscale ${set[audit-downscale]} --rtl-rays ${set[rtl-rays]} --seed ${set[seed]}"
  [ "${set[convert-rays]}" -eq 0 ] || evaluation="$evaluation; sf_convert --rays ${set[convert-rays]}"
  [ "${set[cosim-rays]}" -eq 0 ] || evaluation="$evaluation; sf_cosim --rays ${set[cosim-rays]}"
  if ! keep "$dir/eval.cmd" "$evaluation"; then
    rm -f "$dir"/{fixed,float,audit,prefix}-*.json "$dir"/{cosim,convert}.json "$dir"/{frame,truth}-*.png
    [ "$(cat "$dir/status" 2>/dev/null)" != "done" ] || rm -f "$dir/status"
  fi
}

one_run() { # NAME OPTIONS OF SF_TRAIN...
  name=$1
  shift
  dir=$out/$scene/$name
  train_options="$common${*:+ $*} $behind" key=${scene%%/*}
  index=$((index + 1)) run_started=$SECONDS
  local code before
  [ -z "$stop" ] || return
  prepare || { failures=$((failures + 1)); return; }
  if [ "$(cat "$dir/status" 2>/dev/null)" = "done" ]; then
    if since_we_began "$dir/status"; then # by another process
      left[$key]=$((${left[$key]:-0} - 1))
      say "finished elsewhere"
    else
      say "finished before"
    fi
    return
  fi
  echo "not finished" >"$dir/status"
  start_ticker
  train && case $name in
    ann) [ -n "$training_alone" ] || evaluate_ann ;;
    along-ray) ;; # the trainer counts it
    *) evaluate_snn ;;
  esac
  code=$?
  stop_ticker
  before=$(cat "$dir/wall" 2>/dev/null || echo 0)
  echo $((before + SECONDS - run_started)) >"$dir/wall"
  if [ -n "$stop" ]; then
    say "stopped, will go on from here"
  elif [ $code -eq 0 ] && [ -n "$training_alone" ]; then
    say "trained; counted when the spiking run is done"
  elif [ $code -eq 0 ]; then
    echo "done" >"$dir/status"
    left[$key]=$((${left[$key]:-0} - 1)) finished[$key]=$((${finished[$key]:-0} + 1))
    spent[$key]=$((${spent[$key]:-0} + $(cat "$dir/wall")))
    say_done
  else
    echo "failed: $(last_line "$dir/log")" >"$dir/status"
    failures=$((failures + 1)) left[$key]=$((${left[$key]:-0} - 1))
    say "FAILED ($code): $(last_line "$dir/log")"
  fi
}

number() { sed -nE "s/.*\"$2\":[[:space:]]*(-?[0-9.e+-]+).*/\1/p" "$1" 2>/dev/null | head -n 1; }
# The next run takes as long as the others.
say_done() (
  run_started=$SECONDS index=$((index + 1))
  remaining=$(eta)
  printf '[%*d/%d] %-28s %s, elapsed %s, %s\n' ${#total} $((index - 1)) "$total" "$scene $name" "$(figures)" \
    "$(clock $((SECONDS - started)))" "$remaining"
)
figures() { printf 'PSNR %.2f dB, %s steps, %d s' "$(number "$dir/train.json" psnr)" "$(number "$dir/train.json" t_r)" "$(cat "$dir/wall")"; }

skip_run() { # NAME WHY
  name=$1 dir=$out/$scene/$1 key=${scene%%/*} index=$((index + 1)) run_started=$SECONDS
  [ -z "$stop" ] || return
  rm -rf "$dir"
  mkdir -p "$dir"
  echo "skipped: $2" >"$dir/status"
  left[$key]=$((${left[$key]:-0} - 1))
  say "skipped: $2"
}

fixed_run() { # NAME STEPS OPTIONS...
  local name=$1 steps=$2
  shift 2
  if [ -z "$t_r" ]; then
    skip_run "$name" "beta-5e-7 failed, its t_r is not known"
  elif [ "$steps" -lt 1 ] || [ "$steps" -gt "${set[steps]}" ]; then
    skip_run "$name" "$steps steps are outside 1..${set[steps]}"
  else
    one_run "$name" --beta 5e-7 --fixed-steps "$steps" "$@"
  fi
}

# A number of steps that the ablations train as well is not trained twice.
sweep_run() { # NAME STEPS OPTIONS...
  local name=$1 steps=$2 other
  shift 2
  for other in $swept_before; do
    [[ " $names " == *" $other "* ]] && [ "$(cat "$out/$scene/$other/status" 2>/dev/null)" = "done" ] || continue
    [ "$(number "$out/$scene/$other/train.json" t_r)" = "$steps" ] || continue
    rm -rf "${out:?}/$scene/$name"
    index=$((index + 1)) left[$key]=$((${left[$key]:-0} - 1)) run_started=$SECONDS
    [ -n "$stop" ] || say "is $other"
    return
  done
  one_run "$name" --beta 5e-7 --fixed-steps "$steps" "$@"
}
