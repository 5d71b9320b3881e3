// A current to the argument of a table. Mirror: src/fx/integrate.c (fx_exp2_argument, fx_sigmoid_argument)
`default_nettype none

module sf_scale (
    input  wire signed [15:0] current_i,
    input  wire        [15:0] mul_i,
    input  wire        [ 4:0] shift_i,
    input  wire signed [31:0] bias_i,
    input  wire               colour_i,  // sat to s16, else s18
    output wire signed [17:0] y_o
);
  `include "sf_round.svh"

  wire signed [47:0] product = 48'(current_i) * $signed({32'd0, mul_i});
  wire signed [47:0] y = sf_sat(sf_rshift_round(product, shift_i) + 48'(bias_i), colour_i ? 6'd16 : 6'd18);
  assign y_o = y[17:0];
  wire unused_ok = &{1'b0, y[47:18]};
endmodule

`default_nettype wire
