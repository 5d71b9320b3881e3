# shellcheck shell=bash disable=SC2154
# One folder of runs, or of points, for any number of processes: each unit is taken by one of them, and the last one makes the
# table. Sourced by reproduce.sh and pareto.sh; reads out and stop. A taken unit is a lock that its process and the program it
# started hold: whatever ends them frees it. So nothing has to be cleaned up after a killed process or a lost machine.

# What a launcher says of this script is not meant for the programs that it starts.
unset OMPI_COMM_WORLD_SIZE SLURM_STEP_NUM_TASKS PMI_SIZE

# join_others SETTINGS [FUNCTION]: this process takes part. False where others are at work with other settings. The function
# runs alone, when the settings are new.
join_others() {
  local tries
  exec 9>>"$out/lock" || return
  for ((tries = 0; tries < 25; tries++)); do
    if flock -n 9; then
      if [ "$(cat "$out/settings" 2>/dev/null)" != "$1" ]; then
        ${2:-true}
        printf '%s\n' "$1" >"$out/settings"
      fi
    fi
    if flock -sn 9; then
      [ "$(cat "$out/settings" 2>/dev/null)" = "$1" ] || return
      mark=$(mktemp "$out/.begun.XXXXXX") || return
      trap 'rm -f "$mark"' EXIT
      return 0
    fi
    sleep 0.2
  done
  return 1
}

# claim LOCK, until release. Programs that are started meanwhile hold it, too.
claim() {
  exec 8>>"$1" || return
  flock -n 8 && return
  release
  return 1
}
release() { exec 8>&-; }
is_free() { [ ! -e "$1" ] || flock -sn "$1" true; }
# Of this call: failures before it are tried again.
since_we_began() { [ "$1" -nt "$mark" ]; }

# alone LOCK COMMAND...: after whoever does the same elsewhere.
alone() {
  local code
  exec 7>>"$1" || return
  while ! flock -n 7; do
    [ -z "$stop" ] || { exec 7>&-; return 130; }
    sleep 0.2
  done
  "${@:2}"
  code=$?
  exec 7>&-
  return $code
}

# deal: calls visit I for every lock_of[I] that nobody has taken, once ready I says so, until each is settled or at work
# elsewhere; their number is in elsewhere. While none is ready it calls work_ahead, which does what can be done of a unit
# before: false if nothing can.
lock_of=() seen=() elsewhere=0
work_ahead() { false; }
deal() {
  local i open moved
  while [ -z "$stop" ]; do
    open=0 moved="" elsewhere=0
    for i in "${!lock_of[@]}"; do
      [ -z "${seen[i]:-}" ] && [ -z "$stop" ] && ready "$i" && claim "${lock_of[i]}" || continue
      seen[i]=1 moved=1
      visit "$i"
      release
    done
    for i in "${!lock_of[@]}"; do
      [ -z "${seen[i]:-}" ] || continue
      if ! is_free "${lock_of[i]}"; then
        elsewhere=$((elsewhere + 1))
      elif ! settled "$i"; then
        open=$((open + 1))
      fi
    done
    [ $open -gt 0 ] || return 0
    [ -n "$moved" ] || work_ahead || sleep 1
  done
}
