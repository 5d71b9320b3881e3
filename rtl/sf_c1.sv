// C1: the direction's current once per ray, then at every step the h of D2 on top of it. Of a decoder the constant
// inputs once per sample: its current serves all steps, as D1's. Biases are one more row of the constant inputs.
// Mirror: src/fx/net.c
`default_nettype none

module sf_c1 #(
    parameter LANES = 128
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    input  wire                decodes_i,
    input  wire         [ 7:0] n_dir_i,        // constant inputs
    input  wire         [10:0] bias_i,         // 0: none
    input  wire         [ 4:0] n_h_i,
    input  wire         [ 3:0] steps_i,
    // weights: rows of the constant inputs, then those of h; the biases'
    input  wire                we_i,
    input  wire         [ 8:0] wrow_i,
    input  wire         [$clog2(LANES/4)-1:0] wword_i,
    input  wire         [31:0] wdata_i,
    // a sample whose inputs are there
    input  wire                valid_i,
    input  wire                first_i,        // of a new ray
    output wire                done_o,
    output wire         [ 7:0] dir_index_o,
    input  wire         [11:0] dir_i,
    output wire         [ 6:0] h_index_o,      // {step, index}
    input  wire         [11:0] h_i,
    // neurons, as in sf_d1
    input  wire                fire_free_i,
    output wire                fire_next_o,
    output wire                fire_valid_o,
    output wire [24*LANES-1:0] current_o,
    // events
    output wire                row_o,
    output wire                bias_row_o,
    output wire         [ 2:0] row_step_o,
    output wire                ray_o,
    output wire                idle_o
);
  localparam [1:0] START = 2'd0;
  localparam [1:0] DIR = 2'd1;
  localparam [1:0] KEEP = 2'd2;
  localparam [1:0] ROWS = 2'd3;
  localparam [7:0] BIASES = 8'(sf_arch_pkg::DIR_MAX);  // their row in the memory, behind those of the inputs

  reg [1:0] state_q, state_d;
  reg [7:0] index_q, index_d;
  reg [2:0] step_q, step_d;
  reg op_q, count_q, first_q, base_q, keep_q, last_q, move_q, biases_q;
  reg [2:0] op_step_q;
  reg signed [11:0] value_q;
  reg issue, zero, last;
  wire [8*LANES-1:0] row;

  // A sum without rows takes one cycle, too.
  wire in_dir = state_q == DIR || (state_q == START && (first_i || decodes_i));
  wire has_bias = bias_i != 11'd0;
  wire at_bias = in_dir && index_q == n_dir_i && has_bias;
  wire [7:0] n_rows = in_dir ? n_dir_i + {7'd0, has_bias} : {3'd0, n_h_i};
  wire rows_last = index_q + 8'd1 >= n_rows;
  wire current_last = rows_last && (!in_dir || decodes_i);  // the neurons' current is complete
  wire last_step = {1'b0, step_q} == steps_i - 4'd1;

  always_comb begin
    state_d = state_q;
    index_d = index_q;
    step_d = step_q;
    issue = 1'b0;
    last = 1'b0;
    zero = n_rows == 8'd0;
    if (state_q == KEEP) begin
      state_d = ROWS;
    end else if (state_q == START ? valid_i : 1'b1) begin
      if (!current_last || fire_free_i) begin
        issue = 1'b1;
        last = current_last;
        index_d = rows_last ? 8'd0 : index_q + 8'd1;
        state_d = !in_dir ? ROWS : !rows_last ? DIR : decodes_i ? START : KEEP;
        if (rows_last && !in_dir) begin
          step_d = last_step ? 3'd0 : step_q + 3'd1;
          if (last_step) state_d = START;
        end
      end
    end
  end

  assign dir_index_o = index_q;
  assign h_index_o = {step_q, index_q[3:0]};
  assign done_o = last && (last_step || decodes_i);
  assign fire_next_o = last;

  sf_wmem #(
      .WORDS   (LANES / 4),
      .ROWS    (sf_arch_pkg::DIR_MAX + 1),
      .ROW_BITS(8),
      .WORD_BITS($clog2(LANES / 4))
  ) u_weights (
      .clk_i  (clk_i),
      .we_i   (we_i),
      .wrow_i (wrow_i == 9'(sf_arch_pkg::BIAS_ROW) ? BIASES : wrow_i[7:0]),
      .wword_i(wword_i),
      .wdata_i(wdata_i),
      .re_i   (issue && !zero),
      .rrow_i (at_bias ? BIASES : in_dir ? index_q : n_dir_i + index_q),
      .row_o  (row)
  );
  sf_mac #(
      .LANES   (LANES),
      .SUM_BITS(27)
  ) u_mac (
      .clk_i      (clk_i),
      .row_valid_i(op_q),
      .first_i    (first_q),
      .base_i     (base_q),
      .zero_i     (!count_q),
      .value_i    (value_q),
      .row_i      (row),
      .keep_i     (keep_q),
      .move_i     (move_q),
      .current_o  (current_o)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {state_q, index_q, step_q, op_q, count_q, keep_q, last_q, move_q} <= 18'd0;
    else if (clear_i) {state_q, index_q, step_q, op_q, count_q, keep_q, last_q, move_q} <= 18'd0;
    else begin
      state_q <= state_d;
      index_q <= index_d;
      step_q <= step_d;
      op_q <= issue;
      count_q <= issue && !zero;
      keep_q <= state_q == KEEP;
      last_q <= last;
      move_q <= last_q;
    end
  end
  always_ff @(posedge clk_i) begin
    first_q <= index_q == 8'd0;
    biases_q <= at_bias;
    base_q <= !in_dir;
    op_step_q <= step_q;
    value_q <= at_bias ? {1'b0, bias_i} : in_dir ? dir_i : h_i;
  end

  assign fire_valid_o = move_q;
  assign row_o = count_q && !biases_q;
  assign bias_row_o = count_q && biases_q;
  assign row_step_o = op_step_q;
  assign ray_o = keep_q;
  assign idle_o = state_q == START && !op_q && !keep_q && !last_q && !move_q;
endmodule

`default_nettype wire
