// D1 and C1, the layers fed by values: one array of MACS multipliers with a sum per step. A row of weights is read once,
// held, and multiplied by a value per cycle: by a feature, a constant input of C1, or h of each step in turn.
// The constant inputs of C1 (a ray's direction, biases) are summed up once per ray and begin the sums of its samples; those
// of a decoder once per sample, for all steps. In radix mode there is one h, and one sum of C1. Mirror: src/fx/current.c, src/fx/net.c
// Width: of 32 rows |sum| <= 32 * 2048 * 127 < 2^23, of a decoder's 161 < 2^26; a current has 24 bits.
`default_nettype none

module sf_values #(
    parameter LANES = 128,
    parameter MACS = 128,     // LANES / MACS parts of a row, one after another
    parameter PART_BITS = 1   // of a part's number
) (
    input  wire                       clk_i,
    input  wire                       rst_ni,
    input  wire                       clear_i,
    // sizes
    input  wire                       decodes_i,
    input  wire [                5:0] n_feature_i,
    input  wire [                7:0] n_dir_i,        // constant inputs of C1
    input  wire [               10:0] bias_i,         // value of C1's biases; 0: none
    input  wire [                4:0] n_h_i,
    input  wire                       radix_i,
    input  wire [                3:0] steps_i,
    input  wire [      PART_BITS-1:0] d1_part_i,      // the last part that D1 has
    input  wire [      PART_BITS-1:0] c1_part_i,
    // weights; rows of C1: constant inputs, then h, and the biases
    input  wire                       d1_we_i,
    input  wire                       c1_we_i,
    input  wire [                8:0] wrow_i,
    input  wire [$clog2(LANES/4)-1:0] wword_i,
    input  wire [               31:0] wdata_i,
    // a sample whose inputs are there
    input  wire                       valid_i,
    input  wire                       first_i,        // of a new ray
    output wire                       done_o,
    output wire [                4:0] feature_index_o,
    input  wire [               11:0] feature_i,
    output wire                       dir_we_o,       // to C1
    output wire [                7:0] dir_index_o,
    input  wire [               11:0] dir_i,          // of D1's sample, or a decoder's
    // a sample whose h is there
    input  wire                       h_valid_i,
    input  wire                       h_first_i,      // of a new ray
    output wire                       h_done_o,
    output wire [                2:0] h_step_o,
    output wire [                3:0] h_index_o,
    input  wire [               11:0] h_i,
    input  wire [               11:0] h_dir_i,        // dir_index_o of its ray
    // sums: complete until taken. A load has the array for itself; its current is there four cycles later, until the next
    output wire                       d1_full_o,
    output wire                       c1_full_o,
    input  wire                       d1_taken_i,
    input  wire                       c1_taken_i,
    input  wire                       load_i,
    input  wire                       load_c1_i,
    input  wire [                2:0] load_step_i,
    input  wire [      PART_BITS-1:0] load_part_i,
    output wire [        24*MACS-1:0] current_o,      // saturated
    // events, in the cycle in which they happen
    output wire                       d1_row_o,       // a row read, a product per weight
    output wire                       c1_row_o,       // a row read
    output wire                       c1_bias_row_o,
    output wire                       c1_products_o,  // a product per weight of a row
    output wire [                2:0] c1_step_o,
    output wire                       ray_o,
    output wire [                1:0] busy_o,         // C1, D1
    output wire                       idle_o
);
  localparam PARTS = LANES / MACS;
  localparam C1_ROWS = sf_arch_pkg::FEATURE_MAX;
  localparam BIASES = sf_arch_pkg::FEATURE_MAX + sf_arch_pkg::DIR_MAX;
  localparam ROWS = (BIASES + 1) * PARTS;
  localparam ROW_BITS = $clog2(ROWS);
  localparam PART_WORDS = MACS / 4;
  localparam PART_WORD_BITS = $clog2(PART_WORDS);
  localparam SUM_BITS = 27;
  localparam SLOTS = 16 * PARTS;
  localparam SLOT_BITS = $clog2(SLOTS);
  localparam [3:0] BASE = 4'd8;  // slots 0 to 7: sums of C1's steps
  localparam [3:0] DENSITY = 4'd9;

  localparam [1:0] NONE = 2'd0;
  localparam [1:0] FEATURES = 2'd1;
  localparam [1:0] CONSTANTS = 2'd2;
  localparam [1:0] STATES = 2'd3;

  // ---- what follows from the sizes, in registers: they do not change at work. A sum without rows takes a turn, too.
  reg has_bias_q, has_constants_q, has_h_q, bias_first_q;
  reg [2:0] last_step_q;
  reg [7:0] d1_turns_q, ray_turns_q, constant_turns_q, state_turns_q;  // D1's without and with a direction to pass on, C1's
  reg d1_one_q, ray_one_q, constant_one_q, state_one_q;                // it is a single one
  reg [7:0] state_row_q;                                               // of h in the memory
  wire [7:0] n_feature = {2'd0, n_feature_i};
  wire [7:0] n_constant = n_dir_i + {7'd0, bias_i != 11'd0};
  wire [7:0] ray_turns = n_dir_i > n_feature ? n_dir_i : n_feature;
  always_ff @(posedge clk_i) begin
    has_bias_q <= bias_i != 11'd0;
    has_constants_q <= n_constant != 8'd0;
    has_h_q <= n_h_i != 5'd0;
    bias_first_q <= bias_i != 11'd0 && n_dir_i == 8'd0;
    last_step_q <= radix_i ? 3'd0 : 3'(steps_i - 4'd1);
    d1_turns_q <= n_feature == 8'd0 ? 8'd1 : n_feature;
    ray_turns_q <= ray_turns == 8'd0 ? 8'd1 : ray_turns;
    constant_turns_q <= n_constant == 8'd0 ? 8'd1 : n_constant;
    state_turns_q <= n_h_i == 5'd0 ? 8'd1 : {3'd0, n_h_i};
    d1_one_q <= n_feature < 8'd2;
    ray_one_q <= ray_turns < 8'd2;
    constant_one_q <= n_constant < 8'd2;
    state_one_q <= n_h_i < 5'd2;
    state_row_q <= 8'(C1_ROWS) + n_dir_i;
  end

  // ---- what is at work: a row, a part of it, a step
  reg [1:0] job_q;
  reg [7:0] row_q, left_q, at_q;  // left: turns; at: the row in the memory
  reg one_left_q, at_bias_q;
  reg [PART_BITS-1:0] part_q;
  reg [2:0] step_q;
  reg d1_full_q, c1_full_q;
  wire works = job_q != NONE;
  wire c1_begins = (decodes_i ? valid_i : h_valid_i) && !c1_full_q;
  wire [1:0] job = works ? job_q
                 : c1_begins ? (decodes_i || h_first_i ? CONSTANTS : STATES)
                 : valid_i && !decodes_i && !d1_full_q ? FEATURES : NONE;
  wire go = job != NONE && !load_i;
  // The direction is passed on beside the rows of D1; it may be longer than they are.
  wire [7:0] turns = works ? left_q
                   : job == FEATURES ? (first_i ? ray_turns_q : d1_turns_q)
                   : job == CONSTANTS ? constant_turns_q : state_turns_q;
  wire last_row = works ? one_left_q
                : job == FEATURES ? (first_i ? ray_one_q : d1_one_q)
                : job == CONSTANTS ? constant_one_q : state_one_q;
  wire is_row = job == FEATURES ? row_q < n_feature : job == CONSTANTS ? has_constants_q : has_h_q;
  wire at_bias = job == CONSTANTS && (works ? at_bias_q : bias_first_q);
  wire [7:0] place = works ? at_q
                   : job == FEATURES ? 8'd0
                   : job == STATES ? state_row_q
                   : bias_first_q ? 8'(BIASES) : 8'(C1_ROWS);
  wire bias_next = job == CONSTANTS && has_bias_q && turns == 8'd2;
  wire last_part = part_q == (job == FEATURES ? d1_part_i : c1_part_i);
  wire last_step = job != STATES || step_q == last_step_q;
  wire last_of_row = last_part && last_step;
  wire last = last_row && last_of_row;
  wire ends = go && last && (job != CONSTANTS || decodes_i);
  wire first_part = part_q == {PART_BITS{1'b0}};

  assign feature_index_o = row_q[4:0];
  assign dir_index_o = row_q;
  assign dir_we_o = go && job == FEATURES && first_part && first_i && row_q < n_dir_i;
  assign h_index_o = row_q[3:0];
  assign h_step_o = step_q;
  assign done_o = ends && job != STATES;
  assign h_done_o = ends && job == STATES;
  assign d1_full_o = d1_full_q;
  assign c1_full_o = c1_full_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      job_q <= NONE;
      row_q <= 8'd0;
      part_q <= {PART_BITS{1'b0}};
      {step_q, d1_full_q, c1_full_q} <= 5'd0;
    end else if (clear_i) begin
      job_q <= NONE;
      row_q <= 8'd0;
      part_q <= {PART_BITS{1'b0}};
      {step_q, d1_full_q, c1_full_q} <= 5'd0;
    end else begin
      if (go) begin
        job_q <= !last ? job : job == CONSTANTS && !decodes_i ? STATES : NONE;
        step_q <= last_step ? 3'd0 : step_q + 3'd1;
        if (last_step) part_q <= last_part ? {PART_BITS{1'b0}} : part_q + 1'b1;
        if (last_of_row) row_q <= last_row ? 8'd0 : row_q + 8'd1;
      end
      if (ends && job == FEATURES) d1_full_q <= 1'b1;
      else if (d1_taken_i) d1_full_q <= 1'b0;
      if (ends && job != FEATURES) c1_full_q <= 1'b1;
      else if (c1_taken_i) c1_full_q <= 1'b0;
    end
  end

  // After the constants of a ray come the states.
  wire to_states = last && job == CONSTANTS;
  always_ff @(posedge clk_i) begin
    if (go) begin
      left_q <= to_states ? state_turns_q : last_of_row ? turns - 8'd1 : turns;
      one_left_q <= to_states ? state_one_q : last_of_row ? turns == 8'd2 : last_row;
      at_q <= to_states ? state_row_q : !last_of_row ? place : bias_next ? 8'(BIASES) : place + 8'd1;
      at_bias_q <= last_of_row ? bias_next : at_bias;
    end
  end

  // ---- 0: the row's address; 1: the row and its value; 2: registers; 3: the product goes into a sum; 4: the sum is stored
  wire multiplies = go && (job != FEATURES || is_row);
  wire [3:0] load_slot = !load_c1_i ? DENSITY : decodes_i ? BASE : {1'b0, load_step_i};
  wire [3:0] slot = job == FEATURES ? DENSITY : job == CONSTANTS ? BASE : {1'b0, step_q};
  wire zero = job != STATES && row_q == 8'd0;
  wire [3:0] from = load_i ? load_slot : job == STATES && row_q == 8'd0 ? BASE : slot;
  wire [PART_BITS-1:0] part = load_i ? load_part_i : part_q;
  wire [8*MACS-1:0] row;
  wire [7:0] wplace = d1_we_i ? {3'd0, wrow_i[4:0]}
                    : wrow_i == 9'(sf_arch_pkg::BIAS_ROW) ? 8'(BIASES) : 8'(C1_ROWS) + wrow_i[7:0];
  sf_rows #(
      .WORDS    (PART_WORDS),
      .ROWS     (ROWS),
      .ROW_BITS (ROW_BITS),
      .WORD_BITS(PART_WORD_BITS)
  ) u_weights (
      .clk_i  (clk_i),
      .we_i   (d1_we_i || c1_we_i),
      .wrow_i (ROW_BITS'(wplace * PARTS + 32'(wword_i) / PART_WORDS)),
      .wword_i(wword_i[PART_WORD_BITS-1:0]),
      .wdata_i(wdata_i),
      .re_i   (go && is_row && step_q == 3'd0),
      .rrow_i (ROW_BITS'(place * PARTS + 32'(part_q))),
      .row_o  (row)
  );

  reg op1_q, op2_q, op3_q, op4_q, zero1_q, zero2_q, zero3_q;
  reg signed [11:0] value1_q, value2_q;
  reg [SLOT_BITS-1:0] from1_q, from2_q, from3_q, to1_q, to2_q, to3_q, to4_q;
  reg [8*MACS-1:0] row2_q;
  reg [2:0] load_q;
  reg [2:0] events_q;  // D1 row, C1 row, C1 biases
  reg products_q, ray_q;
  reg [2:0] event_step_q;
  reg [1:0] busy_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {op1_q, op2_q, op3_q, op4_q, load_q, events_q, products_q, ray_q, busy_q} <= 14'd0;
    else if (clear_i) {op1_q, op2_q, op3_q, op4_q, load_q, events_q, products_q, ray_q, busy_q} <= 14'd0;
    else begin
      op1_q <= multiplies;
      load_q <= {load_q[1:0], load_i};
      op2_q <= op1_q;
      op3_q <= op2_q;
      op4_q <= op3_q;
      events_q <= {3{go && is_row && first_part && step_q == 3'd0}}
          & {job == FEATURES, job != FEATURES && !at_bias, at_bias};
      products_q <= go && is_row && first_part && job != FEATURES && !at_bias;
      ray_q <= go && last && job == CONSTANTS && !decodes_i;
      busy_q <= {go && is_row && job != FEATURES, go && is_row && job == FEATURES};
    end
  end
  always_ff @(posedge clk_i) begin
    event_step_q <= step_q;
    value1_q <= !is_row ? 12'd0 : job == FEATURES ? feature_i : at_bias ? {1'b0, bias_i}
              : job == STATES ? h_i : decodes_i ? dir_i : h_dir_i;
    value2_q <= value1_q;
    from1_q <= SLOT_BITS'(32'(from) * PARTS + 32'(part));
    {from3_q, from2_q} <= {from2_q, from1_q};
    to1_q <= SLOT_BITS'(32'(slot) * PARTS + 32'(part_q));
    {to4_q, to3_q, to2_q} <= {to3_q, to2_q, to1_q};
    zero1_q <= zero;
    {zero3_q, zero2_q} <= {zero2_q, zero1_q};
    if (op1_q) row2_q <= row;
  end

  // verilator tracing_off
  reg [SUM_BITS*MACS-1:0] sum_q[0:SLOTS-1];
  // verilator tracing_on
  reg [20*MACS-1:0] product3_q;
  reg [24*MACS-1:0] current_q;
  // The sum before may not be stored yet: memory, adder and memory again would be too much for one cycle.
  reg [SUM_BITS*MACS-1:0] sum4_q;
  reg newest3_q;
  wire [SUM_BITS*MACS-1:0] from_row = newest3_q ? sum4_q : sum_q[from3_q];
  reg [SUM_BITS*MACS-1:0] next;  // names within an operation, not registers
  reg signed [SUM_BITS-1:0] old;
  always_ff @(posedge clk_i) begin
    if (op2_q) begin
      for (int l = 0; l < MACS; l++) product3_q[20*l+:20] <= $signed(row2_q[8*l+:8]) * value2_q;
    end
    if (op3_q) begin
      for (int l = 0; l < MACS; l++) begin
        old = zero3_q ? {SUM_BITS{1'b0}} : from_row[SUM_BITS*l+:SUM_BITS];
        next[SUM_BITS*l+:SUM_BITS] = old + SUM_BITS'($signed(product3_q[20*l+:20]));
      end
      sum4_q <= next;
    end
    newest3_q <= op3_q && to3_q == from2_q;
    if (op4_q) sum_q[to4_q] <= sum4_q;
    if (load_q[2]) begin
      for (int l = 0; l < MACS; l++) begin
        old = from_row[SUM_BITS*l+:SUM_BITS];
        current_q[24*l+:24] <= old > 27'sd8388607 ? 24'h7fffff : old < -27'sd8388608 ? 24'h800000 : old[23:0];
      end
    end
  end
  assign current_o = current_q;

  assign {d1_row_o, c1_row_o, c1_bias_row_o} = events_q;
  assign c1_products_o = products_q;
  assign c1_step_o = event_step_q;
  assign ray_o = ray_q;
  assign busy_o = busy_q;
  assign idle_o = job_q == NONE && !d1_full_q && !c1_full_q && !op1_q && !op2_q && !op3_q && load_q == 3'd0 && busy_q == 2'd0 && !ray_q;
endmodule

`default_nettype wire
