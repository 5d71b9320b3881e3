// Lines of 16 components, those of two neighbours at a time, to products of plane and line, a block of 16 at a time.
// Mirror: src/fx/tensorf_isa.h (vm_pair)
//
// 1: entries; 2: times their weights; 3: the sum of both; 4: sums of a block, P of its plane and L of its line; 5: P and L of
// a block that is whole; 6: their products
`default_nettype none

module sf_planes_mix (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    input  wire         valid_i,
    input  wire [127:0] entries0_i,    // signed bytes
    input  wire [127:0] entries1_i,
    input  wire [ 16:0] weight0_i,     // and the rest: as sf_planes_reads
    input  wire [ 16:0] weight1_i,
    input  wire         of_line_i,
    input  wire         first_i,
    input  wire         last_i,
    input  wire [  1:0] block_i,
    input  wire [  1:0] pair_i,
    input  wire         appearance_i,
    input  wire         end_i,
    output wire         valid_o,
    output wire [495:0] products_o,    // 16 signed numbers of 31 bits, Q.16 of the LSB of their product
    output wire [  1:0] block_o,
    output wire [  1:0] pair_o,
    output wire         appearance_o,
    output wire         end_o
);
  reg [4:0] valid_q, whole_q;  // of stages 1 to 5
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid_q <= 5'd0;
    else if (clear_i) valid_q <= 5'd0;
    else valid_q <= {valid_q[3] && whole_q[3], valid_q[2:0], valid_i};
  end
  reg done_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) done_q <= 1'b0;
    else done_q <= valid_q[4] && !clear_i;
  end

  localparam integer TAG = 6;  // {end, appearance, pair, block}
  reg [127:0] near_q, beside_q;
  reg [16:0] near_weight_q, beside_weight_q;
  reg of_line1_q, first1_q, of_line2_q, first2_q, of_line3_q, first3_q;
  reg [TAG-1:0] tag1_q, tag2_q, tag3_q, tag4_q, tag5_q, tag6_q;
  always_ff @(posedge clk_i) begin
    {near_q, near_weight_q, of_line1_q, first1_q} <= {entries0_i, weight0_i, of_line_i, first_i};
    {beside_q, beside_weight_q} <= {entries1_i, weight1_i};
    whole_q <= {1'b1, whole_q[2:0], last_i};
    tag1_q <= {end_i, appearance_i, pair_i, block_i};
    {tag2_q, of_line2_q, first2_q} <= {tag1_q, of_line1_q, first1_q};
    {tag3_q, of_line3_q, first3_q} <= {tag2_q, of_line2_q, first2_q};
    {tag4_q, tag5_q, tag6_q} <= {tag3_q, tag4_q, tag5_q};
  end

  wire plane_write = valid_q[2] && !of_line3_q;
  wire line_write = valid_q[2] && of_line3_q;
  genvar c;
  generate
    for (c = 0; c < 16; c = c + 1) begin : g_component
      wire signed [7:0] near = near_q[8*c+:8];
      wire signed [7:0] beside = beside_q[8*c+:8];
      reg signed [23:0] near2_q, beside2_q, part3_q;
      reg signed [23:0] plane_q[0:3], plane4_q;
      reg signed [16:0] line_q[0:3], line4_q;
      reg signed [15:0] p5_q, l5_q;
      reg signed [30:0] product6_q;
      wire signed [23:0] plane = first3_q ? part3_q : plane_q[tag3_q[1:0]] + part3_q;
      wire signed [16:0] line = first3_q ? part3_q[16:0] : line_q[tag3_q[1:0]] + part3_q[16:0];
      always_ff @(posedge clk_i) begin
        near2_q <= 24'(near * $signed({1'b0, near_weight_q}));
        beside2_q <= 24'(beside * $signed({1'b0, beside_weight_q}));
        part3_q <= near2_q + beside2_q;
        if (plane_write) plane_q[tag3_q[1:0]] <= plane;
        if (line_write) line_q[tag3_q[1:0]] <= line;
        plane4_q <= plane_q[tag3_q[1:0]] + 24'sd128;
        line4_q <= line;
        p5_q <= plane4_q[23:8];
        l5_q <= line4_q[15:0];
        product6_q <= 31'(p5_q * l5_q);
      end
      assign products_o[31*c+:31] = product6_q;
      wire unused_ok = &{1'b0, plane4_q[7:0], line4_q[16]};
    end
  endgenerate
  assign valid_o = done_q;
  assign {end_o, appearance_o, pair_o, block_o} = tag6_q;
  wire unused_ok = &{1'b0, whole_q[4]};
endmodule

`default_nettype wire
