// Leaky integrator of an output layer, one step, combinational. Mirror: src/fx/integrate.c
// One unit serves density (28 bits) and colour (20 bits): only the saturation differs.
`default_nettype none

module sf_integrate (
    input  wire [27:0] acc_i,
    input  wire [27:0] in_i,
    input  wire [12:0] k_i,
    input  wire [ 1:0] mode_i,
    input  wire        first_i,
    input  wire        colour_i,
    output wire [27:0] acc_o
);
  `include "sf_round.svh"

  wire signed [47:0] a = first_i ? 48'sd0 : $signed({20'd0, acc_i});
  wire signed [47:0] x = $signed({20'd0, in_i});
  wire signed [47:0] k = $signed({35'd0, k_i});
  localparam [4:0] FRAC = 5'(sf_arch_pkg::LEAK_FRAC);
  wire signed [47:0] leaky = a + sf_rshift_round((x - a) * k, FRAC);
  wire signed [47:0] nodecay = sf_usat(a - sf_rshift_round(a * k, FRAC) + x, colour_i ? 6'd20 : 6'd28);
  assign acc_o = mode_i == sf_op_pkg::NODECAY ? nodecay[27:0]
               : mode_i == sf_op_pkg::HYBRID && first_i ? in_i : leaky[27:0];
  wire unused_ok = &{1'b0, leaky[47:28], nodecay[47:28]};
endmodule

`default_nettype wire
