#!/bin/bash
# tools/netlist_check.py on one module, in ECP5 cells and in standard cells: the kit's vectors with 0 differences, planted errors
# found and located; a netlist that differs; kept runs; a memory and two products in the models of our own; errors.   usage: netlist.sh BUILD
set -euo pipefail
cd "$(dirname "$0")/../.."
for tool in python3 yosys iverilog; do
  command -v $tool >/dev/null || { echo "skipped: $tool is not installed (make deps)"; exit 77; }
done
build=$(cd "${1:?usage: netlist.sh BUILD}" && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-netlist-XXXXXX")
trap 'rm -rf "$work"' EXIT
fail() { echo "netlist: $1" >&2; tail -n 3 "$work"/said.log "$work"/table.md >&2 2>/dev/null || true; exit 1; }

ln -s "$build/bin" "$work/bin"
check() { python3 tools/netlist_check.py "$work" --debian --simulator icarus --samples 3 --modules sf_plif "$@" >"$work/table.md" 2>"$work/said.log"; }
expect() { # TEXT EXPRESSION OF r, THE FIRST RESULT
  python3 -c 'import json, sys; r = next(iter(json.load(open(sys.argv[1])).values())); sys.exit(not eval(sys.argv[2]))' "$work/netlist/netlist.json" "$2" || fail "$1"
}

# The kit's verdict, and an inverted register found with its sample, layer, step, neuron and signal.
for cells in "ecp5 --plant 2" "liberty --liberty tests/asic/tiny.lib --plant 1"; do
  # shellcheck disable=SC2086
  check --cells $cells || fail "$cells: the netlist of a neuron unit"
  expect "$cells: not 3 samples" 'r["passed"] and r["samples"] == 3 and r["said"].startswith("PASS 3 samples")'
  expect "$cells: no cells" 'r["counts"]["cells"] > 500 and r["counts"]["registers"] >= 200'
  expect "$cells: planted errors" 'len(r["planted"]) >= 1 and all(e["found"] for e in r["planted"])'
  expect "$cells: where" 'all("DIFFERENCE sample 0 layer" in e["said"] and " neuron " in e["said"] for e in r["planted"])'
done

flock "$work/netlist/lock" python3 tools/netlist_check.py "$work" --debian --modules sf_plif >/dev/null 2>"$work/said.log" && fail "two at once in one folder"
grep -q "netlist: another run is at work in $work/netlist: wait" "$work/said.log" || fail "two at once: $(cat "$work/said.log")"

# A register that holds or adds to what it has is not drawn while there are others: its inverse may undo itself.
python3 - "$work/netlist/ecp5/sf_plif" <<'PYTHON' || fail "which registers get an error"
import json, os, sys
sys.path.insert(0, "tools")
from netlist import plant
def cell(kind, **pins):
    return {"type": kind, "port_directions": {pin: "output" if pin in "QZ" else "input" for pin in pins}, "connections": {pin: [bit] for pin, bit in pins.items()}}
cells = {"a": cell("FF", DI=1, Q=2), "b": cell("LUT4", A=2, B=3, Z=1), "c": cell("FF", DI=2, Q=3)}
folder = os.path.join(sys.argv[1], "states")
os.makedirs(folder)
with open(os.path.join(folder, "netlist.json"), "w", encoding="utf-8") as file:
    json.dump({"modules": {"top": {"cells": cells, "netnames": {"held": {"bits": [2]}, "passed": {"bits": ["0", 3]}}}}}, file)
states = plant.States(folder, {"FF": "DI"})
assert states.own("held") and not states.own("passed[1]") and not states.own("passed[0]"), "own"
import netlist_check
hit, miss = {"found": True}, {"found": False}
for passed, planted, failed in (True, [], False), (True, [miss, hit], False), (True, [miss], True), (False, [hit], True):
    assert netlist_check.failed({"passed": passed, "planted": planted}) == failed, (passed, planted)
places = [("held", 0, 1), ("_1_", 2, 3), ("passed[1]", 4, 5)]
for seed in range(9):
    assert plant.choose(places, states.own, 1, seed) == [places[2]] and plant.choose(places, states.own, 2, seed) == [places[2], places[0]], seed
PYTHON
# A netlist with planted errors, none of them turned on, is the netlist.
(cd "$work/netlist/kit-3" && make -s icarus SOURCES="$(sed "/^+/d; s|^|$work/netlist/ecp5/sf_plif/|; s|/netlist\.v$|/planted.v|" "$work/netlist/ecp5/sf_plif/netlist.f" | tr '\n' ' ')" \
  RTL="$work/netlist/ecp5/sf_plif/rtl" LANES=32 BUILD="$work/none") >"$work/table.md" 2>&1 || fail "a netlist with errors to turn on, none of them on, differs"

# The second time nothing is mapped.
check --cells ecp5 --plant 0 --samples 1
grep -q "in ecp5: the netlist is kept" "$work/said.log" || fail "a finished netlist was made again"
sed -i 's/ LUT4 #/ NOT_A_CELL #/' "$work/netlist/ecp5/sf_plif/netlist.v"
! check --cells ecp5 --plant 0 --samples 1 || fail "a netlist of an unknown cell passed"

# The shell of the whole accelerator: the source names two defaults of TAP, the netlist has one.
python3 - "$work" <<'PYTHON' || fail "the shell of sf_top"
import os, sys
sys.path.insert(0, "tools")
from netlist import shell
os.symlink(os.path.abspath("rtl"), os.path.join(sys.argv[1], "rtl"))
for parameters, tap in (({"LANES": "32"}, "1"), ({"LANES": "32", "TAP": "0"}, "0")):
    shell.write_shell("sf_top", parameters, ["clk_i", "tap_valid_o"], sys.argv[1])
    with open(os.path.join(sys.argv[1], "shell.sv"), encoding="utf-8") as file:
        said = [line.strip() for line in file if "another TAP" in line]
    assert [line.split('"')[0] for line in said] == [f"`SF_REFUSE(TAP != ({tap}), "], said
PYTHON

# What is wrong is named.
refused() { # TEXT OPTIONS...
  local text=$1
  shift
  ! check "$@" || fail "not refused: $*"
  grep -q "$text" "$work/said.log" || fail "'$text' is not said of $*"
  [ "$(wc -l <"$work/said.log")" -le 3 ] || fail "more than a line about $*"
}
head -c 300 tests/asic/tiny.lib >"$work/cut.lib"
refused "cut.lib" --cells liberty --liberty "$work/cut.lib"
refused "nowhere.lib" --cells liberty --liberty "$work/nowhere.lib"
refused "no_such" --cells ecp5 --modules no_such
echo "netlist: ok"
