#!/bin/bash
# tools/synth.sh: a module whose cost is known by counting, for two numbers of lanes; one real module; runs are kept
# until the RTL changes; errors name their cause.   usage: synth.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
command -v yosys >/dev/null || { echo "skipped: yosys is not installed"; exit 77; }
work=$(mktemp -d "${TMPDIR:-/tmp}/spikefield-synth-XXXXXX")
trap 'rm -rf "$work"' EXIT
fail() { echo "synth: $1" >&2; tail -n 3 "$work"/*.log 2>/dev/null >&2; exit 1; }

# A multiplier with an accumulator of LANES bits behind it, a memory of 512 x LANES bits with registered read.
mkdir "$work/tree"
cp -r rtl "$work/tree"
cat >"$work/tree/rtl/sf_probe.sv" <<'SOURCE'
`default_nettype none
module sf_probe #(
    parameter LANES = 128
) (
    input  wire                    clk_i,
    input  wire                    we_i,
    input  wire [             8:0] address_i,
    input  wire [       LANES-1:0] data_i,
    input  wire signed [     15:0] a_i,
    input  wire signed [     15:0] b_i,
    output reg  [       LANES-1:0] row_o,
    output reg  signed [LANES-1:0] product_o
);
  reg [LANES-1:0] mem_q[0:511];
  always_ff @(posedge clk_i) begin
    if (we_i) mem_q[address_i] <= data_i;
    row_o <= mem_q[address_i];
    product_o <= product_o + a_i * b_i;
  end
endmodule
`default_nettype wire
SOURCE
synth() { tools/synth.sh "$work" "$@" 2>"$work/said.log"; }
column() { sed -n "s/^| \`$1\` | $2 |//p" "$work/synth/synth.md" | cut -d'|' -f"$3" | tr -d ' '; } # MODULE LANES COLUMN
expect() { # MODULE LANES COLUMN NAME VALUE
  [ "$(column "$1" "$2" "$3")" = "$5" ] || fail "$1, $2 lanes: $4 is $(column "$1" "$2" "$3"), expected $5"
}

synth --rtl "$work/tree" --modules sf_probe --lanes "32 64" >/dev/null || fail "sf_probe is not synthesised"
for lanes in 32 64; do
  expect sf_probe $lanes 4 DSP48E1 1
  expect sf_probe $lanes 8 "memory bits" $((512 * lanes))
  [ $(($(column sf_probe $lanes 5) + 2 * $(column sf_probe $lanes 6))) -eq $((lanes / 32)) ] ||
    fail "a memory of 512 x $lanes bits is not $((lanes / 32)) halves of a block"
done
# The accumulator: 32 bits fit the 48 of the multiplier's cell, 64 do not.
[ "$(column sf_probe 64 2)" -eq 64 ] || fail "the 64 bits of the accumulator are $(column sf_probe 64 2) flip-flops"
[ "$(column sf_probe 64 9)" -gt 1 ] || fail "a carry over 64 bits is no path"
synth --rtl "$work/tree" --modules sf_probe --lanes "32 64" >/dev/null
[ "$(grep -c ': kept$' "$work/said.log")" -eq 2 ] || fail "finished runs are not kept"
sed -i 's/product_o + a_i/product_o - a_i/' "$work/tree/rtl/sf_probe.sv"
synth --rtl "$work/tree" --modules sf_probe --lanes 32 --report >/dev/null && fail "a run of another RTL is reported"
grep -q "not run" "$work/said.log" || fail "the report does not say what is missing"

# The RTL of this tree, and lanes that a module does not have.
lanes=$(sed -nE 's/.*\bLANES = ([0-9]+);.*/\1/p' rtl/gen/sf_arch_pkg.sv)
synth --modules sf_scale --lanes "7 $lanes" --json >"$work/out.json" || fail "sf_scale is not synthesised"
expect sf_scale "$lanes" 4 DSP48E1 1
[ "$(column sf_scale "$lanes" 1)" -gt 50 ] || fail "sf_scale has no LUTs"
grep -q "sf_scale, 7 lanes: the module has no parameter LANES" "$work/synth/synth.md" ||
  fail "7 lanes are not refused"
if command -v python3 >/dev/null; then python3 -m json.tool "$work/out.json" >/dev/null || fail "the JSON is broken"; fi

# Errors.
refused() { # STATUS TEXT ARGS...
  local status=0
  synth "${@:3}" >/dev/null || status=$?
  [ $status -eq "$1" ] && grep -q -e "$2" "$work/said.log" ||
    fail "'${*:3}' gives $status: $(tail -n 1 "$work/said.log")"
}
refused 2 "'x' is no number of lanes" --lanes x
refused 1 "rtl/sf_nothing.sv is not there" --modules sf_nothing
sed -i 's/a_i \* b_i/a_i * /' "$work/tree/rtl/sf_probe.sv"
refused 1 "sf_probe, 32 lanes: .*sf_probe.sv:[0-9]*: ERROR: syntax error" \
  --rtl "$work/tree" --modules sf_probe --lanes 32
echo "synth: costs, kept runs and errors are as expected"
