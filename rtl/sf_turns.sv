// Whose neurons step: a spiking layer whose sums of a sample are complete, once the layer behind it has room for its spikes.
// The layer nearest to the output goes first, and does all steps of its sample before another begins. A turn is a step of a layer;
// in radix mode C2 has steps - 1 turns before them, which add up its sums of as many steps. Its time: src/cycles/engine.c
`default_nettype none

module sf_turns #(
    parameter MACS = 128,
    parameter PART_BITS = 1,
    parameter NEURONS = 16,
    parameter GROUP_BITS = 3
) (
    input  wire                  clk_i,
    input  wire                  rst_ni,
    input  wire                  clear_i,
    input  wire                  decodes_i,
    input  wire                  radix_i,
    input  wire [           3:0] steps_i,
    input  wire [           8:0] d1_out_i,
    input  wire [           8:0] c1_out_i,
    input  wire [           8:0] c2_out_i,
    // the last group and the last part of each layer
    output wire [GROUP_BITS-1:0] d1_group_o,
    output wire [GROUP_BITS-1:0] c1_group_o,
    output wire [GROUP_BITS-1:0] c2_group_o,
    output wire [ PART_BITS-1:0] d1_part_o,
    output wire [ PART_BITS-1:0] c1_part_o,
    output wire [ PART_BITS-1:0] c2_part_o,
    // a bit for D1, C1 and C2, from bit 0 on
    input  wire [           2:0] full_i,         // its sums are complete
    input  wire [           2:0] space_i,        // its spikes have a place
    output wire [           2:0] take_o,         // and take it
    // sums of D1 and C1: a load, and the sample's last one
    output wire                  load_o,
    output wire                  load_c1_o,
    output wire [           2:0] load_step_o,
    output wire [ PART_BITS-1:0] load_part_o,
    output wire                  d1_taken_o,
    output wire                  c1_taken_o,
    // sums of C2, a cycle later: they are there sooner
    output wire                  load_c2_o,
    output wire [           2:0] load_c2_step_o,
    output wire [ PART_BITS-1:0] load_c2_part_o,
    output wire                  release_c2_o,
    // a group's turn, when its currents are there
    output wire                  valid_o,
    output wire [           1:0] layer_o,
    output wire [           2:0] step_o,
    output wire                  first_o,        // the sample's first turn
    output wire                  charges_o,      // there is a current
    output wire                  fires_o,        // else it adds up alone
    output wire [GROUP_BITS-1:0] group_o,
    output wire                  last_o,         // the layer's last group
    output wire                  idle_o
);
  localparam PART_GROUPS = MACS / NEURONS;
  localparam DEPTH = 6;  // of the neurons: cycles between two steps of a group
  localparam [1:0] D1 = sf_op_pkg::SPIKING_D1;
  localparam [1:0] C1 = sf_op_pkg::SPIKING_C1;
  localparam [1:0] C2 = sf_op_pkg::SPIKING_C2;

  // The last group and the last part of each spiking layer, in registers: sizes do not change at work.
  wire [8:0] d1_last = d1_out_i - 9'd1;
  wire [8:0] c1_last = c1_out_i - 9'd1;
  wire [8:0] c2_last = c2_out_i - 9'd1;
  reg [GROUP_BITS-1:0] d1_group_q, c1_group_q, c2_group_q;
  reg [PART_BITS-1:0] d1_part_q, c1_part_q, c2_part_q;
  always_ff @(posedge clk_i) begin
    d1_group_q <= GROUP_BITS'(d1_last >> $clog2(NEURONS));
    c1_group_q <= GROUP_BITS'(c1_last >> $clog2(NEURONS));
    c2_group_q <= GROUP_BITS'(c2_last >> $clog2(NEURONS));
    d1_part_q <= PART_BITS'(d1_last >> $clog2(MACS));
    c1_part_q <= PART_BITS'(c1_last >> $clog2(MACS));
    c2_part_q <= PART_BITS'(c2_last >> $clog2(MACS));
  end
  assign {d1_group_o, c1_group_o, c2_group_o} = {d1_group_q, c1_group_q, c2_group_q};
  assign {d1_part_o, c1_part_o, c2_part_o} = {d1_part_q, c1_part_q, c2_part_q};

  // The last turn with a sum, and that of C2, likewise.
  reg [3:0] last_sum_q, c2_last_turn_q;
  always_ff @(posedge clk_i) begin
    last_sum_q <= steps_i - 4'd1;
    c2_last_turn_q <= radix_i ? {steps_i[2:0], 1'b0} - 4'd2 : steps_i - 4'd1;
  end

  reg active_q;
  reg [1:0] layer_q;
  reg [3:0] turn_q;
  reg [GROUP_BITS-1:0] group_q;
  reg [2:0] wait_q;       // cycles until the next step may begin
  reg released_q;         // the last load of C2's sums is on its way
  wire [2:0] want = {full_i[C2] && !released_q, full_i[C1], full_i[D1]} & space_i;
  wire [1:0] layer = active_q ? layer_q : want[C2] ? C2 : want[C1] ? C1 : D1;
  wire run = active_q ? wait_q == 3'd0 : want != 3'd0;
  wire [GROUP_BITS-1:0] last_group = layer == C2 ? c2_group_q : layer == C1 ? c1_group_q : d1_group_q;
  wire [PART_BITS-1:0] last_part = layer == C2 ? c2_part_q : layer == C1 ? c1_part_q : d1_part_q;
  wire [PART_BITS-1:0] part = PART_BITS'(32'(group_q) / PART_GROUPS);
  wire at_part = run && 32'(group_q) % PART_GROUPS == 0;
  wire group_ends = group_q == last_group;
  wire first_turn = turn_q == 4'd0;
  wire last_sum = turn_q == last_sum_q;
  wire last_turn = turn_q == (layer == C2 ? c2_last_turn_q : last_sum_q);
  wire adds_up = radix_i && layer == C2;
  // The current of D1, and of a decoder's C1, is that of all steps: of a layer of one part it stays where it was loaded to.
  // In radix mode that of D1 and C1 is needed at the first turn alone.
  wire once = radix_i ? layer != C2 : (layer == D1 || (layer == C1 && decodes_i)) && last_part == {PART_BITS{1'b0}};
  wire charges = first_turn || !radix_i || (adds_up && turn_q <= last_sum_q);
  wire fires = !adds_up || turn_q >= last_sum_q;
  wire load = at_part && (once ? first_turn : charges);
  wire taken = load && (last_sum || once) && part == last_part;
  wire begins = run && !active_q;
  wire [2:0] step = adds_up && fires ? 3'(turn_q - last_sum_q) : turn_q[2:0];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {active_q, layer_q, turn_q, wait_q, released_q} <= 11'd0;
      group_q <= {GROUP_BITS{1'b0}};
    end else if (clear_i) begin
      {active_q, layer_q, turn_q, wait_q, released_q} <= 11'd0;
      group_q <= {GROUP_BITS{1'b0}};
    end else begin
      released_q <= taken && layer == C2;
      if (run) begin
        active_q <= !(group_ends && last_turn);
        layer_q <= layer;
        group_q <= group_ends ? {GROUP_BITS{1'b0}} : group_q + 1'b1;
        if (group_ends) turn_q <= last_turn ? 4'd0 : turn_q + 4'd1;
        if (group_ends && !last_turn && 32'(last_group) < DEPTH - 1) wait_q <= 3'(DEPTH - 1 - 32'(last_group));
      end else if (wait_q != 3'd0) wait_q <= wait_q - 3'd1;
    end
  end

  // From a turn to its currents: four cycles.
  reg [3:0] run_q, last_q, first_q, charges_q, fires_q;
  reg load_q;
  reg [2:0] load_sum_q;
  reg [7:0] run_layer_q;
  reg [11:0] run_step_q;
  reg [4*GROUP_BITS-1:0] run_group_q;
  reg [PART_BITS-1:0] load_part_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {run_q, load_q} <= 5'd0;
    else if (clear_i) {run_q, load_q} <= 5'd0;
    else {run_q, load_q} <= {run_q[2:0], run, load};
  end
  always_ff @(posedge clk_i) begin
    last_q <= {last_q[2:0], group_ends};
    first_q <= {first_q[2:0], first_turn};
    charges_q <= {charges_q[2:0], charges};
    fires_q <= {fires_q[2:0], fires};
    run_layer_q <= {run_layer_q[5:0], layer};
    run_step_q <= {run_step_q[8:0], step};
    run_group_q <= {run_group_q[3*GROUP_BITS-1:0], group_q};
    load_part_q <= part;
    load_sum_q <= turn_q[2:0];
  end

  assign take_o = {begins && layer == C2, begins && layer == C1, begins && layer == D1};
  assign load_o = load && layer != C2;
  assign load_c1_o = layer == C1;
  assign load_step_o = turn_q[2:0];
  assign load_part_o = part;
  assign d1_taken_o = taken && layer == D1;
  assign c1_taken_o = taken && layer == C1;
  assign load_c2_o = load_q && run_layer_q[1:0] == C2;
  assign load_c2_step_o = load_sum_q;
  assign load_c2_part_o = load_part_q;
  assign release_c2_o = released_q;
  assign valid_o = run_q[3];
  assign layer_o = run_layer_q[6+:2];
  assign step_o = run_step_q[9+:3];
  assign first_o = first_q[3];
  assign charges_o = charges_q[3];
  assign fires_o = fires_q[3];
  assign group_o = run_group_q[3*GROUP_BITS+:GROUP_BITS];
  assign last_o = last_q[3];
  assign idle_o = !active_q && run_q == 4'd0;
endmodule

`default_nettype wire
