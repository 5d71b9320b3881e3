// The sum of a density's products to the density, one in every cycle.
// Mirror: src/fx/softplus.c; src/fx/tensorf.c (fx_tensorf_activate)
//
// 1 to 4: scaled; 5: 24 bits; 6: |y|; 7: table; 8: fall; 9: its product; 10: from the table; 11: and max(y, 0); 12 to 15:
// scaled; 16: 28 bits
`default_nettype none

module sf_activation (
    input  wire               clk_i,
    input  wire signed [38:0] sum_i,      // of products, Q.16 of their LSB
    input  wire               relu_i,     // else softplus
    input  wire        [15:0] in_mul_i,   // sum to argument, Q.12
    input  wire        [ 5:0] in_shift_i,
    input  wire signed [23:0] in_bias_i,
    input  wire        [15:0] out_mul_i,  // activation, Q.20, to density
    input  wire        [ 5:0] out_shift_i,
    output reg         [27:0] sigma_o     // U16.12 per box edge, 16 cycles later
);
  wire signed [56:0] scaled4;
  sf_rescale #(
      .IN(39)
  ) u_in (
      .clk_i  (clk_i),
      .sum_i  (sum_i),
      .mul_i  (in_mul_i),
      .shift_i(in_shift_i),
      .bias_i (in_bias_i),
      .y_o    (scaled4)
  );
  wire fits4 = scaled4[56:23] == {34{scaled4[56]}};
  reg signed [23:0] y5_q, y6_q;
  reg [23:0] m6_q;
  always_ff @(posedge clk_i) begin
    y5_q <= fits4 ? scaled4[23:0] : scaled4[56] ? 24'h800000 : 24'h7fffff;
    m6_q <= y5_q[23] ? ~y5_q + 24'd1 : y5_q;
    y6_q <= y5_q;
  end

  wire [23:0] low_end;
  wire [23:0] high_end;
  sf_rom_softplus u_rom (
      .index_i(m6_q[15:8]),
      .low_o  (low_end),
      .high_o (high_end)
  );
  reg [22:0] more7_q, more8_q, more9_q, more10_q;  // max(y, 0)
  reg [23:0] low7_q, high7_q, low8_q, low9_q, t10_q;
  reg [7:0] place7_q, place8_q;
  reg [3:0] zero_q;  // beyond the table, or a ReLU, which has no second term
  reg [18:0] fall8_q;
  reg [26:0] step9_q;
  wire [26:0] rounding = step9_q - 27'd128;  // -((-a + 128) >> 8) = (a - 128) / 256, rounded up
  wire [26:0] fallen = rounding + 27'd255;
  reg [31:0] activated11_q;
  wire [24:0] tail = {1'b0, t10_q} + 25'd8;
  always_ff @(posedge clk_i) begin
    // 7
    {low7_q, high7_q, place7_q} <= {low_end, high_end, m6_q[7:0]};
    more7_q <= y6_q[23] ? 23'd0 : y6_q[22:0];
    zero_q <= {zero_q[2:0], relu_i || |m6_q[23:16]};
    // 8
    fall8_q <= 19'(low7_q - high7_q);
    {low8_q, place8_q, more8_q} <= {low7_q, place7_q, more7_q};
    // 9
    step9_q <= 27'(fall8_q) * 27'(place8_q);
    {low9_q, more9_q} <= {low8_q, more8_q};
    // 10
    t10_q <= low9_q - (step9_q < 27'd128 ? 24'd0 : {5'd0, fallen[26:8]});
    more10_q <= more9_q;
    // 11
    activated11_q <= {1'b0, more10_q, 8'd0} + (zero_q[3] ? 32'd0 : {11'd0, tail[24:4]});
  end

  wire signed [50:0] scaled15;
  sf_rescale #(
      .IN(33)
  ) u_out (
      .clk_i  (clk_i),
      .sum_i  ($signed({1'b0, activated11_q})),
      .mul_i  (out_mul_i),
      .shift_i(out_shift_i),
      .bias_i (24'sd0),
      .y_o    (scaled15)
  );
  always_ff @(posedge clk_i) sigma_o <= |scaled15[50:28] ? 28'hfffffff : scaled15[27:0];
  wire unused_ok = &{1'b0, tail[3:0], fallen[7:0]};
endmodule

`default_nettype wire
