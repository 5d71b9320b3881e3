#!/bin/bash
# Mutates RTL modules and counts how many mutants their checkers kill.
# usage: mutate.sh BUILD [--mutants N] [--sample] [MODULE...]
# All mutants of a module are in one netlist (yosys mutate); SF_MUTANT=N in the environment chooses one when it starts, so
# a module is built once. Killed: the checker fails, crashes or hangs. A result is kept in BUILD/mutate/MODULE/results as
# it comes, so that an interrupted run goes on where it was. Exit 0 nothing unexplained survived, 1 not, 77 no tool.
# Equivalent: proven by Yosys (combinational modules, inputs of their domain in tests/mutate/modules), or listed with its
# reason in tests/mutate/equivalent.
# --sample: a few mutants of a few modules, in seconds, for `make check`.
set -u
cd "$(dirname "$0")/../.." || exit 1
case ${1:-} in '' | -*) sed -n '2,9s/^# //p' "$0"; exit 2 ;; esac
build=$(realpath -m "$1")/mutate library=$1/libspikefield.a
shift
mutants=${MUTANTS:-100000} modules=()
while [ $# -gt 0 ]; do
  case $1 in
    --mutants) mutants=$2; shift ;;
    --sample) mutants=24 modules=(sf_first sf_stream_out) build+=/sample ;;
    *) modules+=("$1") ;;
  esac
  shift
done
for program in yosys verilator; do
  command -v $program >/dev/null || { echo "mutate: $program is not installed"; exit 77; }
done
limit=${MUTANT_LIMIT:-20} # seconds per mutant
mkdir -p "$build" || exit 1
trap 'exit 130' INT TERM
packages="rtl/gen/sf_arch_pkg.sv rtl/gen/sf_csr_pkg.sv rtl/sf_op_pkg.sv"
include=$(verilator --getenv VERILATOR_ROOT)/include

# netlist MODULE SOURCES: $work/MODULE.v holds all mutants, $work/list names them
netlist() {
  local module=$1 sources=$2 bits=20
  yosys -Q -T -p "read_verilog -sv -Irtl $packages $sources rtl/$module.sv; hierarchy -top $module; proc; opt -full; wreduce; opt -full; opt_clean
    mutate -list $mutants -seed 1 -ctrl mutsel $bits 1 -o $work/list $module; script $work/list
    cd $module; opt_clean; techmap t:\$lt t:\$gt t:\$le t:\$ge; techmap t:\$alu; techmap t:\$lcu; opt_clean; splitnets; opt_clean; write_verilog -noattr -selected $work/netlist.v" >"$work/yosys.log" 2>&1 || return 1
  sed -E "1,/\);/{s/, mutsel\)/)/;s/\(mutsel, /(/;s/, mutsel,/,/}
    s/^  input \[[0-9:]*\] mutsel;/  import \"DPI-C\" function int sf_mutant();/
    s/^  wire (\[[0-9:]*\]) mutsel;/  reg \1 mutsel; initial mutsel = sf_mutant();/" "$work/netlist.v" >"$work/$module.v"
  grep -q 'initial mutsel' "$work/$module.v"
}

# program MODULE SOURCES CHECKER: $work/checker
program() {
  local module=$1 sources=$2 checker=$3
  verilator --cc -Wno-fatal -Wno-lint -Wno-style -O3 --x-assign unique --x-initial unique --prefix "V$module" \
    --top-module "$module" -Irtl --Mdir "$work/verilated" rtl/lint.vlt $packages $sources "$work/$module.v" >"$work/verilator.log" 2>&1 &&
    make -s -C "$work/verilated" -f "V$module.mk" OPT_FAST=-O2 "V${module}__ALL.a" verilated.o verilated_threads.o >"$work/make.log" 2>&1 &&
    gcc -O2 -c tests/mutate/mutant.c -o "$work/mutant.o" &&
    g++ -std=c++17 -O2 -Wall -Wextra "-DUNIT=$module" "-DUNIT_$module" -Iinclude -I. -isystem "$include" -isystem "$include/vltstd" -isystem "$work/verilated" \
      "$checker" "$work/verilated/V${module}__ALL.a" "$work/mutant.o" "$work/verilated/verilated.o" "$work/verilated/verilated_threads.o" "$library" -fopenmp -lm -lpthread \
      -o "$work/checker" 2>"$work/gcc.log"
}

# place MUTANT: file:line, cell port and what was done to it
place() {
  sed -n "s/^mutate -ctrl mutsel [0-9]* $1 -mode \([a-z0-9]*\) .*-port \([^ ]*\) -portbit \([0-9]*\).*/\1 \2[\3]/p" "$work/list" | tr -d '\\'
  sed -n "s/^mutate -ctrl mutsel [0-9]* $1 .*-src \([^ ]*\).*/\1/p" "$work/list" | head -1
}

# equivalent MODULE SOURCES DOMAIN MUTANT: proven by Yosys' SAT solver for every input of the domain (combinational modules)
equivalent() {
  local module=$1 sources=$2 domain=$3 m=$4
  [ "$domain" = - ] && return 1
  [ "$domain" = exhausted ] && return 0 # the checker has tried every input
  sed -E "s/^module $module\(/module gold(/;s/, mutsel\)/)/;s/, mutsel,/,/;/^  input .*mutsel;/d
    s/^  wire (\[[0-9:]*\]) mutsel;/  wire \1 mutsel = 0;/;s/^endmodule/always @* assume (${domain//&/\\&});\nendmodule/" \
    "$work/netlist.v" >"$work/gold.v"
  sed -E "s/^module $module\(/module gate(/;s/, mutsel\)/)/;s/, mutsel,/,/;/^  input .*mutsel;/d
    s/^  wire (\[[0-9:]*\]) mutsel;/  wire \1 mutsel = $m;/" "$work/netlist.v" >"$work/gate.v"
  timeout 60 yosys -Q -T -p "read_verilog -sv $packages $sources; read_verilog -formal -sv $work/gold.v $work/gate.v
    proc; miter -equiv -flatten gold gate miter; hierarchy -top miter; proc; flatten; opt -full; opt_merge; opt_clean
    sat -prove trigger 0 -set-assumes miter" >"$work/equivalent.log" 2>&1
  grep -q 'no model found: SUCCESS' "$work/equivalent.log"
}

failures=0 total_killed=0 total_left=0 json=
printf '%-16s %8s %8s %11s %9s %8s %8s\n' module mutants killed equivalent survived score seconds
while read -r module sources checker domain; do
  case $module in '' | '#'*) continue ;; esac
  if [ ${#modules[@]} -gt 0 ]; then
    [[ " ${modules[*]} " == *" $module "* ]] || continue
  fi
  [ "$sources" = - ] && sources=
  work=$build/$module
  mkdir -p "$work"
  start=$SECONDS
  key=$(cat tests/mutate/modules $packages rtl/*.svh $sources "rtl/$module.sv" "$checker" src/fx/*.[ch] tests/mutate/mutate.sh <<<"$mutants" | sha256sum)
  if [ ! -x "$work/checker" ] || [ "$(cat "$work/key" 2>/dev/null)" != "$key" ]; then
    rm -rf "$work" && mkdir -p "$work"
    netlist "$module" "$sources" && program "$module" "$sources" "$checker" ||
      { echo "$module: no netlist or no program, see $work" >&2; failures=$((failures + 1)); continue; }
    echo "$key" >"$work/key"
  fi
  if ! timeout "$limit" "$work/checker" >/dev/null 2>&1; then
    echo "$module: the checker fails without a mutant" >&2
    failures=$((failures + 1))
    continue
  fi
  count=$(grep -c '^mutate -ctrl' "$work/list")
  touch "$work/results"
  done_before=$(wc -l <"$work/results")
  for ((m = done_before + 1; m <= count; m++)); do
    if SF_MUTANT=$m timeout "$limit" "$work/checker" >/dev/null 2>&1; then 
      if equivalent "$module" "$sources" "$domain" "$m"; then echo "$m equivalent"; else echo "$m survived"; fi
    else echo "$m killed"; fi >>"$work/results"
    [ -t 2 ] && [ $((m % 20)) -eq 0 ] && printf '\r%s %d/%d ' "$module" "$m" "$count" >&2
  done
  [ -t 2 ] && printf '\r\033[K' >&2
  killed=$(grep -c killed "$work/results") equivalent=$(grep -c equivalent "$work/results") left=0
  : >"$work/survivors" && : >"$work/survivors.new"
  while read -r m _; do
    where=$(place "$m" | paste -sd ' ')
    echo "$m $where" >>"$work/survivors"
    # Known by place and kind, not by number, which another sample would change.
    if grep -qF "$module $where |" tests/mutate/equivalent; then
      equivalent=$((equivalent + 1))
    else
      left=$((left + 1))
      echo "  $module mutant $m: $where" >>"$work/survivors.new"
    fi
  done < <(grep survived "$work/results")
  # A listed equivalent that a complete run kills is stale.
  while IFS='|' read -r known _; do
    where=${known#"$module "} where=${where% }
    if [ "$mutants" -ge 100000 ] && ! cut -d' ' -f2- "$work/survivors" | grep -qxF "$where"; then
      echo "tests/mutate/equivalent: $known is killed or gone: remove the line" >&2
      failures=$((failures + 1))
    fi
  done < <(grep "^$module " tests/mutate/equivalent)
  printf '%-16s %8d %8d %11d %9d %7s%% %8d\n' "$module" "$count" "$killed" "$equivalent" "$left" \
    "$(bc <<<"scale=1; 100 * $killed / ($count - $equivalent)")" $((SECONDS - start))
  cat "$work/survivors.new"
  json+="${json:+,}{\"module\":\"$module\",\"mutants\":$count,\"killed\":$killed,\"equivalent\":$equivalent,\"survived\":$left}"
  total_killed=$((total_killed + killed)) total_left=$((total_left + left))
done <tests/mutate/modules
total=$((total_killed + total_left))
[ $total -gt 0 ] || { echo "mutate: no module of that name in tests/mutate/modules" >&2; exit 2; }
echo "{\"killed\":$total_killed,\"not_equivalent\":$total,\"modules\":[$json]}" >"$build/mutate.json"
printf 'score %d / %d = %s %%, JSON in %s\n' $total_killed $total "$(bc <<<"scale=2; 100 * $total_killed / $total")" "$build/mutate.json"
[ $total_left -eq 0 ] && [ $failures -eq 0 ]
