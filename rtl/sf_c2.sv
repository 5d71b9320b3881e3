// C2: adds the weight rows of the C1 neurons that fired, two per cycle, to the biases. Mirror: src/fx/current.c
// Width: |sum| <= 257 * 127 < 2^15.
`default_nettype none

module sf_c2 #(
    parameter LANES = 128,
    parameter BITS = 6,   // of a row within a bank
    parameter TAP = 1
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    // weights, by neuron of C1; the biases
    input  wire                bias_i,
    input  wire                we_i,
    input  wire                bias_we_i,
    input  wire [      BITS:0] wrow_i,
    input  wire         [$clog2(LANES/4)-1:0] wword_i,
    input  wire         [31:0] wdata_i,
    // spikes of C1 at one step
    input  wire                valid_i,
    input  wire [   LANES-1:0] spikes_i,
    input  wire         [ 2:0] step_i,
    output wire                done_o,
    // neurons, as in sf_d1; the current is sign-extended, without the fraction bits of the membrane
    input  wire                fire_free_i,
    output wire                fire_next_o,
    output wire                fire_valid_o,
    output reg  [16*LANES-1:0] current_o,
    // events
    output wire         [ 1:0] rows_o,
    output wire         [ 2:0] rows_step_o,
    output wire                idle_o,
    // tap: the rows behind current_o
    output wire [   LANES-1:0] tap_rows_o
);
  reg fresh_q;  // the bitmap at hand was not looked at yet
  reg first_q, even_q, odd_q, op_q, last_q, move_q;
  reg [2:0] step_q;
  wire even, odd, last;
  wire [BITS-1:0] even_index, odd_index;
  wire [LANES-1:0] even_mask, odd_mask;
  wire [8*LANES-1:0] even_row, odd_row;
  wire go = valid_i && (!last || fire_free_i);

  sf_pick #(
      .LANES(LANES),
      .BITS (BITS)
  ) u_pick (
      .clk_i       (clk_i),
      .load_i      (fresh_q),
      .take_i      (go),
      .bits_i      (spikes_i),
      .even_o      (even),
      .odd_o       (odd),
      .even_index_o(even_index),
      .odd_index_o (odd_index),
      .even_mask_o (even_mask),
      .odd_mask_o  (odd_mask),
      .last_o      (last)
  );
  sf_wmem #(
      .WORDS   (LANES / 4),
      .ROWS    (LANES / 2),
      .ROW_BITS(BITS),
      .WORD_BITS($clog2(LANES / 4))
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
      .WORDS   (LANES / 4),
      .ROWS    (LANES / 2),
      .ROW_BITS(BITS),
      .WORD_BITS($clog2(LANES / 4))
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

  assign done_o = go && last;
  assign fire_next_o = go && last;

  reg [8*LANES-1:0] bias_q;
  wire [8*LANES-1:0] bias = bias_i ? bias_q : {(8 * LANES) {1'b0}};
  always_ff @(posedge clk_i) begin
    if (bias_we_i) bias_q[32*wword_i+:32] <= wdata_i;
  end

  reg signed [15:0] acc_q[0:LANES-1];
  reg [16*LANES-1:0] sums;  // names a whole row within one operation, not a register
  always_ff @(posedge clk_i) begin
    if (move_q) begin
      for (int l = 0; l < LANES; l++) sums[16*l+:16] = acc_q[l];
      current_o <= sums;
    end
    if (op_q) begin
      if (first_q) begin
        for (int l = 0; l < LANES; l++) acc_q[l] = 16'($signed(bias[8*l+:8]));
      end
      if (even_q && odd_q) begin
        for (int l = 0; l < LANES; l++)
          acc_q[l] = acc_q[l] + 16'($signed(even_row[8*l+:8])) + 16'($signed(odd_row[8*l+:8]));
      end else if (even_q) begin
        for (int l = 0; l < LANES; l++) acc_q[l] = acc_q[l] + 16'($signed(even_row[8*l+:8]));
      end else if (odd_q) begin
        for (int l = 0; l < LANES; l++) acc_q[l] = acc_q[l] + 16'($signed(odd_row[8*l+:8]));
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {fresh_q, op_q, even_q, odd_q, last_q, move_q} <= 6'b100000;
    else if (clear_i) {fresh_q, op_q, even_q, odd_q, last_q, move_q} <= 6'b100000;
    else begin
      if (go) fresh_q <= last;
      op_q <= go;
      even_q <= go && even;
      odd_q <= go && odd;
      last_q <= go && last;
      move_q <= last_q;
    end
  end
  always_ff @(posedge clk_i) begin
    first_q <= fresh_q;
    step_q <= step_i;
  end

  assign fire_valid_o = move_q;
  assign rows_o = {1'b0, even_q} + {1'b0, odd_q};
  assign rows_step_o = step_q;
  assign idle_o = fresh_q && !op_q && !last_q && !move_q;

  generate
    if (TAP != 0) begin : g_tap
      reg [LANES-1:0] mask_q, sum_q, rows_q;
      always_ff @(posedge clk_i) begin
        mask_q <= even_mask | odd_mask;
        if (op_q) sum_q <= first_q ? mask_q : sum_q | mask_q;
        if (move_q) rows_q <= sum_q;
      end
      assign tap_rows_o = rows_q;
    end else begin : g_no_tap
      assign tap_rows_o = {LANES{1'b0}};
      wire unused_tap_ok = &{1'b0, even_mask, odd_mask};
    end
  endgenerate
endmodule

`default_nettype wire
