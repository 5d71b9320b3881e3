#!/usr/bin/env bash
# tools/board.py on a board of a few flip-flops: a bitstream; a clock that is too fast for it gives none and status 1; errors name
# their cause. The files for Vivado are read by a linter that sees planted faults.   usage: board_flow.sh BUILD
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$(realpath "$1")
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-board-XXXXXX")
trap 'rm -rf "$work"' EXIT
fail() { echo "board_flow: $1" >&2; tail -n 3 "$work"/said.log >&2 || true; exit 1; }

# ---- Vivado's
command -v tclsh >/dev/null || { echo "skipped: tclsh is not installed"; exit 77; }
lint() { tclsh tests/board/vivado_lint.tcl "$work/tree/rtl/board/nexys_video" >"$work/said.log" 2>&1; }
mkdir -p "$work/tree" && cp -r rtl "$work/tree/"
xdc=$work/tree/rtl/board/nexys_video/nexys_video.xdc
lint || fail "Vivado's files"
planted() { # TEXT SED-SCRIPT FILE
  cp "$3" "$work/kept"
  sed -i "$2" "$3"
  ! lint && grep -q -e "$1" "$work/said.log" || fail "a planted fault is not seen: $2"
  cp "$work/kept" "$3"
}
planted "port uart_tx_in has no pin" '/uart_tx_in\]$/{/PACKAGE_PIN/d}' "$xdc"
planted "pin R4 is given to clk_100mhz and cpu_resetn" 's/G4/R4/' "$xdc"
planted "port led\[8\] is not one" 's/led\[7\]/led[8]/' "$xdc"
planted "no clock" '/create_clock/d' "$xdc"
planted "does not read the board's RTL" 's/rtl board\]/rtl gen]/' "$work/tree/rtl/board/nexys_video/vivado.tcl"
planted "vivado.tcl: .*missing close-brac" 's/write_bitstream -force \[/write_bitstream -force [[/' "$work/tree/rtl/board/nexys_video/vivado.tcl"

# ---- Yosys, nextpnr, ecppack
own=$work/tree/rtl/board/small
mkdir -p "$own"
sed -E 's/module ulx3s/module small/; /^  wire \[3:0\] lamps;/d; s/\.lamps_i\(lamps\)/.lamps_i(sum_q[3:0])/; /^  sf_board #/,/\);/d; /^  wire unused_ok/d' rtl/board/ulx3s/ulx3s.sv |
  sed '/^  sf_board_start/i\  reg [15:0] sum_q;\n  always_ff @(posedge clock) if (reset_n) sum_q <= sum_q * sum_q + {15'"'"'d0, ftdi_txd};\n  assign ftdi_rxd = sum_q[15];' >"$own/small.sv"
grep -q 'lamps_i(sum_q' "$own/small.sv" && grep -q 'assign ftdi_rxd = sum_q' "$own/small.sv" || fail "ulx3s.sv is not what this test makes a small board of"
cp rtl/board/ulx3s/ulx3s.lpf "$own/"
describe() { printf '{"name": "a small board", "top": "small", "device": "%s", "package": "CABGA381", "speed": "6", "mhz": %s, "pins": "ulx3s.lpf", "load": "load it"}' "$1" "$2" >"$own/board.json"; }
board() { python3 tools/board.py "$work" --debian --venv "$build/fpga/venv" --rtl "$work/tree" --board "$@" >"$work/out.log" 2>"$work/said.log"; }
refused() { # STATUS TEXT BOARD
  local status=0
  board "$3" || status=$?
  [ $status -eq "$1" ] && grep -q -e "$2" "$work/said.log" || fail "board $3 gives $status, not '$2'"
}
describe 25k 50
status=0
board small || status=$?
if [ $status -eq 77 ]; then echo "skipped: $(tail -n 2 "$work/said.log" | head -n 1)"; exit 77; fi
[ $status -eq 0 ] || fail "no bitstream"
[ "$(wc -c <"$work/board/small/small.bit")" -gt 50000 ] || fail "the bitstream is too small"
grep -q "clock 50 MHz, [0-9.]* MHz after routing" "$work/out.log" || fail "the frequency is not said"
grep -q "put it on the board: load it .*small.bit" "$work/out.log" || fail "the command is not said"
board small && ! grep -q "took" "$work/said.log" || fail "a finished run is not kept"
exec 9>"$work/board/small/lock" && flock 9
refused 1 "board: another run is at work in $work/board/small: wait for it" small
exec 9>&-
rm "$work/board/small/small.bit"
sed -i 's/CLKOP_DIV       (12)/CLKOP_DIV       (2)/; s/CLKOP_CPHASE    (5)/CLKOP_CPHASE    (1)/; s/CLKFB_DIV       (2)/CLKFB_DIV       (14)/; s/sum_q \* sum_q/sum_q * sum_q * sum_q/' "$own/small.sv"
describe 25k 350
refused 1 "a small board: [0-9.]* MHz after routing, its clock has 350 MHz: no bitstream was made" small
[ ! -e "$work/board/small/small.bit" ] || fail "there is a bitstream that is too slow"
[ "$(grep -c "small: seed [123]: [0-9.]* MHz after routing, its clock has 350 MHz" "$work/said.log")" -eq 3 ] || fail "not three placements"
board small --seed 5 || true
[ "$(grep -o "place and route, seed [0-9]*" "$work/said.log" | sort -u)" = "place and route, seed 5" ] || fail "not the placement of seed 5 alone"
refused 2 "there is no board nothing: .*board.json: No such file" nothing

# A board for Vivado: what it needs. Three flip-flops and a multiplier twice, in a module that is there twice.
other=$work/tree/rtl/board/other
mkdir -p "$other"
sed 's/nexys_video/other/g' rtl/board/nexys_video/vivado.tcl >"$other/vivado.tcl"
cat >"$other/other.sv" <<'SOURCE'
module other_part (input wire clk_i, input wire signed [15:0] a_i, output reg signed [31:0] b_o);
  always_ff @(posedge clk_i) b_o <= a_i * a_i;
endmodule
module other (input wire clk_i, input wire [15:0] a_i, output wire [63:0] b_o, output reg [2:0] c_o);
  always_ff @(posedge clk_i) c_o <= {c_o[1:0], ^a_i};
  other_part u_one (.clk_i(clk_i), .a_i(a_i), .b_o(b_o[31:0]));
  other_part u_two (.clk_i(clk_i), .a_i(~a_i), .b_o(b_o[63:32]));
endmodule
SOURCE
board other || fail "the table of a board for Vivado"
expect() { python3 -c 'import json, sys; m = json.load(open(sys.argv[1]))["modules"]; sys.exit(not eval(sys.argv[2]))' "$work/board/other/resources.json" "$1" || fail "not so: $1"; }
expect 'm["other"]["DSP48E1"] == 2 and m["other"]["FF"] == 3 and m["other_part"]["instances"] == 2 and m["other_part"]["DSP48E1"] == 2'
grep -q '^| `other` | 1 | .* 2 (0 %) |' "$work/out.log" || fail "the table of a board for Vivado lacks its top"
grep -q "the bitstream is Vivado's: vivado -mode batch -source rtl/board/other/vivado.tcl" "$work/out.log" || fail "Vivado's command is not said"
sed -i 's/xc7a200t/xc7z010t/' "$other/vivado.tcl"
refused 1 "vivado.tcl: no .set part. of xc7a200t" other
describe 99k 50
refused 1 "board.json: device is 99k, expected one of 25k, 45k, 85k" small
echo "board_flow: a bitstream, a clock that is not met, and planted faults of both flows are as expected"
