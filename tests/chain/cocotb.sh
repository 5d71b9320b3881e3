#!/bin/bash
# The Python package from its wheel beside a vector kit, and the cocotb bench with it: PASS in Verilator and Icarus, every
# planted fault of the RTL found and located, one JUnit case per ray, another block, clear errors.   usage: cocotb.sh BUILD
python=$(cd "${1:?usage: $0 BUILD}" && pwd)/cocotb/bin/python3
[ -x "$python" ] || { echo "cocotb: skipped: no $python: make python"; exit 77; }
NEURONS=72 # programmed sooner; fault 2 is in neuron 64
. "$(dirname "$0")/../small_scene.bash" "$@"
cd "$root" || exit 1
unset MAKEFLAGS MAKELEVEL SPIKEFIELD_LIBRARY PYTHONPATH
export OMP_NUM_THREADS=1

# ---- the package, as it is installed from the wheel
"${MAKE:-make}" -s B="$build" wheel >"$work/out" 2>&1 || fail "make wheel: $(tail -n 3 "$work/out")"
wheel=$(ls "$build"/wheel/*.whl) || { fail "make wheel: no wheel"; finish; }
"$python" -m pip install -q --disable-pip-version-check --no-index --no-deps --target "$work/site" "$wheel" || fail "pip refuses the wheel"
(cd "$work" && "$python" -c 'import spikefield') 2>/dev/null && fail "the package is there without the wheel"
export PYTHONPATH=$work/site
"$build/bin/sf_export" "$work/scene.snn" --vectors "$work/kit" --data "$work/data" --samples 24 --seed 3 >/dev/null || fail "no kit"
"$python" -W error tests/python_package.py "$work/scene.snn" "$work/kit" || fail "the package beside the kit"
# Other bits than the kit's are seen.
awk 'NR == 1 { $0 = "0" substr($0, 2, length($0) - 2) "7" } { print }' "$work/kit/expected_counters.hex" >"$work/wrong.hex"
mv "$work/wrong.hex" "$work/kit/expected_counters.hex"
"$python" tests/python_package.py "$work/scene.snn" "$work/kit" >"$work/out" 2>&1 && fail "a wrong counter of the kit passes"
grep -q '^FAIL: test_counters' "$work/out" || fail "a wrong counter is not named: $(tail -n 3 "$work/out")"
# What is loaded must be the library.
SPIKEFIELD_LIBRARY=/nowhere.so "$python" -c 'import spikefield' 2>&1 | grep -q 'ImportError: .*SPIKEFIELD_LIBRARY.*/nowhere.so' ||
  fail "a missing library is not named"

# ---- the bench.  bench STATUS TEXT... -- OPTION..., on a scene: of all lanes, or of fewer, which is programmed sooner
"$build/faults/make_scene" "$work/narrow.snn" 32 || exit 1
scene=scene
bench() {
  local want=$1 got texts=()
  shift
  while [ "$1" != -- ]; do texts+=("$1"); shift; done
  shift
  "$python" share/cocotb/sf_cocotb.py "$work/$scene.snn" "$work/data" --export "$build/bin/sf_export" --seed 3 --opt=-O0 "$@" >"$work/out" 2>&1
  got=$?
  [ $got -eq "$want" ] || fail "bench $*: status $got, expected $want: $(tail -n 4 "$work/out")"
  for text in "${texts[@]}"; do grep -qE -- "$text" "$work/out" || fail "bench $*: no '$text' in $(cut -c1-300 "$work/out")"; done
  echo "bench $*: $(head -n 1 "$work/out" | cut -c1-200)"
}

# The accelerator with planted faults, one chosen at run time; 0 is none.
sed "s|^rtl/|$build/faults/rtl/|; s|^+incdir+rtl|+incdir+$build/faults/rtl|" "$work/kit/rtl.f" >"$work/faulty.f"
faulty() { bench "${@:2}" -- --samples 24 --dut "-F $work/faulty.f" --plusarg "+fault=$1" -o "$work/faulty"; }
faulty 0 0 'PASS 24 samples of [0-9]+ rays in verilator'
rays=$(sed -nE 's/^PASS .* of ([0-9]+) rays.*/\1/p' "$work/out")
[ "$(grep -c '<testcase name="ray_' "$work/faulty/results.xml")" = "$rays" ] || fail "not one JUnit case per ray: $rays"
grep -q '<failure' "$work/faulty/results.xml" && fail "a failure in results.xml of a run that passes"
faulty 1 1 'FAIL ray_.* layer C2 step [0-9] neuron 37 membrane: expected'
grep -q '<failure' "$work/faulty/results.xml" || fail "no failure in results.xml"
faulty 2 1 'FAIL ray_.* layer C2 step 1 neuron 64 row: expected 1, actual 0'
scene=narrow
faulty 9 1 'FAIL ray_.* a result changed before it was taken'
faulty 10 1 'counter .*: expected [0-9]+, actual'
faulty 12 1 'FAIL counters: .*register 1000: response 2 to a read'
faulty 13 1 'FAIL program: .*a register answered before it was asked'
faulty 14 1 'FAIL ray_.*: no result within 100000 cycles'
faulty 15 1 'FAIL ray_.*sample 0 layer D1 step 0: no tap beat'
bench 0 'PASS 24 samples' -- --samples 24 --dut "-F $work/faulty.f" --plusarg +fault=15 --no-tap -o "$work/faulty"
bench 0 'PASS 24 samples' -- --samples 24 --dut "-F $work/faulty.f" --counters each -o "$work/faulty"
scene=scene
bench 1 'FAIL counters: .*counter layer C1 step 2 spikes: expected' -- --dut "-F $work/faulty.f" --plusarg +fault=3 -o "$work/faulty"

bench 2 'no such file' -- --dut nowhere.sv -o "$work/none"
bench 2 'cannot build the block' -- --dut "-F $work/kit/rtl.f" --dut-top nowhere -o "$work/none"
bench 2 'expected 0..90' -- --stalls 91
python3 -S -E -c 'import sys; sys.argv = ["x", "a", "b"]; sys.path.insert(0, "share/cocotb"); import sf_cocotb; sys.exit(sf_cocotb.main())' 2>&1 |
  grep -q 'cocotb, .*not installed for .*pip install -r' || fail "a missing environment is not named"

if ! command -v iverilog >/dev/null; then
  echo "iverilog: not installed"
else
  scene=narrow
  # The RTL of the build, and a block of another name with a wrong neuron.
  bench 0 'PASS 12 samples of 1 rays in icarus' -- --sim icarus --samples 12 --counters each -o "$work/own"
  mkdir "$work/wrong"
  sed -f tests/dut/wrong.sed tests/dut/serial/sf_plif.sv >"$work/wrong/sf_plif.sv"
  sed 's/^module sf_top/module my_top/' rtl/sf_top.sv >"$work/wrong/my_top.sv"
  sed "s|^rtl/sf_plif.sv|$work/wrong/sf_plif.sv|; s|^rtl/sf_top.sv|$work/wrong/my_top.sv|" "$work/kit/rtl.f" >"$work/kit/wrong.f"
  bench 1 'FAIL ray_.*neuron [0-9]+ (membrane|spike): expected' -- --sim icarus --samples 12 --dut "-F $work/kit/wrong.f" --dut-top my_top -o "$work/mine"
fi
finish "the wheel's package equals the kit; the bench passes in both simulators and finds every planted fault"
