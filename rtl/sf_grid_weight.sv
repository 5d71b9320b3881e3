// Trilinear weights of two corners of a cell, x and x + 1, Q0.16, four clock cycles after its inputs, a pair in every
// cycle. Mirror: src/fx/grid.c (fx_grid_weights)
// The x-y products are exact; along z each splits into two parts that sum to it, so the eight weights sum to 65536.
`default_nettype none

module sf_grid_weight (
    input  wire        clk_i,
    input  wire [ 7:0] x_i,
    input  wire [ 7:0] y_i,
    input  wire [ 7:0] z_i,
    input  wire [ 1:0] pair_i,     // bit 0 = y + 1, bit 1 = z + 1
    output reg  [16:0] weight0_o,  // of x
    output reg  [16:0] weight1_o   // of x + 1
);
  // 1: the pair's side of the cell; 2: x-y products; 3: their parts at z + 1
  reg [7:0] x1_q, z1_q, z2_q;
  reg [8:0] y1_q;
  reg [2:0] upper_q;
  reg [16:0] at1_xy_q, y2_q, at0_3_q, at1_3_q;
  reg [24:0] product0_q, product1_q;
  wire [16:0] at0_xy = y2_q - at1_xy_q;
  always_ff @(posedge clk_i) begin
    x1_q <= x_i;
    y1_q <= pair_i[0] ? {1'b0, y_i} : 9'd256 - {1'b0, y_i};
    z1_q <= z_i;
    upper_q <= {upper_q[1:0], pair_i[1]};
    at1_xy_q <= 17'(x1_q) * 17'(y1_q);
    y2_q <= {y1_q, 8'd0};
    z2_q <= z1_q;
    product0_q <= 25'(at0_xy) * 25'(z2_q);
    product1_q <= 25'(at1_xy_q) * 25'(z2_q);
    at0_3_q <= at0_xy;
    at1_3_q <= at1_xy_q;
  end

  // 4: half up; what is left is the part at z
  always_ff @(posedge clk_i) begin
    weight0_o <= upper_q[2] ? product0_q[24:8] + {16'd0, product0_q[7]} : at0_3_q - product0_q[24:8] - {16'd0, product0_q[7]};
    weight1_o <= upper_q[2] ? product1_q[24:8] + {16'd0, product1_q[7]} : at1_3_q - product1_q[24:8] - {16'd0, product1_q[7]};
  end
  wire unused_ok = &{1'b0, product0_q[6:0], product1_q[6:0]};
endmodule

`default_nettype wire
