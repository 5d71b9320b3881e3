# For scripts of tests/chain that interrupt and continue a script of tools/:   . tool_run.bash TOOL BUILD
# Gives programs and script (of tools/TOOL.sh), work (a folder that goes at the end), build, run_tool, count, fail; and pid,
# whose process ends with the script.
set -u
export LC_ALL=C OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
programs=$(cd "${2:?usage: $0 BUILD}/bin" && pwd) || exit 2
script=$(cd "$(dirname "${BASH_SOURCE[0]}")/../tools" && pwd)/$1.sh
work=$(mktemp -d "${TMPDIR:-/tmp}/sf_$1.XXXXXX") || exit 1
pid=
trap '[ -z "$pid" ] || kill -TERM "$pid" 2>/dev/null; wait; rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
fail() {
  echo "FAILED: $1"
  [ -e "$work/out" ] && tail -n 12 "$work/out" | cut -c -200
  exit 1
}
build() { mkdir -p "$work/$1/bin" && ln -s "$programs"/* "$work/$1/bin/"; }
run_tool() { # NAME STATUS OPTIONS...: output in $work/out
  local name=$1 wanted=$2 got
  shift 2
  "$script" "$work/$name" --profile smoke "$@" >"$work/out" 2>&1
  got=$?
  [ $got -eq "$wanted" ] || fail "$name $*: exit status $got, expected $wanted"
}
count() { grep -c "$1" "$work/out"; }
