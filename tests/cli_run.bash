# For the scripts of tests/chain that give programs bad input:   . cli_run.bash BUILD
# Exit status 2 for usage and 1 for data, exactly one line on stderr that names the option or the file, no partial output,
# never a crash. Gives BIN, TOOLS, a folder of its own with a data set d, model.safetensors and s.snn, and the shortest right
# command line of each program; run, judge, usage, data, good, absent, check, number, poke, size_of and finish.
. "$(dirname "${BASH_SOURCE[0]}")/chain.bash" "$@"
export LC_ALL=C OMP_NUM_THREADS=2
BIN=$build/bin TOOLS=$root/tools
cd "$work" || exit 2
passed=0

# run PROGRAM ARGS...: leaves $status, files stdout.txt and err. The program is ended after $limit seconds.
limit=300
run() {
  timeout -k 5 "$limit" "$BIN/$1" "${@:2}" >stdout.txt 2>err </dev/null
  status=$?
}

# judge LABEL PROGRAM STATUS PATTERN: one line on stderr, from the program, with PATTERN; nothing left aside.
judge() {
  local label=$1 program=$2 wanted=$3 pattern=$4 lines left
  lines=$(wc -l <err)
  left=$(find . -name '*.sf-*' -print -quit)
  if [ "$status" -ne "$wanted" ]; then fail "$label" "exit status $status, expected $wanted"
  elif [ "$lines" -ne 1 ]; then fail "$label" "$lines lines on stderr, expected 1"
  elif ! grep -q "^$program: " err; then fail "$label" "the line does not name the program"
  elif ! grep -qF -e "$pattern" err; then fail "$label" "the line does not name '$pattern'"
  elif [ -n "$left" ]; then fail "$label" "left $left behind"; rm -f "$left"
  else passed=$((passed + 1)); return; fi
}

usage() { # PATTERN PROGRAM ARGS...; soon, before any work
  local limit=30
  run "${@:2}"
  judge "usage: ${*:2}" "$2" 2 "$1"
}

data() { # PATTERN PROGRAM ARGS...
  run "${@:2}"
  judge "data: ${*:2}" "$2" 1 "$1"
}

good() { # PROGRAM ARGS...; without progress, which a busy machine would show
  local quiet=()
  if "$BIN/$1" --help | grep -q -e --quiet; then quiet=(--quiet); fi
  run "$@" "${quiet[@]}"
  if [ "$status" -ne 0 ]; then fail "good: $*" "exit status $status"
  elif [ -s err ]; then fail "good: $*" "a good run wrote on stderr"
  else passed=$((passed + 1)); fi
}

check() { # LABEL TEXT COMMAND...
  if "${@:3}"; then passed=$((passed + 1)); else fail "$1" "$2"; fi
}
absent() { # FILE LABEL
  check "$2" "left $1 behind" [ ! -e "$1" ]
  rm -rf "$1"
}
finish() {
  echo "$passed passed, $failures failed"
  [ "$failures" -eq 0 ]
}

# poke FILE OFFSET OCTAL: one byte.
poke() { printf "\\$3" | dd of="$1" bs=1 seek="$2" conv=notrunc status=none; }
size_of() { wc -c <"$1"; }

# The shortest right command line of each program.
declare -A right=(
  [sf_scene]="simple -o out" [sf_train]="d -o out" [sf_export]="model.safetensors -o out"
  [sf_cosim]="s.snn d" [sim_render]="s.snn d -o out" [energy_audit]="s.snn d"
  [error_budget]="model.safetensors s.snn d" [sf_cycles]="s.snn d" [sf_view]="s.snn d")
number() { # PROGRAM OPTION BAD...
  for value in "${@:3}"; do usage "$2" "$1" ${right[$1]} "$2" "$value"; done
}

good sf_scene simple -o d --size 16 --train 3 --test 2
good sf_train d -o model.safetensors --stage1 2 --stage2 2 --hidden 16 --steps 3 --levels 2 --log2-hash 8 --lattice 128 --threads 1
good sf_export model.safetensors -o s.snn
