// A layer fed by spikes (C2, D2, C3): reads the row of each neuron that fired at any step, once, and adds it to the sums of
// the steps at which it fired, up to BANKS of them per cycle. Sums of two samples: one is filled, one is read.
// Mirror: src/fx/current.c. Width: |sum| <= 257 * 127 < 2^15.
`default_nettype none

module sf_sums #(
    parameter ROWS = 128,        // presynaptic neurons; row ROWS of the memory holds the biases
    parameter ROW_BITS = 7,
    parameter OUTS = 128,        // outputs
    parameter ADDERS = 128,      // OUTS / ADDERS parts of a row, one after another
    parameter PART_BITS = 1,
    parameter BANKS = 2,         // 1, 2, 4 or 8: bank b has the sums of steps b, b + BANKS, ...
    parameter TAP = 1
) (
    input  wire                       clk_i,
    input  wire                       rst_ni,
    input  wire                       clear_i,
    input  wire [      PART_BITS-1:0] part_i,         // the last part that the layer has
    // weights, by presynaptic neuron; the biases
    input  wire                       we_i,
    input  wire                       bias_we_i,
    input  wire [       ROW_BITS-1:0] wrow_i,
    input  wire [ $clog2(OUTS/4)-1:0] wword_i,
    input  wire [               31:0] wdata_i,
    // a neuron and the steps at which it fired (sf_spikes)
    input  wire                       valid_i,
    input  wire                       bias_i,         // the biases, which count at every step
    input  wire [       ROW_BITS-1:0] index_i,
    input  wire [                7:0] fired_i,
    input  wire                       last_i,         // of the sample
    output wire                       next_o,
    // sums of a sample, until released. A load has the adders for itself; its sums are there three cycles later, until the next
    output wire                       full_o,
    input  wire                       load_i,
    input  wire [                2:0] load_step_i,
    input  wire [      PART_BITS-1:0] load_part_i,
    input  wire                       release_i,      // with the last load
    output wire [      16*ADDERS-1:0] sums_o,
    // events, in the cycle in which they happen
    output wire                       row_o,          // a row read
    output wire                       bias_row_o,
    output wire [                7:0] fired_o,        // the steps at which row_o counts
    output wire                       busy_o,
    output wire                       idle_o,
    // tap: the rows behind a loaded step, one cycle after the load
    output wire [           ROWS-1:0] tap_rows_o
);
  localparam PARTS = OUTS / ADDERS;
  localparam DEPTH = 2 * (8 / BANKS) * PARTS;
  localparam PLACE_BITS = $clog2(DEPTH);
  localparam PART_WORDS = ADDERS / 4;
  localparam PART_WORD_BITS = $clog2(PART_WORDS);
  localparam MEM_ROWS = (ROWS + 1) * PARTS;
  localparam MEM_BITS = $clog2(MEM_ROWS);

  // ---- what is at work: a part of a row, the steps that are left
  reg fresh_q;
  reg [7:0] left_q;
  reg [PART_BITS-1:0] part_q;
  reg write_q, read_q;
  reg [1:0] full_q;
  reg [8*PARTS-1:0] begun_low_q, begun_high_q;  // of both samples, {part, step}: the sum has been begun
  wire [7:0] steps = fresh_q ? fired_i : left_q;
  wire go = valid_i && !full_q[write_q] && !load_i;
  wire last_part = part_q == part_i;
  wire first_part = part_q == {PART_BITS{1'b0}};

  // The lowest step that is left in each bank.
  wire [7:0] picked;
  wire [BANKS-1:0] op;
  wire [3*BANKS-1:0] step;
  genvar b, k;
  generate
    for (b = 0; b < BANKS; b = b + 1) begin : g_pick
      wire [8/BANKS-1:0] here;
      for (k = 0; k < 8 / BANKS; k = k + 1) begin : g_step
        wire taken;
        if (k == 0) begin : g_first
          assign taken = 1'b0;
        end else begin : g_later
          assign taken = g_step[k-1].taken || steps[b+(k-1)*BANKS];
        end
        assign here[k] = steps[b+k*BANKS] && !taken;
        assign picked[b+k*BANKS] = here[k];
      end
      reg [2:0] which;
      always_comb begin
        which = 3'd0;
        for (int s = 0; s < 8 / BANKS; s++) if (picked[b+s*BANKS]) which = which | 3'(b + s * BANKS);
      end
      assign step[3*b+:3] = which;
      assign op[b] = go && |here;
    end
  endgenerate
  wire [7:0] left = steps & ~picked;
  wire ends = left == 8'd0;
  assign next_o = go && ends && last_part;
  assign full_o = full_q[read_q];

  wire [8*PARTS-1:0] begins = {{(8 * PARTS - 8) {1'b0}}, go ? picked : 8'd0} << (8 * 32'(part_q));

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      full_q <= 2'd0;
      {fresh_q, write_q, read_q} <= 3'b100;
      part_q <= {PART_BITS{1'b0}};
      {begun_low_q, begun_high_q} <= {(16 * PARTS) {1'b0}};
    end else if (clear_i) begin
      full_q <= 2'd0;
      {fresh_q, write_q, read_q} <= 3'b100;
      part_q <= {PART_BITS{1'b0}};
      {begun_low_q, begun_high_q} <= {(16 * PARTS) {1'b0}};
    end else begin
      if (go) begin
        fresh_q <= ends;
        if (ends) part_q <= last_part ? {PART_BITS{1'b0}} : part_q + 1'b1;
      end
      if (next_o && last_i) begin
        full_q[write_q] <= 1'b1;
        write_q <= !write_q;
      end
      if (release_i) begin
        full_q[read_q] <= 1'b0;
        read_q <= !read_q;
      end
      begun_low_q <= release_i && !read_q ? {(8 * PARTS) {1'b0}} : begun_low_q | (write_q ? {(8 * PARTS) {1'b0}} : begins);
      begun_high_q <= release_i && read_q ? {(8 * PARTS) {1'b0}} : begun_high_q | (write_q ? begins : {(8 * PARTS) {1'b0}});
    end
  end
  always_ff @(posedge clk_i) begin
    if (go) left_q <= left;
  end

  // ---- 0: the row's address; 1: the row; 2: it goes into the sums
  wire [8*ADDERS-1:0] row;
  sf_rows #(
      .WORDS    (PART_WORDS),
      .ROWS     (MEM_ROWS),
      .ROW_BITS (MEM_BITS),
      .WORD_BITS(PART_WORD_BITS)
  ) u_weights (
      .clk_i  (clk_i),
      .we_i   (we_i || bias_we_i),
      .wrow_i (MEM_BITS'((bias_we_i ? ROWS : 32'(wrow_i)) * PARTS + 32'(wword_i) / PART_WORDS)),
      .wword_i(wword_i[PART_WORD_BITS-1:0]),
      .wdata_i(wdata_i),
      .re_i   (go && fresh_q && fired_i != 8'd0),
      .rrow_i (MEM_BITS'((bias_i ? ROWS : 32'(index_i)) * PARTS + 32'(part_q))),
      .row_o  (row)
  );
  reg [8*ADDERS-1:0] row2_q;
  reg moved_q;  // a row comes out of the memory
  always_ff @(posedge clk_i) if (moved_q) row2_q <= row;

  wire [8*PARTS-1:0] begun_w = write_q ? begun_high_q : begun_low_q;
  wire [8*PARTS-1:0] begun_r = read_q ? begun_high_q : begun_low_q;
  wire [7:0] begun_part = 8'(begun_w >> (8 * 32'(part_q)));
  wire [7:0] begun_load = 8'(begun_r >> (8 * 32'(load_part_i)));
  wire half = load_i ? read_q : write_q;
  wire [PART_BITS-1:0] part = load_i ? load_part_i : part_q;
  reg [1:0] load_q;
  reg [2:0] load1_step_q, load2_step_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {load_q, moved_q} <= 3'd0;
    else if (clear_i) {load_q, moved_q} <= 3'd0;
    else {load_q, moved_q} <= {load_q[0], load_i, go && fresh_q};
  end
  always_ff @(posedge clk_i) {load2_step_q, load1_step_q} <= {load1_step_q, load_step_i};
  wire unused_ok = &{1'b0, load2_step_q};  // one bank has no choice

  wire [16*ADDERS*BANKS-1:0] olds;
  generate
    for (b = 0; b < BANKS; b = b + 1) begin : g_bank
      reg op1_q, op2_q, begun1_q, begun2_q;
      reg [PLACE_BITS-1:0] place1_q, place2_q;
      wire [2:0] at = load_i ? load_step_i : step[3*b+:3];
      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) {op1_q, op2_q} <= 2'd0;
        else if (clear_i) {op1_q, op2_q} <= 2'd0;
        else {op1_q, op2_q} <= {op[b], op1_q};
      end
      always_ff @(posedge clk_i) begin
        place1_q <= PLACE_BITS'(4'({half, at} >> $clog2(BANKS))) * PLACE_BITS'(PARTS) + PLACE_BITS'(part);
        begun1_q <= load_i ? begun_load[load_step_i] : begun_part[step[3*b+:3]];
        {place2_q, begun2_q} <= {place1_q, begun1_q};
      end
      // verilator tracing_off
      reg [16*ADDERS-1:0] sum_q[0:DEPTH-1];
      // verilator tracing_on
      wire [16*ADDERS-1:0] old = begun2_q ? sum_q[place2_q] : {(16 * ADDERS) {1'b0}};
      reg [16*ADDERS-1:0] next;  // a name within the operation, not a register
      always_ff @(posedge clk_i) begin
        if (op2_q) begin
          for (int i = 0; i < ADDERS; i++) next[16*i+:16] = old[16*i+:16] + 16'($signed(row2_q[8*i+:8]));
          sum_q[place2_q] <= next;
        end
      end
      assign olds[16*ADDERS*b+:16*ADDERS] = old;
    end
  endgenerate
  reg [16*ADDERS-1:0] sums_q;
  always_ff @(posedge clk_i) if (load_q[1]) sums_q <= olds[16*ADDERS*(32'(load2_step_q)%BANKS)+:16*ADDERS];
  assign sums_o = sums_q;

  reg row_q, bias_row_q, busy_q;
  reg [7:0] fired_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {row_q, bias_row_q, busy_q} <= 3'd0;
    else if (clear_i) {row_q, bias_row_q, busy_q} <= 3'd0;
    else begin
      row_q <= go && fresh_q && first_part && fired_i != 8'd0 && !bias_i;
      bias_row_q <= go && fresh_q && first_part && bias_i;
      busy_q <= go && steps != 8'd0;
    end
  end
  always_ff @(posedge clk_i) fired_q <= fired_i;
  assign row_o = row_q;
  assign bias_row_o = bias_row_q;
  assign fired_o = fired_q;
  assign busy_o = busy_q;
  assign idle_o = fresh_q && first_part && full_q == 2'd0 && !busy_q;

  generate
    if (TAP != 0) begin : g_tap
      reg [ROWS-1:0] rows_q[0:15];  // {sample, step}
      reg [ROWS-1:0] loaded_q;
      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          for (int t = 0; t < 16; t++) rows_q[t] <= {ROWS{1'b0}};
        end else begin
          if (clear_i || release_i) begin
            for (int t = 0; t < 8; t++) rows_q[{read_q, t[2:0]}] <= {ROWS{1'b0}};
          end
          if (clear_i) begin
            for (int t = 0; t < 8; t++) rows_q[{!read_q, t[2:0]}] <= {ROWS{1'b0}};
          end else if (go && !bias_i) begin
            for (int t = 0; t < 8; t++) if (picked[t]) rows_q[{write_q, t[2:0]}][index_i] <= 1'b1;
          end
        end
      end
      always_ff @(posedge clk_i) if (load_i) loaded_q <= rows_q[{read_q, load_step_i}];
      assign tap_rows_o = loaded_q;
    end else begin : g_no_tap
      assign tap_rows_o = {ROWS{1'b0}};
    end
  endgenerate
endmodule

`default_nettype wire
