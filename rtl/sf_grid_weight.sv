// Trilinear weight of one corner of a cell, Q0.16, combinational. Mirror: src/fx/grid.c (fx_grid_weights)
// The x-y product is exact; along z it splits into two parts that sum to it, so the eight weights sum to 65536.
`default_nettype none

module sf_grid_weight (
    input  wire [ 7:0] x_i,
    input  wire [ 7:0] y_i,
    input  wire [ 7:0] z_i,
    input  wire [ 2:0] corner_i,  // bit 0 = x + 1, bit 1 = y + 1, bit 2 = z + 1
    output wire [16:0] weight_o
);
  `include "sf_round.svh"

  wire [8:0] x = corner_i[0] ? {1'b0, x_i} : 9'd256 - {1'b0, x_i};
  wire [8:0] y = corner_i[1] ? {1'b0, y_i} : 9'd256 - {1'b0, y_i};
  wire [16:0] xy = 17'(x) * 17'(y);
  wire [24:0] product = 25'(xy) * 25'(z_i);
  wire signed [47:0] upper = sf_rshift_round($signed({23'd0, product}), 5'd8);
  assign weight_o = corner_i[2] ? upper[16:0] : xy - upper[16:0];
  wire unused_ok = &{1'b0, upper[47:17]};
endmodule

`default_nettype wire
