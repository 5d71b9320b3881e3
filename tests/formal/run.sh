#!/bin/bash
# Proves the properties of tests/formal/properties and sees the faults of tests/formal/faults fail.
# usage: run.sh BUILD [--quick] [NAME...]     table on standard output; exit 0 all as expected, 1 not, 77 no solver
set -u
cd "$(dirname "$0")/../.." || exit 1
case ${1:-} in '' | -*) sed -n '2,3s/^# //p' "$0"; exit 2 ;; esac
build=$1/formal
shift
quick=
[ "${1:-}" = --quick ] && quick=1 && shift
for want; do
  grep -qE "^$want " tests/formal/properties || { echo "formal: $want: no such property in tests/formal/properties" >&2; exit 1; }
done
for program in yosys yosys-smtbmc z3; do
  command -v $program >/dev/null || { echo "formal: $program is not installed (apt-get install yosys z3)"; exit 77; }
done
limit=${FORMAL_LIMIT:-900} # seconds per proof
mkdir -p "$build"
trap 'kill $(jobs -p) 2>/dev/null; exit 130' INT TERM

sources() { # modules with a comma between them, or -
  [ "$1" = - ] || for module in ${1//,/ }; do find rtl -name "$module.sv"; done
  echo "tests/formal/$2.sv"
}

# reduced TOP FOLDER FILES: the same list, of the files that TOP.sed reduces or extracts from, the reduced copies in FOLDER
reduced() {
  local top=$1 folder=$2 file
  shift 2
  for file; do
    if [ -f "tests/formal/$top.sed" ] && [[ $file != *"$top.sv" ]]; then
      mkdir -p "$folder"
      sed -E -f "tests/formal/$top.sed" "$file" >"$folder/reduced_$top.${file##*/}"
      file=$folder/reduced_$top.${file##*/}
    fi
    echo "$file"
  done
}

# verdict NAME TOP SOURCES METHOD PARAMETERS INCLUDE: proved, refuted or unknown (time limit, or Yosys refuses)
verdict() {
  local name=$1 top=$2 files method=$4 parameters=$5 include=$6 set= peek= depth=${4#*:} wire
  files=$(reduced "$top" "$include" $3)
  for p in $parameters; do set+=" -set ${p%=*} ${p#*=}"; done
  for wire in $(grep -oE 'peek_[a-z0-9_]+' "tests/formal/$top.sv" | sort -u); do
    [ "$wire" = peek_ ] || peek+="connect -set $wire u_dut.${wire#peek_}; "
  done
  # One multiplier at most is left of the unit's and the specification's, and is cut: any product that mul_bounds allows.
  local script="read_verilog -sv -formal -I$include -Irtl rtl/gen/sf_arch_pkg.sv rtl/gen/sf_csr_pkg.sv rtl/sf_op_pkg.sv
    $files; ${set:+chparam$set $top;} "
  script=${script//$'\n'/ }
  if [ "$method" = prove ]; then
    timeout "$limit" yosys -Q -T -p "$script prep -flatten -top $top; opt -full; wreduce; opt -full -fine; opt_merge; opt_clean; select -assert-max 1 t:\$mul; cutpoint t:\$mul
      sat -prove-asserts -set-assumes -show-inputs" >"$build/$name.log" 2>&1
    grep -q 'no model found: SUCCESS' "$build/$name.log" && { echo proved; return; }
    grep -q 'model found: FAIL' "$build/$name.log" && { echo refuted; return; }
    echo unknown
    return
  fi
  script+=" hierarchy -check -top $top; proc; flatten; $peek opt; memory; async2sync; opt -full; dffunmap"
  if [ "${method%:*}" = induct ] || [ "${method%:*}" = step ]; then
    local cut=
    case $top in
      composite_conserves | exp_neg_one) cut="cutpoint t:\$mul; opt -full;" ;;
      # The two multipliers are the specification's, too, and are cut: a third would be another product.
      plif_spec | integrate_spec) cut="wreduce; opt_merge; opt_clean; select -assert-max 2 t:\$mul; cutpoint t:\$mul; opt -full;" ;;
    esac
    # -seq 1: nothing is asserted in the cycle of the reset
    timeout "$limit" yosys -Q -T -p "$script; $cut sat -tempinduct -seq 1 -maxsteps $depth -prove-asserts -set-assumes -show-inputs" \
      >"$build/$name.log" 2>&1
    # An assumption that Yosys folded to a constant would prove anything.
    grep -q "from assume cell: 1'[0x]" "$build/$name.log" && { echo unknown; return; }
    grep -q 'Induction step proven: SUCCESS' "$build/$name.log" && { echo proved; return; }
    [ "${method%:*}" = step ] && grep -q 'Reached maximum number of time steps' "$build/$name.log" && { echo refuted; return; }
    grep -q 'model found for base case: FAIL' "$build/$name.log" && { echo refuted; return; }
    echo unknown
    return
  fi
  yosys -Q -T -p "$script; write_smt2 -wires $build/$name.smt2" >"$build/$name.log" 2>&1 || { echo unknown; return; }
  [ "$method" = z3 ] && depth=1
  for step in -t $([ "$method" = z3 ] || echo -it); do
    timeout "$limit" yosys-smtbmc -s z3 --noprogress ${step/-it/-i -t} "$depth" --dump-vcd "$build/$name.vcd" "$build/$name.smt2" \
      >>"$build/$name.log" 2>&1
    case $(tail -n 1 "$build/$name.log") in *PASSED*) ;; *FAILED*) echo refuted; return ;; *) echo unknown; return ;; esac
  done
  echo proved
}

failures=0 rows=0
row() { # name, method, parameters, seconds, verdict, expected
  local result=$5
  rows=$((rows + 1))
  [ "$5" = "$6" ] || { result="$5, expected $6: $build/$1.log"; failures=$((failures + 1)); }
  printf '%-28s %-10s %-20s %7.1f  %s\n' "$1" "$2" "$3" "$4" "$result"
}

chosen() { # name, when
  [ -z "$quick" ] || [ "$2" = quick ] || return 1
  [ $# -eq 2 ] && return
  local name=$1
  shift 2
  for want; do [ "$want" = "${name%%+*}" ] && return; done
  return 1
}

printf '%-28s %-10s %-20s %7s  %s\n' property method parameters seconds verdict
while read -r name top module method when parameters; do
  case $name in '' | '#'*) continue ;; esac
  chosen "$name" "$when" "$@" || continue
  start=$EPOCHREALTIME
  result=$(verdict "$name" "$top" "$(echo $(sources "$module" "$top"))" "$method" "$parameters" "$build")
  row "$name" "$method" "$parameters" "$(bc <<<"$EPOCHREALTIME - $start")" "$result" proved
done <tests/formal/properties

# Planted faults: the property must fail on the changed copy of its file.
while read -r name number when file change; do
  case $name in '' | '#'*) continue ;; esac
  chosen "$name" "$when" "$@" || continue
  read -r _ top module method _ parameters < <(grep -E "^$name " tests/formal/properties)
  rm -rf "$build/$name+$number" && mkdir -p "$build/$name+$number"
  copy=$build/$name+$number/$(basename "$file")
  sed -E "$change" "$file" >"$copy"
  if cmp -s "$file" "$copy"; then
    echo "tests/formal/faults: $name $number changes nothing in $file" >&2
    failures=$((failures + 1))
    continue
  fi
  files=
  for source in $(sources "$module" "$top"); do # beside the copy: an include looks there first
    [ -f "$build/$name+$number/${source##*/}" ] || cp "$source" "$build/$name+$number/"
    files+=" $build/$name+$number/${source##*/}"
  done
  start=$EPOCHREALTIME
  result=$(verdict "$name+$number" "$top" "$files" "$method" "$parameters" "$build/$name+$number")
  row "$name+$number" "$method" "${change:0:20}" "$(bc <<<"$EPOCHREALTIME - $start")" "$result" refuted
done <tests/formal/faults
[ $rows -gt 0 ] || { echo "formal: no property was tried" >&2; exit 1; }
[ $failures -eq 0 ] || echo "formal: $failures not as expected"
[ $failures -eq 0 ]
