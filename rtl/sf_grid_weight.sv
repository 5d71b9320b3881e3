// Trilinear weight of one corner of a cell, Q0.16, four clock cycles after its inputs, one in every cycle.
// Mirror: src/fx/grid.c (fx_grid_weights)
// The x-y product is exact; along z it splits into two parts that sum to it, so the eight weights sum to 65536.
`default_nettype none

module sf_grid_weight (
    input  wire        clk_i,
    input  wire [ 7:0] x_i,
    input  wire [ 7:0] y_i,
    input  wire [ 7:0] z_i,
    input  wire [ 2:0] corner_i,  // bit 0 = x + 1, bit 1 = y + 1, bit 2 = z + 1
    output reg  [16:0] weight_o
);
  // 1: the corner's side of the cell; 2: x-y product; 3: its part at z + 1
  reg [8:0] x1_q, y1_q;
  reg [7:0] z1_q, z2_q;
  reg [2:0] upper_q;
  reg [16:0] xy2_q, xy3_q;
  reg [24:0] product3_q;
  always_ff @(posedge clk_i) begin
    x1_q <= corner_i[0] ? {1'b0, x_i} : 9'd256 - {1'b0, x_i};
    y1_q <= corner_i[1] ? {1'b0, y_i} : 9'd256 - {1'b0, y_i};
    z1_q <= z_i;
    upper_q <= {upper_q[1:0], corner_i[2]};
    xy2_q <= 17'(x1_q) * 17'(y1_q);
    z2_q <= z1_q;
    product3_q <= 25'(xy2_q) * 25'(z2_q);
    xy3_q <= xy2_q;
  end

  // 4: half up; what is left is the part at z
  always_ff @(posedge clk_i) begin
    weight_o <= upper_q[2] ? product3_q[24:8] + {16'd0, product3_q[7]} : xy3_q - product3_q[24:8] - {16'd0, product3_q[7]};
  end
  wire unused_ok = &{1'b0, product3_q[6:0]};
endmodule

`default_nettype wire
