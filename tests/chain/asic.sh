#!/bin/bash
# tools/asic_netlist.py: a module whose cells can be counted, its area, memory and longest path; the handover; kept runs;
# libraries that are refused.   usage: asic.sh BUILD
set -euo pipefail
cd "$(dirname "$0")/../.."
for tool in python3 yosys sta; do
  command -v $tool >/dev/null || { echo "skipped: $tool is not installed (make deps-asic)"; exit 77; }
done
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-asic-XXXXXX")
trap 'rm -rf "$work"' EXIT
fail() { echo "asic: $1" >&2; tail -n 3 "$work"/said.log >&2 || true; exit 1; }

# Twice a part of 8 inverted registers behind each other, and a memory of 256 x 16 bits.
mkdir -p "$work/tree/rtl/gen"
touch "$work/tree/rtl/sf_top.sv"
cat >"$work/tree/rtl/sf_part.sv" <<'SOURCE'
`default_nettype none
module sf_part #(
    parameter N = 4
) (
    input  wire         clk_i,
    input  wire [N-1:0] a_i,
    output wire [N-1:0] b_o
);
  reg [N-1:0] first_q, second_q;
  always_ff @(posedge clk_i) begin
    first_q <= a_i;
    second_q <= ~first_q;
  end
  assign b_o = second_q;
endmodule
`default_nettype wire
SOURCE
cat >"$work/tree/rtl/sf_probe.sv" <<'SOURCE'
`default_nettype none
module sf_probe #(
    parameter N = 4
) (
    input  wire         clk_i,
    input  wire         we_i,
    input  wire [  7:0] address_i,
    input  wire [ 15:0] data_i,
    output reg  [ 15:0] row_o,
    input  wire [N-1:0] a_i,
    output wire [N-1:0] b_o
);
  reg [15:0] mem_q[0:255];
  always_ff @(posedge clk_i) begin
    if (we_i) mem_q[address_i] <= data_i;
    row_o <= mem_q[address_i];
  end
  wire [N-1:0] between;
  sf_part #(
      .N(N)
  ) u_one (
      .clk_i(clk_i),
      .a_i  (a_i),
      .b_o  (between)
  );
  sf_part #(
      .N(N)
  ) u_two (
      .clk_i(clk_i),
      .a_i  (between),
      .b_o  (b_o)
  );
endmodule
`default_nettype wire
SOURCE

asic() { python3 tools/asic_netlist.py "$work" --rtl "$work/tree" "$@" 2>"$work/said.log"; }
tiny=(--liberty tests/asic/tiny.lib --modules sf_probe:N=8)
folder=$work/asic/tiny/netlist/sf_probe-N-8
result() { python3 -c 'import json, sys; r = json.load(open(sys.argv[1])); m = r["modules"]; print(eval(sys.argv[2]))' "$folder/report.json" "$1"; }
expect() { # TEXT EXPRESSION VALUE
  [ "$(result "$2")" = "$3" ] || fail "$1: $(result "$2"), expected $3"
}
asic "${tiny[@]}" >"$work/table.md" || fail "a module with two parts and a memory"
# A part: 16 registers and 8 inverters of 16 um2 each. Its longest path: a register's output rises in 60 ps, an inverter's
# falls in 10, and the next register wants it 5 ps before its clock.
expect "cells of a part" 'm["sf_part"]["cells"], m["sf_part"]["registers"], m["sf_part"]["instances"]' "(24, 16, 2)"
expect "area" 'm["sf_part"]["area_um2"], m["sf_probe"]["area_um2"], m["sf_probe"]["own_area_um2"]' "(384.0, 768.0, 0.0)"
expect "the longest path" 'm["sf_part"]["path"]["ns"], m["sf_probe"]["path"]["ns"]' "(0.075, 0.075)"
expect "cells of the longest path" 'm["sf_part"]["path"]["levels"]' 2
expect "names on the longest path" 'r["modules"]["sf_probe"]["path"]["start"].split("[")[0] in ("u_one.first_q", "u_two.first_q")' True
expect "the memory" '[(x["module"], x["count"], x["words"], x["width"], x["bits"], x["ports"]["waddr"]["bits"]) for x in r["memories"]]' \
  "[('sf_probe', 1, 256, 16, 4096, 8)]"
grep -q '^| `sf_part` | 2 | 24 | 16 | 384 |' "$work/table.md" || fail "the table lacks a part"
for file in netlist.v constraints.sdc memories.v memories.json timing.tcl config.mk; do
  [ -s "$folder/handover/$file" ] || fail "the handover has no $file"
done
(cd "$folder/handover" && LIBERTY=$OLDPWD/tests/asic/tiny.lib sta -exit timing.tcl </dev/null >"$work/sta.log" 2>&1) || fail "the handover's timing.tcl"
grep -q "slack (MET)" "$work/sta.log" || fail "the handover's timing.tcl reports no path"
asic "${tiny[@]}" >/dev/null && grep -q "kept" "$work/said.log" || fail "a finished build is not kept"
flock "$work/asic/tiny/netlist/lock" python3 tools/asic_netlist.py "$work" --rtl "$work/tree" "${tiny[@]}" >/dev/null 2>"$work/said.log" && fail "two at once in one folder"
grep -q "asic: another run is at work in $work/asic/tiny/netlist: wait" "$work/said.log" || fail "two at once: $(cat "$work/said.log")"
status=0
asic "${tiny[@]}" --clock 2000 >"$work/table.md" || status=$?
[ $status -eq 0 ] || fail "0.075 ns do not meet 2 GHz"

# One net into 8 parts with 4 NANDs each: 96 fF, of which a buffer takes 24. The netlist still computes the same.
cat >"$work/tree/rtl/sf_leaf.sv" <<'SOURCE'
module sf_leaf (input wire a_i, input wire [3:0] b_i, output wire [3:0] y_o);
  assign y_o = ~({4{a_i}} & b_i);
endmodule
SOURCE
cat >"$work/tree/rtl/sf_fan.sv" <<'SOURCE'
module sf_fan (input wire a_i, input wire [31:0] b_i, output wire [31:0] y_o);
  genvar i;
  generate
    for (i = 0; i < 8; i = i + 1) begin : g_leaf
      sf_leaf u_leaf (.a_i(a_i), .b_i(b_i[4*i+:4]), .y_o(y_o[4*i+:4]));
    end
  endgenerate
endmodule
SOURCE
asic --liberty tests/asic/tiny.lib --modules sf_fan >/dev/null || fail "a net into 8 parts"
[ "$(grep -c "BUF between_" "$work/asic/tiny/netlist/sf_fan/netlist.v")" -eq 4 ] || fail "a heavy net has $(grep -c "BUF between_" "$work/asic/tiny/netlist/sf_fan/netlist.v") buffers, not 4"
yosys -q -p "read_verilog -sv $work/tree/rtl/sf_leaf.sv $work/tree/rtl/sf_fan.sv; prep -flatten -top sf_fan; design -stash gold
  read_liberty tests/asic/tiny.lib; read_verilog $work/asic/tiny/netlist/sf_fan/netlist.v; prep -flatten -top sf_fan; design -stash gate
  design -copy-from gold -as gold sf_fan; design -copy-from gate -as gate sf_fan; equiv_make gold gate both; hierarchy -top both; equiv_simple; equiv_status -assert" >"$work/equal.log" 2>&1 || fail "the netlist with buffers computes something else"

refused() { # STATUS TEXT OPTIONS...
  local status=0
  asic "${@:3}" >/dev/null || status=$?
  [ $status -eq "$1" ] && grep -q -e "$2" "$work/said.log" || fail "'${*:3}' gives $status, not '$2'"
}
head -n 60 tests/asic/tiny.lib >"$work/bad.lib"
refused 1 "bad.lib:[0-9]*: the file ends inside" --liberty "$work/bad.lib"
sed '/area :/d' tests/asic/tiny.lib >"$work/bad.lib"
refused 1 "bad.lib:2: no cell has an area" --liberty "$work/bad.lib"
sed 's/"1ps"/"1parsec"/' tests/asic/tiny.lib >"$work/bad.lib"
refused 1 "bad.lib:4: 'time_unit' is '1parsec'" --liberty "$work/bad.lib"
refused 1 "rtl/sf_nothing.sv is not there" --liberty tests/asic/tiny.lib --modules sf_nothing
refused 1 "sf_probe.sv: the module has no parameter M" --liberty tests/asic/tiny.lib --modules sf_probe:M=3
refused 2 "is not NAME:PARAMETER=N" --liberty tests/asic/tiny.lib --modules sf_probe:N
sed -i 's/~first_q/~/' "$work/tree/rtl/sf_part.sv"
refused 1 "sf_part.sv:[0-9]*: ERROR: syntax error" "${tiny[@]}"
echo "asic: cells, area, memories, paths, the handover and errors are as expected"
