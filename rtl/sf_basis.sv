// Sums of a sample's features: products of its components, in 16 bits, times the rows of the basis matrix.
// Mirror: src/fx/tensorf_isa.h (vm_products, vm_features)
//
// A component in a cycle, for all 32 features. Row 64 pair + 16 block + i of the memory is that of component i of a block;
// components that are not there are 0.
`default_nettype none

module sf_basis #(
    parameter integer LOG2_BLOCKS = 6  // room for blocks: those of five samples, at most 12 each
) (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    input  wire         cfg_we_i,
    input  wire [ 10:0] cfg_addr_i,     // {row, word of four features}
    input  wire [ 31:0] cfg_data_i,
    input  wire         valid_i,
    input  wire [495:0] products_i,     // as sf_planes_mix
    input  wire [  1:0] block_i,
    input  wire [  1:0] pair_i,
    input  wire         end_i,
    output wire         valid_o,
    input  wire         ready_i,
    output wire [991:0] sums_o          // 32 signed numbers of 31 bits
);
  // ---- blocks wait in 16 bits per component
  reg valid1_q;
  reg [255:0] x1_q;
  reg [4:0] tag1_q;
  wire [255:0] x;
  genvar c;
  generate
    for (c = 0; c < 16; c = c + 1) begin : g_component
      wire [30:0] rounding = products_i[31*c+:31] + 31'd16384;
      assign x[16*c+:16] = rounding[30:15];
      wire unused_ok = &{1'b0, rounding[14:0]};
    end
  endgenerate
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid1_q <= 1'b0;
    else valid1_q <= valid_i && !clear_i;
  end
  always_ff @(posedge clk_i) {x1_q, tag1_q} <= {x, end_i, pair_i, block_i};

  wire waiting, head_end, pop;
  wire [255:0] head;
  wire [1:0] head_pair, head_block;
  sf_fifo #(
      .WIDTH     (261),
      .LOG2_DEPTH(LOG2_BLOCKS)
  ) u_blocks (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (valid1_q),
      .data_i ({x1_q, tag1_q}),
      .valid_o(waiting),
      .pop_i  (pop),
      .data_o ({head, head_end, head_pair, head_block})
  );

  // ---- component by component: row and x, then their products, then sums
  reg [3:0] at_q;
  reg held_q;        // the last block of a sample is through, its sums are not handed over yet
  reg whole_q;       // they are whole: three cycles after the last component was taken
  reg full_q;        // sums wait at the output
  wire full = full_q && !ready_i;
  wire hand_over = whole_q && !full;
  wire work = waiting && !held_q;
  assign pop = work && at_q == 4'd15;
  reg [255:0] row_q[0:191];
  reg [255:0] read_q;
  reg [255:0] shifted_q;  // the block at work, from its next component on
  wire [255:0] block = at_q == 4'd0 ? head : shifted_q;
  reg [15:0] x2_q;
  reg [2:0] valid_q, first_q, end_q;
  reg begun_q;       // of the sample
  integer i;
  wire [7:0] row = {head_pair, head_block, at_q};
  always_ff @(posedge clk_i) begin
    for (i = 0; i < 8; i = i + 1) begin
      if (cfg_we_i && cfg_addr_i[2:0] == 3'(i)) row_q[cfg_addr_i[10:3]][32*i+:32] <= cfg_data_i;
    end
    read_q <= row_q[row];
    x2_q <= block[15:0];
    shifted_q <= {16'd0, block[255:16]};
    first_q <= {first_q[1:0], !begun_q};
    end_q <= {end_q[1:0], pop && head_end};
  end
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      at_q <= 4'd0;
      {held_q, begun_q, valid_q} <= 5'd0;
    end else if (clear_i) begin
      at_q <= 4'd0;
      {held_q, begun_q, valid_q} <= 5'd0;
    end else begin
      if (work) at_q <= at_q + 4'd1;
      if (work) begun_q <= !(pop && head_end);
      held_q <= held_q ? !hand_over : pop && head_end;
      valid_q <= {valid_q[1:0], work};
    end
  end

  genvar f;
  generate
    for (f = 0; f < 32; f = f + 1) begin : g_feature
      reg signed [23:0] product_q;
      reg signed [30:0] sum_q, out_q;
      always_ff @(posedge clk_i) begin
        product_q <= 24'($signed(x2_q) * $signed(read_q[8*f+:8]));
        if (valid_q[1]) sum_q <= (first_q[1] ? 31'sd0 : sum_q) + 31'(product_q);
        if (hand_over) out_q <= sum_q;
      end
      assign sums_o[31*f+:31] = out_q;
    end
  endgenerate
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {whole_q, full_q} <= 2'b00;
    else if (clear_i) {whole_q, full_q} <= 2'b00;
    else begin
      whole_q <= whole_q ? !hand_over : valid_q[1] && end_q[1];
      full_q <= hand_over || full;
    end
  end
  assign valid_o = full_q;
  wire unused_ok = &{1'b0, valid_q[2], first_q[2], end_q[2]};
endmodule

`default_nettype wire
