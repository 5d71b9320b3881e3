#!/usr/bin/env bash
# tools/fpga.py: a module whose cost is known by counting, placed and routed; its longest path and its cycles; runs are
# kept until the RTL changes; errors name their cause.   usage: fpga.sh BUILD
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$1
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-fpga-XXXXXX")
trap 'rm -rf "$work"' EXIT
fail() { echo "fpga: $1" >&2; tail -n 3 "$work"/said.log >&2 || true; exit 1; }

# Two products of 16 x 16 bits, a memory of 512 rows of N 32-bit words, whose output is the slowest in the device, a sum of 64 bits.
mkdir -p "$work/tree/rtl/gen" "$work/fpga"
touch "$work/tree/rtl/sf_ray_top.sv"
cat >"$work/tree/rtl/sf_probe.sv" <<'SOURCE'
`default_nettype none
module sf_probe #(
    parameter N = 1
) (
    input  wire               clk_i,
    input  wire               rst_ni,
    input  wire               we_i,
    input  wire        [ 8:0] address_i,
    input  wire        [31:0] data_i,
    input  wire signed [15:0] a_i,
    input  wire signed [15:0] b_i,
    output reg         [32*N-1:0] row_o,
    output reg  signed [31:0] first_o,
    output reg  signed [31:0] second_o,
    output wire        [63:0] sum_o
);
  genvar i;
  generate
    for (i = 0; i < N; i = i + 1) begin : g_word
      reg [31:0] mem_q[0:511];
      always_ff @(posedge clk_i) begin
        if (we_i) mem_q[address_i] <= data_i;
        row_o[32*i+:32] <= mem_q[address_i];
      end
    end
  endgenerate
  reg [63:0] sum_q;
  assign sum_o = sum_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) sum_q <= 64'd0;
    else sum_q <= sum_q + {data_i, a_i, b_i};
  end
  always_ff @(posedge clk_i) begin
    first_o <= a_i * b_i;
    second_o <= a_i * a_i;
  end
endmodule
`default_nettype wire
SOURCE

ln -s "$(realpath "$build")/bin" "$work/bin"
fpga() { python3 tools/fpga.py "$work" --debian --venv "$build/fpga/venv" --rtl "$work/tree" "$@" 2>"$work/said.log"; }
field() { # BUILD EXPRESSION OF r
  python3 -c 'import json, sys; r = json.load(open(sys.argv[1]))[sys.argv[2]]; v = eval(sys.argv[3]); print(*(v if isinstance(v, tuple) else [v]))' "$work/fpga/fpga.json" "$1" "$2"
}

status=0
fpga --modules "sf_probe:N=3" >"$work/table.md" || status=$?
if [ $status -eq 77 ]; then echo "skipped: $(tail -n 2 "$work/said.log" | head -n 1)"; exit 77; fi
[ $status -eq 0 ] || fail "sf_probe is not placed and routed"
name=sf_probe-N-3
flock "$work/fpga/lock" python3 tools/fpga.py "$work" --debian --venv "$build/fpga/venv" --rtl "$work/tree" --modules sf_probe:N=3 >/dev/null 2>"$work/said.log" &&
  fail "two at once in one folder"
grep -q "fpga: another run is at work in $work/fpga: wait" "$work/said.log" || fail "two at once: $(cat "$work/said.log")"
[ "$(field $name 'r["multipliers"], r["block_rams"]')" = "2 3" ] || fail "2 products and 3 block RAMs became $(field $name 'r["multipliers"], r["block_rams"]')"
# sum, both products; the wrapper's 74 inputs and 224 outputs, its reset; the rows lie in the RAM's own registers.
[ "$(field $name 'r["wrapper_bits"]')" -eq 298 ] || fail "the wrapper has $(field $name 'r["wrapper_bits"]') flip-flops"
least=$((64 + 64 + 298 + 1)) # the tools may double one with many readers
[ "$(field $name "$least <= r['flip_flops'] <= $least + 4")" = True ] || fail "$(field $name 'r["flip_flops"]') flip-flops, not $least"
[ "$(field $name 'r["logic_available"], r["multipliers_available"], r["block_rams_available"]')" = "83640 156 208" ] ||
  fail "the device is not an LFE5U-85F"
[ "$(field $name '40 < r["f_max_mhz"] < 400 and abs(1000 / r["critical_path"]["ns"] / r["f_max_mhz"] - 1) < 0.05')" = True ] ||
  fail "f_max and the longest path do not belong together"
[ "$(field $name '[n for n in r["critical_path"]["names"] if "mem_q" in n] == ["g_word.mem_q"]')" = True ] ||
  fail "the longest path is named $(field $name 'r["critical_path"]["names"]')"
grep -q "sf_probe-N-3.*LFE5U-85F-6.*2 (1 %)" "$work/table.md" || fail "the table lacks the module"

fpga --modules "sf_probe:N=3" >/dev/null
! grep -q "synthesis\|route" "$work/said.log" || fail "a finished run is not kept"
sed -i 's/a_i \* a_i/a_i * (a_i + b_i)/' "$work/tree/rtl/sf_probe.sv"
fpga --modules "sf_probe:N=3" --synthesis >/dev/null
grep -q "synthesis took [1-9][0-9]* s of processor time, [0-9]* s by the clock" "$work/said.log" || fail "a run of another RTL is kept, or its time is not said"

refused() { # STATUS TEXT ARGS...
  local status=0
  fpga "${@:3}" >/dev/null || status=$?
  [ $status -eq "$1" ] && grep -q -e "$2" "$work/said.log" || fail "'${*:3}' gives $status, not '$2'"
}
refused 1 "rtl/sf_nothing.sv is not there" --modules sf_nothing
refused 2 "is not NAME:PARAMETER=N" --modules sf_probe:N
refused 2 "go together" --scene nothing.snn
sed -i 's/a_i \* b_i/a_i * /' "$work/tree/rtl/sf_probe.sv"
refused 1 "sf_probe.sv:[0-9]*:.*syntax error" --modules sf_probe
echo "fpga: costs, the longest path, kept runs and errors are as expected"
