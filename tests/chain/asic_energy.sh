#!/bin/bash
# tools/asic_energy.py: energies of known edges against a sum made by hand, blocks of the RTL in cells of a small library,
# kept runs, and libraries that are refused.   usage: asic_energy.sh BUILD
. "$(dirname "$0")/../small_scene.bash"
for tool in python3 yosys iverilog; do
  command -v $tool >/dev/null || { echo "skipped: $tool is not installed"; exit 77; }
done
here=$root/tests/asic
python3 "$here/by_hand.py" "$here/tiny.lib" "$work" || fail "energies by hand"

mkdir "$work/build" && ln -s "$build/bin" "$work/build/bin"
asic() { # OPTIONS...
  python3 "$root/tools/asic_energy.py" "$work/build" --scene "$work/scene.snn" --data "$work/data" --cycles 520 "$@" \
    >"$work/said.md" 2>"$work/said.log"
}
result() { python3 -c 'import json, sys; r = json.load(open(sys.argv[1])); print(eval(sys.argv[2]))' "$work/build/asic/$1/energy.json" "$2"; }
plain=(--liberty "$here/tiny.lib" --node 100 --gating off)

# What the field's cache is asked for in a scene.
[ "$("$build/asic/lookups" "$work/scene.snn" "$work/data" 7 2>"$work/said.log" | grep -Ec '^[01] [0-9a-f]{8} [0-9a-f]{8}$')" -eq 7 ] || fail "look-ups of a scene"

# The neuron unit and an adder in inverters, NANDs and registers: computes what the RTL did, and costs something plausible.
if asic "${plain[@]}" --blocks "neuron add8"; then
  [ "$(result tiny 'r["blocks"]["neuron"]["compared"] > 0.99')" = True ] || fail "the neuron's outputs are not compared"
  [ "$(result tiny 'r["blocks"]["neuron"]["registers"] > 200')" = True ] || fail "the neuron has few registers"
  # Eight of each operand's bits and of the sum's change half of the time or so, and each costs its net and cells.
  [ "$(result tiny '200 < r["prices"][1]["fj"] < 20000 and [p["key"] for p in r["prices"]] == ["neuron_update", "int_add.8"]')" = True ] ||
    fail "prices $(result tiny '[(p["key"], p["fj"]) for p in r["prices"]]')"
  grep -q '^| `neuron` |' "$work/said.md" || fail "the table lacks a block"
else
  fail "a small library: $(tail -n 1 "$work/said.log")"
fi
# Every block stands where its operands are looked for: its events, its ports of the RTL.
"$build/bin/sf_cosim" "$work/scene.snn" "$work/data" --rays 4 --seed 1 --vcd "$work/recording.vcd" --window 0,9 --quiet >/dev/null || fail "sf_cosim --vcd"
python3 - "$root" "$work/recording.vcd" >"$work/said.log" 2>&1 <<'PYTHON' || fail "blocks in the recording: $(tail -n 1 "$work/said.log")"
import re, sys
root, recording = sys.argv[1:]
sys.path.insert(0, root + "/tools")
from asic import pieces, record
pieces = [piece for piece in pieces.all_pieces(root) if piece.scope]
assert len(pieces) >= 14, len(pieces)
wanted = {name for piece in pieces for name in piece.events}
for piece in pieces:
    if isinstance(piece, type(pieces[-1])):
        wanted |= set(piece.wanted(None))
        continue
    with open(f"{root}/rtl/{piece.module}.sv", encoding="utf-8") as source:
        header = source.read().split(");", 1)[0]
    ports = re.findall(r"^ +(?:input|output) .*?(\w+),?(?: *//.*)?$", header, re.MULTILINE)
    assert len(ports) > 2, piece.module
    wanted |= {piece.place(name) for name in ports if not name.startswith("tap_")}
record.read_vcd(recording, wanted, "sf_top.clk_i", 1)
PYTHON
cp "$work/build/asic/tiny/neuron.json" "$work/first.json"
asic "${plain[@]}" --blocks "neuron add8" && grep -q "neuron: kept" "$work/said.log" || fail "a finished block is not kept"
sed 's/"11, 13"/"111, 113"/' "$here/tiny.lib" >"$work/dear.lib"
asic --liberty "$work/dear.lib" --node 100 --gating off --blocks neuron --json || fail "a library of dear clocks"
! grep -q "kept" "$work/said.log" || fail "a block of another library is kept"
# Each register's clock rises once a cycle, 100 fJ dearer.
more=$(python3 -c 'import json, sys
a, b = (json.load(open(name)) for name in sys.argv[1:])
print(abs(b["busy"]["fj"] - a["busy"]["fj"] - 100 * a["registers"] * a["cycles"]) < 1e-6 * b["busy"]["fj"])' "$work/first.json" "$work/build/asic/tiny/neuron.json")
[ "$more" = True ] || fail "the clock's price does not reach the neuron's"

refused() { # STATUS TEXT OPTIONS...
  local status=0
  asic "${@:3}" || status=$?
  [ $status -eq "$1" ] && grep -q -e "$2" "$work/said.log" || fail "'${*:3}' gives $status: $(tail -n 1 "$work/said.log"), not '$2'"
}
changed() { sed "$1" "$here/tiny.lib" >"$work/bad.lib"; } # SED
bad=(--liberty "$work/bad.lib" --node 100 --gating off --blocks add8)
head -n 60 "$here/tiny.lib" >"$work/bad.lib"
refused 1 "bad.lib:[0-9]*: the file ends inside .*, which line [0-9]* opens: is it cut off" "${bad[@]}"
gzip -c "$here/tiny.lib" | head -c 500 >"$work/bad.lib"
refused 1 "bad.lib: the packed file is damaged or cut off" "${bad[@]}"
changed 's/internal_power/other_power/'
refused 1 "bad.lib:2: no cell has tables of internal power" "${bad[@]}"
changed '/cell (NAND)/,/cell (NOR)/s/internal_power/other_power/'
refused 1 "bad.lib:[0-9]*: cell 'NAND' has no tables of internal power" "${bad[@]}"
changed 's/"1ps"/"1parsec"/'
refused 1 "bad.lib:4: 'time_unit' is '1parsec', not 1, 10 or 100 of" "${bad[@]}"
changed 's/(1, ff)/(1, farad)/'
refused 1 "bad.lib:7: 'capacitive_load_unit' is '1, farad', not a number of ff or pf" "${bad[@]}"
changed '/voltage_unit/d'
refused 1 "bad.lib:2: the library does not say its 'voltage_unit'" "${bad[@]}"
changed 's/"10, 30", "60, 80"/"10, 30", "60"/'
refused 1 "bad.lib:[0-9]*: 'rise_power' has 3 values, its indices ask for 4" "${bad[@]}"
changed 's/"8, 8", "28, 28"/"8, 8", "28, many"/'
refused 1 "bad.lib:[0-9]*: 'values' of 'rise_power' holds 'many', not a number" "${bad[@]}"
refused 1 "no clock gate, and no latch, inverter and AND to make one of; --gating off" --liberty "$here/tiny.lib" --node 100 --blocks neuron
refused 2 "'tiny'. tells no feature size; say it" --liberty "$here/tiny.lib"
refused 1 "nothing.lib: not there" --liberty "$work/nothing.lib"
refused 2 "none of 'nothing' is one of" "${plain[@]}" --blocks nothing
refused 2 "at least 512" "${plain[@]}" --cycles 100
exec 9>"$work/build/asic/lock" && flock 9
refused 1 "another run is at work in $work/build/asic: wait for it" "${plain[@]}" --blocks add8
exec 9>&-
finish "asic_energy: energies are those made by hand, netlists compute what the RTL did, errors name their cause"
