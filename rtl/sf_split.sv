// D2 and C3: 16 outputs for all 8 steps at once; two neurons that fired at any step are added per cycle, each to the
// steps at which it fired. C3's biases count at every step. Mirror: src/fx/current.c. Width: |sum| <= 257 * 127 < 2^15.
`default_nettype none

module sf_split #(
    parameter LANES = 128,
    parameter BITS = 6,   // of a row within a bank
    parameter TAP = 1
) (
    input  wire               clk_i,
    input  wire               rst_ni,
    input  wire               clear_i,
    // weights, by neuron of the layer before; the biases
    input  wire               bias_i,
    input  wire               we_i,
    input  wire               bias_we_i,
    input  wire [     BITS:0] wrow_i,
    input  wire        [ 1:0] wword_i,
    input  wire        [31:0] wdata_i,
    // spikes of a sample (sf_store)
    input  wire               valid_i,
    input  wire [  LANES-1:0] any_i,
    output wire [  LANES-1:0] even_mask_o,
    output wire [  LANES-1:0] odd_mask_o,
    input  wire        [ 7:0] even_fired_i,
    input  wire        [ 7:0] odd_fired_i,
    output wire               release_o,
    // the sums of a sample: asked for until taken
    output wire               valid_o,
    input  wire               take_i,
    output reg       [2047:0] current_o,   // one cycle after take_i: {step, output}, 16 bits each
    // events
    output wire        [ 7:0] even_fired_o,
    output wire        [ 7:0] odd_fired_o,
    output wire               idle_o,
    // tap: the rows behind current_o
    output wire [  LANES-1:0] tap_rows_o
);
  reg fresh_q, wait_q, ready_q;  // the sums are complete in the next cycle; now
  reg op_q, first_q;
  reg [7:0] even_q, odd_q;
  wire even, odd, last;
  wire [BITS-1:0] even_index, odd_index;
  wire [127:0] even_row, odd_row;
  wire go = valid_i && !wait_q && !ready_q;

  sf_pick #(
      .LANES(LANES),
      .BITS (BITS)
  ) u_pick (
      .clk_i       (clk_i),
      .load_i      (fresh_q),
      .take_i      (go),
      .bits_i      (any_i),
      .even_o      (even),
      .odd_o       (odd),
      .even_index_o(even_index),
      .odd_index_o (odd_index),
      .even_mask_o (even_mask_o),
      .odd_mask_o  (odd_mask_o),
      .last_o      (last)
  );
  sf_wmem #(
      .WORDS    (4),
      .ROWS     (LANES / 2),
      .ROW_BITS (BITS),
      .WORD_BITS(2)
  ) u_even (
      .clk_i  (clk_i),
      .we_i   (we_i && !wrow_i[0]),
      .wrow_i (wrow_i[BITS:1]),
      .wword_i(wword_i),
      .wdata_i(wdata_i),
      .re_i   (go && even),
      .rrow_i (even_index),
      .row_o  (even_row)
  );
  sf_wmem #(
      .WORDS    (4),
      .ROWS     (LANES / 2),
      .ROW_BITS (BITS),
      .WORD_BITS(2)
  ) u_odd (
      .clk_i  (clk_i),
      .we_i   (we_i && wrow_i[0]),
      .wrow_i (wrow_i[BITS:1]),
      .wword_i(wword_i),
      .wdata_i(wdata_i),
      .re_i   (go && odd),
      .rrow_i (odd_index),
      .row_o  (odd_row)
  );

  assign release_o = go && last;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {fresh_q, wait_q, ready_q, op_q, even_q, odd_q} <= {1'b1, 19'd0};
    else if (clear_i) {fresh_q, wait_q, ready_q, op_q, even_q, odd_q} <= {1'b1, 19'd0};
    else begin
      if (go) fresh_q <= last;
      wait_q <= go && last;
      ready_q <= wait_q || (ready_q && !take_i);
      op_q <= go;
      even_q <= go ? even_fired_i : 8'd0;
      odd_q <= go ? odd_fired_i : 8'd0;
    end
  end
  always_ff @(posedge clk_i) first_q <= fresh_q;

  reg [127:0] bias_q;
  wire [127:0] bias = bias_i ? bias_q : 128'd0;
  always_ff @(posedge clk_i) begin
    if (bias_we_i) bias_q[32*wword_i+:32] <= wdata_i;
  end

  reg signed [15:0] acc_q[0:127];
  reg [2047:0] sums;  // names a whole row within one operation, not a register
  always_ff @(posedge clk_i) begin
    if (take_i) begin
      for (int l = 0; l < 128; l++) sums[16*l+:16] = acc_q[l];
      current_o <= sums;
    end
    if (op_q) begin
      if (first_q) begin
        for (int l = 0; l < 128; l++) acc_q[l] = 16'($signed(bias[8*(l&15)+:8]));
      end
      for (int t = 0; t < 8; t++) begin
        if (even_q[t]) begin
          for (int o = 0; o < 16; o++) acc_q[16*t+o] = acc_q[16*t+o] + 16'($signed(even_row[8*o+:8]));
        end
        if (odd_q[t]) begin
          for (int o = 0; o < 16; o++) acc_q[16*t+o] = acc_q[16*t+o] + 16'($signed(odd_row[8*o+:8]));
        end
      end
    end
  end

  assign valid_o = ready_q;
  assign even_fired_o = even_q;
  assign odd_fired_o = odd_q;
  assign idle_o = fresh_q && !wait_q && !ready_q;

  generate
    if (TAP != 0) begin : g_tap
      reg [LANES-1:0] mask_q, rows_q;
      always_ff @(posedge clk_i) begin
        mask_q <= even_mask_o | odd_mask_o;
        if (op_q) rows_q <= first_q ? mask_q : rows_q | mask_q;
      end
      assign tap_rows_o = rows_q;
    end else begin : g_no_tap
      assign tap_rows_o = {LANES{1'b0}};
    end
  endgenerate
endmodule

`default_nettype wire
