# For scripts of tests/chain that start programs as ranks of mpirun:   . ranks_run.bash BUILD
# Beside small_scene.bash, in whose folder it goes on: bin, job, refused, pid_of, await, gone, plain, same, full.
command -v mpirun >/dev/null || { echo "skipped: mpirun is not installed (openmpi-bin)"; exit 77; }
. "$(dirname "${BASH_SOURCE[0]}")/small_scene.bash" "$@"
cd "$work" || exit 1
export LC_ALL=C OMP_NUM_THREADS=1 OMP_WAIT_POLICY=passive
[ "$(id -u)" -ne 0 ] || export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
bin=$build/bin

# job RANKS COMMAND...: a rank that stays behind would be a failure, too
job() { timeout -k 5 120 mpirun --oversubscribe -n "$1" "${@:2}"; }
# pid_of RANK JOB: the process of a job that has begun
pid_of() {
  for _ in $(seq 300); do
    for pid in $(ps -o pid= --ppid "$2"); do
      tr '\0' '\n' <"/proc/$pid/environ" 2>/dev/null | grep -qx "OMPI_COMM_WORLD_RANK=$1" && { echo "$pid"; return; }
    done
    sleep 0.1
  done
}
await() { for _ in $(seq 600); do [ -e "$1" ] && return; sleep 0.1; done; fail "$1 does not come"; }
# gone PID: within the 10 s that a job has to end
gone() {
  for _ in $(seq 100); do
    ps -o stat= -p "$1" | grep -qv Z || return 0
    sleep 0.1
  done
  return 1
}
plain() { grep -aEv '"(seconds|jobs|pixels_per_second)":' "$1" | sed 's/time="[0-9.]*"//g'; }
same() { cmp -s <(plain "$1") <(plain "$2") || fail "$3: $1 and $2 differ: $(diff <(plain "$1") <(plain "$2") | head -n 4)"; }
refused() { # STATUS TEXT MPIRUN-ARGS...
  timeout -k 5 120 mpirun --oversubscribe "${@:3}" >refused.out 2>&1
  [ $? -eq "$1" ] || fail "${*:3}: exit status is not $1: $(cat refused.out)"
  grep -qF -- "$2" refused.out || fail "${*:3}: '$2' is not in $(cat refused.out)"
}
# full BLOCKS: for bash -c; no file may grow beyond a size (a write fails with EFBIG in place of ENOSPC)
full() { printf '%s' "trap '' XFSZ; ulimit -f $1; exec \"\$0\" \"\$@\""; }
