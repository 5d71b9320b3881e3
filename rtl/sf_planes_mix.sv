// Lines of 16 components to products of plane and line, a block of 16 at a time. Mirror: src/fx/tensorf_isa.h (vm_pair)
//
// 1: entries; 2: times their weight; 3: sums of a block, P of its plane and L of its line; 4: P and L of a block that is
// whole; 5: their products
`default_nettype none

module sf_planes_mix (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    input  wire         valid_i,
    input  wire [127:0] entries_i,     // signed bytes
    input  wire [ 16:0] weight_i,      // and the rest: as sf_planes_reads
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
  reg [3:0] valid_q, whole_q;  // of stages 1 to 4
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid_q <= 4'd0;
    else if (clear_i) valid_q <= 4'd0;
    else valid_q <= {valid_q[2] && whole_q[2], valid_q[1:0], valid_i};
  end
  reg done_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) done_q <= 1'b0;
    else done_q <= valid_q[3] && !clear_i;
  end

  localparam integer TAG = 6;  // {end, appearance, pair, block}
  reg [127:0] entries1_q;
  reg [16:0] weight1_q;
  reg of_line1_q, first1_q, of_line2_q, first2_q;
  reg [TAG-1:0] tag1_q, tag2_q, tag3_q, tag4_q, tag5_q;
  always_ff @(posedge clk_i) begin
    {entries1_q, weight1_q, of_line1_q, first1_q} <= {entries_i, weight_i, of_line_i, first_i};
    whole_q <= {1'b1, whole_q[1:0], last_i};
    tag1_q <= {end_i, appearance_i, pair_i, block_i};
    {tag2_q, of_line2_q, first2_q} <= {tag1_q, of_line1_q, first1_q};
    {tag3_q, tag4_q, tag5_q} <= {tag2_q, tag3_q, tag4_q};
  end

  wire plane_write = valid_q[1] && !of_line2_q;
  wire line_write = valid_q[1] && of_line2_q;
  genvar c;
  generate
    for (c = 0; c < 16; c = c + 1) begin : g_component
      wire signed [7:0] entry = entries1_q[8*c+:8];
      reg signed [23:0] part2_q;
      reg signed [23:0] plane_q[0:3], plane3_q;
      reg signed [16:0] line_q[0:3], line3_q;
      reg signed [15:0] p4_q, l4_q;
      reg signed [30:0] product5_q;
      wire signed [23:0] plane = first2_q ? part2_q : plane_q[tag2_q[1:0]] + part2_q;
      wire signed [16:0] line = first2_q ? part2_q[16:0] : line_q[tag2_q[1:0]] + part2_q[16:0];
      always_ff @(posedge clk_i) begin
        part2_q <= 24'(entry * $signed({1'b0, weight1_q}));
        if (plane_write) plane_q[tag2_q[1:0]] <= plane;
        if (line_write) line_q[tag2_q[1:0]] <= line;
        plane3_q <= plane_q[tag2_q[1:0]] + 24'sd128;
        line3_q <= line;
        p4_q <= plane3_q[23:8];
        l4_q <= line3_q[15:0];
        product5_q <= 31'(p4_q * l4_q);
      end
      assign products_o[31*c+:31] = product5_q;
      wire unused_ok = &{1'b0, plane3_q[7:0], line3_q[16]};
    end
  endgenerate
  assign valid_o = done_q;
  assign {end_o, appearance_o, pair_o, block_o} = tag5_q;
  wire unused_ok = &{1'b0, whole_q[3]};
endmodule

`default_nettype wire
