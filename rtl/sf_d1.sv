// D1: features times weights, once per sample; its current does not change with the step. Reads the input buffer and
// passes a new ray's direction on to C1. Mirror: src/fx/net.c
`default_nettype none

module sf_d1 #(
    parameter LANES = 128
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    input  wire                hold_i,           // begin no sample
    input  wire         [ 5:0] n_feature_i,
    input  wire         [ 4:0] n_dir_i,
    // weights
    input  wire                we_i,
    input  wire         [ 4:0] wrow_i,
    input  wire         [$clog2(LANES/4)-1:0] wword_i,
    input  wire         [31:0] wdata_i,
    // input buffer
    input  wire                sample_valid_i,
    input  wire                sample_first_i,   // the sample brings a direction
    output wire                sample_done_o,    // its inputs were read for the last time
    output wire         [ 4:0] feature_index_o,
    input  wire         [11:0] feature_i,
    input  wire         [11:0] dir_i,
    // direction, to C1
    output wire                dir_we_o,
    output wire         [ 3:0] dir_index_o,
    output wire         [11:0] dir_o,
    output wire                first_we_o,       // once a sample, before its spikes
    output wire                first_o,
    // neurons
    input  wire                fire_free_i,      // the current may be replaced in two cycles
    output wire                fire_next_o,      // it will be
    output wire                fire_valid_o,     // it has been: in the next cycle it is there
    output wire [24*LANES-1:0] current_o,
    // events, in the cycle in which they happen
    output wire                row_o,
    output wire                idle_o
);
  reg [4:0] index_q;
  reg op_q, first_q, last_q, move_q;
  reg signed [11:0] value_q;
  wire [8*LANES-1:0] row;

  // The direction is passed on beside the rows; it may be longer than they are.
  wire [5:0] n_dir = sample_first_i ? {1'b0, n_dir_i} : 6'd0;
  wire [5:0] index = {1'b0, index_q};
  wire is_row = index < n_feature_i;
  wire last = index + 6'd1 >= n_feature_i && index + 6'd1 >= n_dir;
  wire begins = index_q == 5'd0;
  wire go = sample_valid_i && (begins ? !hold_i : 1'b1) && (!last || fire_free_i) && !clear_i;

  assign feature_index_o = index_q;
  assign sample_done_o = go && last;
  assign fire_next_o = go && last;
  assign dir_we_o = go && index < n_dir;
  assign dir_index_o = index_q[3:0];
  assign dir_o = dir_i;
  assign first_we_o = go && last;
  assign first_o = sample_first_i;

  sf_wmem #(
      .WORDS   (LANES / 4),
      .ROWS    (32),
      .ROW_BITS(5),
      .WORD_BITS($clog2(LANES / 4))
  ) u_weights (
      .clk_i  (clk_i),
      .we_i   (we_i),
      .wrow_i (wrow_i),
      .wword_i(wword_i),
      .wdata_i(wdata_i),
      .re_i   (go && is_row),
      .rrow_i (index_q),
      .row_o  (row)
  );
  sf_mac #(
      .LANES(LANES)
  ) u_mac (
      .clk_i      (clk_i),
      .row_valid_i(op_q),
      .first_i    (first_q),
      .base_i     (1'b0),
      .zero_i     (1'b0),
      .value_i    (value_q),
      .row_i      (row),
      .keep_i     (1'b0),
      .move_i     (move_q),
      .current_o  (current_o)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {index_q, op_q, last_q, move_q} <= 8'd0;
    else if (clear_i) {index_q, op_q, last_q, move_q} <= 8'd0;
    else begin
      if (go) index_q <= last ? 5'd0 : index_q + 5'd1;
      op_q <= go && is_row;
      last_q <= go && last;
      move_q <= last_q;
    end
  end
  always_ff @(posedge clk_i) begin
    first_q <= begins;
    value_q <= feature_i;
  end

  assign fire_valid_o = move_q;
  assign row_o = op_q;
  assign idle_o = begins && !op_q && !last_q && !move_q;
endmodule

`default_nettype wire
