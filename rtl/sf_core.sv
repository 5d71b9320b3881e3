// Layer engine: D1, D2, C1, C2 and C3 work at the same time, each on a sample of its own. D1 and C1 share one array of
// multipliers (sf_values), the spiking layers one set of neuron units (sf_neurons). Mirror: src/fx/net.c
//
//   D1 -> neurons -> spikes -> D2 -> h -> C1 -> neurons -> spikes -> C2 -> neurons -> spikes -> C3
//
// A layer's sums of a sample wait, complete, until the neurons take them; the neurons do all steps of a layer's sample
// before they turn to another. Cycles without stalls: src/cycles/cycles.c
`default_nettype none

module sf_core #(
    parameter TAP = 1,
    parameter LANES = 128,
    parameter MACS = 128,
    parameter NEURONS = 16,
    parameter STEPS_AT_ONCE = 2
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    input  wire                hold_i,             // begin no sample
    output wire                idle_o,
    // programming
    input  wire                we_i,
    input  wire         [ 2:0] wlayer_i,
    input  wire         [ 8:0] wrow_i,
    input  wire         [ 5:0] wword_i,
    input  wire         [31:0] wdata_i,
    // sizes and properties of the layers, as sf_csr has checked them
    input  wire         [ 5:0] d1_in_i,
    input  wire                decodes_i,          // no D1 and D2, C1 takes its inputs from the buffer
    input  wire         [ 8:0] d1_out_i,
    input  wire         [ 7:0] n_dir_i,            // constant inputs of C1
    input  wire         [ 4:0] n_h_i,
    input  wire         [ 8:0] c1_out_i,
    input  wire         [ 8:0] c2_out_i,
    input  wire         [12:0] d1_k_i,
    input  wire         [12:0] c1_k_i,
    input  wire         [12:0] c2_k_i,
    input  wire         [23:0] d1_theta_i,
    input  wire         [23:0] c1_theta_i,
    input  wire         [23:0] c2_theta_i,
    input  wire         [10:0] c1_bias_i,
    input  wire                c2_bias_i,
    input  wire                c3_bias_i,
    input  wire         [ 1:0] mode_i,
    input  wire         [ 3:0] steps_i,
    // inputs of a sample
    input  wire                sample_valid_i,
    input  wire                sample_first_i,
    output wire                sample_done_o,
    output wire         [ 4:0] feature_index_o,
    input  wire         [11:0] feature_i,
    output wire         [ 7:0] dir_index_o,
    input  wire         [11:0] dir_i,
    // currents of D2 and C3 for the readout, a step per cycle. Once begun, all steps of a sample come.
    input  wire                density_ready_i,
    output wire                density_begin_o,
    output wire                density_valid_o,
    output wire         [ 2:0] density_step_o,
    output wire                density_last_o,
    output wire         [15:0] density_o,
    input  wire                colour_ready_i,
    output wire                colour_begin_o,
    output wire                colour_valid_o,
    output wire         [ 2:0] colour_step_o,
    output wire                colour_last_o,
    output wire         [47:0] colour_o,
    // events, in the cycle in which they happen
    output wire                d1_row_o,           // a row of weights is read
    output wire                c1_row_o,
    output wire                c1_bias_row_o,
    output wire                c1_products_o,      // a row is multiplied, at this step
    output wire         [ 2:0] c1_step_o,
    output wire                d2_row_o,           // a row is read,
    output wire         [ 7:0] d2_fired_o,         // and the steps at which its neuron fired
    output wire                c2_row_o,
    output wire         [ 7:0] c2_fired_o,
    output wire                c2_bias_row_o,
    output wire                c3_row_o,
    output wire         [ 7:0] c3_fired_o,
    output wire                c3_bias_row_o,
    output wire         [ 4:0] busy_o,             // a layer works, in the order of the layers
    output wire                ray_o,
    output wire                neurons_valid_o,    // a group of neurons has made a step
    output wire         [ 1:0] neurons_layer_o,    // 0: D1, 1: C1, 2: C2
    output wire         [ 2:0] neurons_step_o,
    output wire                neurons_last_o,     // the layer's last group
    output wire         [ 8:0] neurons_fired_o,
    output wire                stall_o,            // a layer waits for the readout
    // tap
    output wire                tap_valid_o,
    output wire         [ 2:0] tap_layer_o,
    output wire         [ 2:0] tap_step_o,
    output wire [   LANES-1:0] tap_spikes_o,
    output wire [   LANES-1:0] tap_rows_o,
    output wire [24*LANES-1:0] tap_membrane_o
);
  localparam WORD_BITS = $clog2(LANES / 4);
  localparam GROUPS = LANES / NEURONS;
  localparam GROUP_BITS = GROUPS > 1 ? $clog2(GROUPS) : 1;
  localparam PARTS = LANES / MACS;
  localparam PART_BITS = PARTS > 1 ? $clog2(PARTS) : 1;
  localparam PART_GROUPS = MACS / NEURONS;
  localparam DEPTH = 6;  // of the neurons: cycles between two steps of a group
  localparam [1:0] D1 = 2'd0;
  localparam [1:0] C1 = 2'd1;
  localparam [1:0] C2 = 2'd2;

  wire [WORD_BITS-1:0] word = wword_i[WORD_BITS-1:0];

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

  // ---- whose neurons step. The layer nearest to the output goes first.
  wire d1_full, c1_full, c2_full, space_d2, space_c2, space_c3;
  reg active_q;
  reg [1:0] layer_q;
  reg [2:0] step_q;
  reg [GROUP_BITS-1:0] group_q;
  reg [2:0] wait_q;       // cycles until the next step may begin
  reg released_q;         // the last load of C2's sums is on its way
  wire want_c2 = c2_full && !released_q && space_c3;
  wire want_c1 = c1_full && space_c2;
  wire want_d1 = d1_full && space_d2;
  wire [1:0] layer = active_q ? layer_q : want_c2 ? C2 : want_c1 ? C1 : D1;
  wire run = active_q ? wait_q == 3'd0 : want_c2 || want_c1 || want_d1;
  wire [GROUP_BITS-1:0] last_group = layer == C2 ? c2_group_q : layer == C1 ? c1_group_q : d1_group_q;
  wire [PART_BITS-1:0] last_part = layer == C2 ? c2_part_q : layer == C1 ? c1_part_q : d1_part_q;
  wire [PART_BITS-1:0] part = PART_BITS'(32'(group_q) / PART_GROUPS);
  wire at_part = run && 32'(group_q) % PART_GROUPS == 0;
  wire group_ends = group_q == last_group;
  wire last_step = {1'b0, step_q} == steps_i - 4'd1;
  // The current of D1, and of a decoder's C1, is that of all steps: of a layer of one part it stays where it was loaded to.
  wire stays = (layer == D1 || (layer == C1 && decodes_i)) && last_part == {PART_BITS{1'b0}};
  wire load = at_part && !(stays && step_q != 3'd0);
  wire taken = load && (last_step || stays) && part == last_part;
  wire begins = run && !active_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {active_q, layer_q, step_q, wait_q, released_q} <= 10'd0;
      group_q <= {GROUP_BITS{1'b0}};
    end else if (clear_i) begin
      {active_q, layer_q, step_q, wait_q, released_q} <= 10'd0;
      group_q <= {GROUP_BITS{1'b0}};
    end else begin
      released_q <= taken && layer == C2;
      if (run) begin
        active_q <= !(group_ends && last_step);
        layer_q <= layer;
        group_q <= group_ends ? {GROUP_BITS{1'b0}} : group_q + 1'b1;
        if (group_ends) step_q <= last_step ? 3'd0 : step_q + 3'd1;
        if (group_ends && !last_step && 32'(last_group) < DEPTH - 1) wait_q <= 3'(DEPTH - 1 - 32'(last_group));
      end else if (wait_q != 3'd0) wait_q <= wait_q - 3'd1;
    end
  end

  // ---- from a group's turn to its currents: four cycles
  reg [3:0] run_q, last_q;
  reg load_q;
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
    run_layer_q <= {run_layer_q[5:0], layer};
    run_step_q <= {run_step_q[8:0], step_q};
    run_group_q <= {run_group_q[3*GROUP_BITS-1:0], group_q};
    load_part_q <= part;
  end

  wire [24*MACS-1:0] values;
  wire [16*MACS-1:0] c2_sums;
  // The group whose turn it is, of the part that was loaded last.
  wire [GROUP_BITS-1:0] place = run_group_q[3*GROUP_BITS+:GROUP_BITS] & GROUP_BITS'(PART_GROUPS - 1);
  wire of_c2 = run_layer_q[6+:2] == C2;
  reg [24*NEURONS-1:0] current;
  always_comb begin
    current = {(24 * NEURONS) {1'b0}};
    for (int g = 0; g < PART_GROUPS; g++) begin
      if (place == GROUP_BITS'(g)) begin
        for (int n = 0; n < NEURONS; n++)
          current[24*n+:24] = of_c2 ? 24'($signed(c2_sums[16*(NEURONS*g+n)+:16])) <<< sf_arch_pkg::AC_FRAC
                            : values[24*(NEURONS*g+n)+:24];
      end
    end
  end

  wire spikes_valid, spikes_last, neurons_idle;
  wire [1:0] spikes_layer;
  wire [2:0] spikes_step;
  wire [GROUP_BITS-1:0] spikes_group;
  wire [NEURONS-1:0] spikes;
  wire [24*NEURONS-1:0] membrane;
  sf_neurons #(
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS)
  ) u_neurons (
      .clk_i     (clk_i),
      .rst_ni    (rst_ni),
      .clear_i   (clear_i),
      .mode_i    (mode_i),
      .d1_k_i    (d1_k_i),
      .c1_k_i    (c1_k_i),
      .c2_k_i    (c2_k_i),
      .d1_theta_i(d1_theta_i),
      .c1_theta_i(c1_theta_i),
      .c2_theta_i(c2_theta_i),
      .d1_out_i  (d1_out_i),
      .c1_out_i  (c1_out_i),
      .c2_out_i  (c2_out_i),
      .valid_i   (run_q[3]),
      .layer_i   (run_layer_q[6+:2]),
      .step_i    (run_step_q[9+:3]),
      .group_i   (run_group_q[3*GROUP_BITS+:GROUP_BITS]),
      .last_i    (last_q[3]),
      .current_i (current),
      .valid_o   (spikes_valid),
      .layer_o   (spikes_layer),
      .step_o    (spikes_step),
      .group_o   (spikes_group),
      .last_o    (spikes_last),
      .spikes_o  (spikes),
      .membrane_o(membrane),
      .idle_o    (neurons_idle)
  );
  reg neurons_valid_q, neurons_last_q;
  reg [1:0] neurons_layer_q;
  reg [2:0] neurons_step_q;
  reg [8:0] neurons_fired_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) neurons_valid_q <= 1'b0;
    else neurons_valid_q <= spikes_valid;
  end
  always_ff @(posedge clk_i) begin
    neurons_last_q <= spikes_last;
    neurons_layer_q <= spikes_layer;
    neurons_step_q <= spikes_step;
    neurons_fired_q <= 9'($countones(spikes));
  end
  assign neurons_valid_o = neurons_valid_q;
  assign neurons_last_o = neurons_last_q;
  assign neurons_layer_o = neurons_layer_q;
  assign neurons_step_o = neurons_step_q;
  assign neurons_fired_o = neurons_fired_q;

  // ---- D1 and C1. Directions and marks of a ray's first sample wait for C1; at most 10 samples are between the two.
  reg [11:0] dir_q[0:255];
  reg [15:0] mark_q;
  reg [3:0] mark_write_q, mark_read_q, ray_write_q, ray_read_q;
  wire dir_we, values_done, h_done, values_idle;
  wire [1:0] values_busy;
  wire d1_done = values_done && !decodes_i;
  reg [1:0] h_taken_q, h_full_q;  // samples of h: promised, complete
  reg h_write_q, h_read_q;
  wire [2:0] h_step;
  wire [3:0] h_index;
  wire [11:0] h;
  sf_values #(
      .LANES    (LANES),
      .MACS     (MACS),
      .PART_BITS(PART_BITS)
  ) u_values (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .decodes_i      (decodes_i),
      .n_feature_i    (d1_in_i),
      .n_dir_i        (n_dir_i),
      .bias_i         (c1_bias_i),
      .n_h_i          (n_h_i),
      .steps_i        (steps_i),
      .d1_part_i      (d1_part_q),
      .c1_part_i      (c1_part_q),
      .d1_we_i        (we_i && wlayer_i == sf_op_pkg::D1),
      .c1_we_i        (we_i && wlayer_i == sf_op_pkg::C1),
      .wrow_i         (wrow_i),
      .wword_i        (word),
      .wdata_i        (wdata_i),
      .valid_i        (sample_valid_i && !hold_i),
      .first_i        (sample_first_i),
      .done_o         (values_done),
      .feature_index_o(feature_index_o),
      .feature_i      (feature_i),
      .dir_we_o       (dir_we),
      .dir_index_o    (dir_index_o),
      .dir_i          (dir_i),
      .h_valid_i      (h_full_q != 2'd0),
      .h_first_i      (mark_q[mark_read_q]),
      .h_done_o       (h_done),
      .h_step_o       (h_step),
      .h_index_o      (h_index),
      .h_i            (h),
      .h_dir_i        (dir_q[{ray_read_q, dir_index_o[3:0]}]),
      .d1_full_o      (d1_full),
      .c1_full_o      (c1_full),
      .d1_taken_i     (taken && layer == D1),
      .c1_taken_i     (taken && layer == C1),
      .load_i         (load && layer != C2),
      .load_c1_i      (layer == C1),
      .load_step_i    (step_q),
      .load_part_i    (part),
      .current_o      (values),
      .d1_row_o       (d1_row_o),
      .c1_row_o       (c1_row_o),
      .c1_bias_row_o  (c1_bias_row_o),
      .c1_products_o  (c1_products_o),
      .c1_step_o      (c1_step_o),
      .ray_o          (ray_o),
      .busy_o         (values_busy),
      .idle_o         (values_idle)
  );
  assign sample_done_o = values_done;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {mark_write_q, mark_read_q, ray_write_q, ray_read_q} <= 16'd0;
    else if (clear_i) {mark_write_q, mark_read_q, ray_write_q, ray_read_q} <= 16'd0;
    else begin
      if (d1_done) mark_write_q <= mark_write_q + 4'd1;
      if (d1_done && sample_first_i) ray_write_q <= ray_write_q + 4'd1;
      if (h_done) mark_read_q <= mark_read_q + 4'd1;
      if (ray_o) ray_read_q <= ray_read_q + 4'd1;
    end
  end
  always_ff @(posedge clk_i) begin
    if (d1_done) mark_q[mark_write_q] <= sample_first_i;
    if (dir_we) dir_q[{ray_write_q, dir_index_o[3:0]}] <= dir_i;
  end

  // ---- D2, C2, C3
  wire d2_full, load_d2, last_d2, busy_d2, idle_d2;
  wire [2:0] step_d2;
  wire [LANES-1:0] d2_rows;
  wire [255:0] d2_sums;
  wire unused_d2_bias;
  sf_fed #(
      .LANES     (LANES),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS),
      .OUTS      (16),
      .ADDERS    (16),
      .PART_BITS (1),
      .BANKS     (4),
      .TAP       (TAP)
  ) u_d2 (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .has_bias_i    (1'b0),
      .steps_i       (steps_i),
      .last_group_i  (d1_group_q),
      .last_part_i   (1'b0),
      .we_i          (we_i && wlayer_i == sf_op_pkg::D2),
      .wrow_i        (wrow_i),
      .wword_i       (word[1:0]),
      .wdata_i       (wdata_i),
      .take_i        (begins && layer == D1),
      .space_o       (space_d2),
      .spikes_valid_i(spikes_valid && spikes_layer == D1),
      .spikes_step_i (spikes_step),
      .spikes_group_i(spikes_group),
      .spikes_i      (spikes),
      .full_o        (d2_full),
      .load_i        (load_d2),
      .load_step_i   (step_d2),
      .load_part_i   (1'b0),
      .release_i     (last_d2),
      .sums_o        (d2_sums),
      .row_o         (d2_row_o),
      .fired_o       (d2_fired_o),
      .bias_row_o    (unused_d2_bias),
      .busy_o        (busy_d2),
      .idle_o        (idle_d2),
      .tap_rows_o    (d2_rows)
  );

  wire load_c2, last_c2, busy_c2, idle_c2;
  wire [2:0] step_c2;
  wire [LANES-1:0] c2_rows;
  sf_fed #(
      .LANES     (LANES),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS),
      .OUTS      (LANES),
      .ADDERS    (MACS),
      .PART_BITS (PART_BITS),
      .BANKS     (STEPS_AT_ONCE),
      .TAP       (TAP)
  ) u_c2 (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .has_bias_i    (c2_bias_i),
      .steps_i       (steps_i),
      .last_group_i  (c1_group_q),
      .last_part_i   (c2_part_q),
      .we_i          (we_i && wlayer_i == sf_op_pkg::C2),
      .wrow_i        (wrow_i),
      .wword_i       (word),
      .wdata_i       (wdata_i),
      .take_i        (begins && layer == C1),
      .space_o       (space_c2),
      .spikes_valid_i(spikes_valid && spikes_layer == C1),
      .spikes_step_i (spikes_step),
      .spikes_group_i(spikes_group),
      .spikes_i      (spikes),
      .full_o        (c2_full),
      .load_i        (load_c2),
      .load_step_i   (step_c2),
      .load_part_i   (load_part_q),
      .release_i     (last_c2),
      .sums_o        (c2_sums),
      .row_o         (c2_row_o),
      .fired_o       (c2_fired_o),
      .bias_row_o    (c2_bias_row_o),
      .busy_o        (busy_c2),
      .idle_o        (idle_c2),
      .tap_rows_o    (c2_rows)
  );
  assign load_c2 = load_q && run_layer_q[1:0] == C2;
  assign step_c2 = run_step_q[2:0];
  assign last_c2 = released_q;

  wire c3_full, load_c3, last_c3, busy_c3, idle_c3;
  wire [2:0] step_c3;
  wire [LANES-1:0] c3_rows;
  wire [255:0] c3_sums;
  sf_fed #(
      .LANES     (LANES),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS),
      .OUTS      (16),
      .ADDERS    (16),
      .PART_BITS (1),
      .BANKS     (4),
      .TAP       (TAP)
  ) u_c3 (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .has_bias_i    (c3_bias_i),
      .steps_i       (steps_i),
      .last_group_i  (c2_group_q),
      .last_part_i   (1'b0),
      .we_i          (we_i && wlayer_i == sf_op_pkg::C3),
      .wrow_i        (wrow_i),
      .wword_i       (word[1:0]),
      .wdata_i       (wdata_i),
      .take_i        (begins && layer == C2),
      .space_o       (space_c3),
      .spikes_valid_i(spikes_valid && spikes_layer == C2),
      .spikes_step_i (spikes_step),
      .spikes_group_i(spikes_group),
      .spikes_i      (spikes),
      .full_o        (c3_full),
      .load_i        (load_c3),
      .load_step_i   (step_c3),
      .load_part_i   (1'b0),
      .release_i     (last_c3),
      .sums_o        (c3_sums),
      .row_o         (c3_row_o),
      .fired_o       (c3_fired_o),
      .bias_row_o    (c3_bias_row_o),
      .busy_o        (busy_c3),
      .idle_o        (idle_c3),
      .tap_rows_o    (c3_rows)
  );

  // ---- D2's sums, a step per cycle: the density to the readout, the others as h to C1. h = current >>> H_SHIFT: 16384 >> 3
  // fits 12 bits; with a smaller H_SHIFT the scene's weights see to it.
  reg [2:0] read_d2_q, read_c3_q;  // a step's sums are there in three cycles, in two, in one
  reg [8:0] read_d2_step_q, read_c3_step_q;
  reg [2:0] read_d2_last_q, read_c3_last_q;
  reg reading_d2_q, reading_c3_q;
  reg [2:0] next_d2_q, next_c3_q;
  wire d2_begins = !reading_d2_q && d2_full && density_ready_i && !h_taken_q[1];
  wire c3_begins = !reading_c3_q && c3_full && colour_ready_i;
  assign load_d2 = d2_begins || reading_d2_q;
  assign load_c3 = c3_begins || reading_c3_q;
  assign step_d2 = next_d2_q;
  assign step_c3 = next_c3_q;
  assign last_d2 = load_d2 && {1'b0, next_d2_q} == steps_i - 4'd1;
  assign last_c3 = load_c3 && {1'b0, next_c3_q} == steps_i - 4'd1;
  wire h_complete = read_d2_q[2] && read_d2_last_q[2];
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {reading_d2_q, reading_c3_q, next_d2_q, next_c3_q, read_d2_q, read_c3_q} <= 14'd0;
      {h_taken_q, h_full_q, h_write_q, h_read_q} <= 6'd0;
    end else if (clear_i) begin
      {reading_d2_q, reading_c3_q, next_d2_q, next_c3_q, read_d2_q, read_c3_q} <= 14'd0;
      {h_taken_q, h_full_q, h_write_q, h_read_q} <= 6'd0;
    end else begin
      reading_d2_q <= load_d2 && !last_d2;
      reading_c3_q <= load_c3 && !last_c3;
      if (load_d2) next_d2_q <= last_d2 ? 3'd0 : next_d2_q + 3'd1;
      if (load_c3) next_c3_q <= last_c3 ? 3'd0 : next_c3_q + 3'd1;
      read_d2_q <= {read_d2_q[1:0], load_d2};
      read_c3_q <= {read_c3_q[1:0], load_c3};
      h_taken_q <= h_taken_q + {1'b0, d2_begins} - {1'b0, h_done};
      h_full_q <= h_full_q + {1'b0, h_complete} - {1'b0, h_done};
      if (h_complete) h_write_q <= !h_write_q;
      if (h_done) h_read_q <= !h_read_q;
    end
  end
  reg [179:0] h_q[0:15];  // 15 values by {sample, step}
  wire [179:0] h_sums;
  genvar l;
  generate
    for (l = 0; l < 15; l = l + 1) begin : g_h
      assign h_sums[12*l+:12] = d2_sums[16*(l+1)+sf_arch_pkg::H_SHIFT+:12];
    end
  endgenerate
  wire [179:0] h_word = h_q[{h_read_q, h_step}];
  reg [11:0] h_value;
  always_comb begin
    h_value = 12'd0;
    for (int i = 0; i < 15; i++) if (h_index == 4'(i)) h_value = h_word[12*i+:12];
  end
  assign h = h_value;
  always_ff @(posedge clk_i) begin
    read_d2_step_q <= {read_d2_step_q[5:0], next_d2_q};
    read_c3_step_q <= {read_c3_step_q[5:0], next_c3_q};
    read_d2_last_q <= {read_d2_last_q[1:0], last_d2};
    read_c3_last_q <= {read_c3_last_q[1:0], last_c3};
    if (read_d2_q[2]) h_q[{h_write_q, read_d2_step_q[8:6]}] <= h_sums;
  end
  assign density_begin_o = d2_begins;
  assign density_valid_o = read_d2_q[2];
  assign density_step_o = read_d2_step_q[8:6];
  assign density_last_o = read_d2_last_q[2];
  assign density_o = d2_sums[15:0];
  assign colour_begin_o = c3_begins;
  assign colour_valid_o = read_c3_q[2];
  assign colour_step_o = read_c3_step_q[8:6];
  assign colour_last_o = read_c3_last_q[2];
  assign colour_o = c3_sums[47:0];
  assign busy_o = {busy_c3, busy_c2, values_busy[1], busy_d2, values_busy[0]};

  wire unused_ok = &{1'b0, wword_i, d2_sums, c3_sums, unused_d2_bias};

  assign stall_o = (c3_full && !reading_c3_q && !colour_ready_i) || (d2_full && !reading_d2_q && !density_ready_i);
  assign idle_o = values_idle && idle_d2 && idle_c2 && idle_c3 && !active_q && run_q == 4'd0 && neurons_idle && !neurons_valid_q && h_taken_q == 2'd0 && read_d2_q == 3'd0
      && read_c3_q == 3'd0;

  // Tap: one beat per spiking layer and step, one per sample of D2 and C3, which wait for a cycle without another.
  generate
    if (TAP != 0) begin : g_tap
      reg [LANES-1:0] spikes_all_q, d2_all_q, c3_all_q;
      reg [24*LANES-1:0] membrane_all_q;
      reg valid_q, beat_q;
      reg [2:0] tap_layer_q, beat_layer_q;
      reg [2:0] tap_step_q, beat_step_q;
      reg [LANES-1:0] spikes_q, rows_q;
      reg [24*LANES-1:0] membrane_q;
      // rows behind the steps of C2 on their way through the neurons; behind the samples of D2 and C3
      reg [LANES-1:0] c2_rows_q[0:15], d2_rows_q[0:15], c3_rows_q[0:15];
      reg [3:0] c2_write_q, c2_read_q, d2_write_q, d2_read_q, c3_write_q, c3_read_q;
      reg c2_loaded_q;
      wire send_d2 = !beat_q && d2_read_q != d2_write_q;
      wire send_c3 = !beat_q && !send_d2 && c3_read_q != c3_write_q;
      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          {valid_q, beat_q, c2_loaded_q} <= 3'd0;
          {c2_write_q, c2_read_q, d2_write_q, d2_read_q, c3_write_q, c3_read_q} <= 24'd0;
        end else if (clear_i) begin
          {valid_q, beat_q, c2_loaded_q} <= 3'd0;
          {c2_write_q, c2_read_q, d2_write_q, d2_read_q, c3_write_q, c3_read_q} <= 24'd0;
        end else begin
          c2_loaded_q <= load_c2 && load_part_q == {PART_BITS{1'b0}};
          if (c2_loaded_q) c2_write_q <= c2_write_q + 4'd1;
          beat_q <= spikes_valid && spikes_last;
          if (beat_q && beat_layer_q == sf_op_pkg::C2) c2_read_q <= c2_read_q + 4'd1;
          if (read_d2_q[1] && read_d2_last_q[1]) d2_write_q <= d2_write_q + 4'd1;
          if (read_c3_q[1] && read_c3_last_q[1]) c3_write_q <= c3_write_q + 4'd1;
          if (send_d2) d2_read_q <= d2_read_q + 4'd1;
          if (send_c3) c3_read_q <= c3_read_q + 4'd1;
          valid_q <= beat_q || send_d2 || send_c3;
        end
      end
      always_ff @(posedge clk_i) begin
        if (c2_loaded_q) c2_rows_q[c2_write_q] <= c2_rows;
        if (read_d2_q[0]) d2_all_q <= read_d2_step_q[2:0] == 3'd0 ? d2_rows : d2_all_q | d2_rows;
        if (read_c3_q[0]) c3_all_q <= read_c3_step_q[2:0] == 3'd0 ? c3_rows : c3_all_q | c3_rows;
        if (read_d2_q[1]) d2_rows_q[d2_write_q] <= d2_all_q;
        if (read_c3_q[1]) c3_rows_q[c3_write_q] <= c3_all_q;
        if (spikes_valid) begin
          if (spikes_group == {GROUP_BITS{1'b0}}) begin
            spikes_all_q <= LANES'(spikes);
          end else spikes_all_q[NEURONS*spikes_group+:NEURONS] <= spikes;
          membrane_all_q[24*NEURONS*spikes_group+:24*NEURONS] <= membrane;
        end
        beat_layer_q <= spikes_layer == C2 ? sf_op_pkg::C2 : spikes_layer == C1 ? sf_op_pkg::C1 : sf_op_pkg::D1;
        beat_step_q <= spikes_step;
        tap_layer_q <= beat_q ? beat_layer_q : send_d2 ? sf_op_pkg::D2 : sf_op_pkg::C3;
        tap_step_q <= beat_q ? beat_step_q : 3'd0;
        spikes_q <= beat_q ? spikes_all_q : {LANES{1'b0}};
        if (beat_q) membrane_q <= membrane_all_q;
        rows_q <= send_d2 ? d2_rows_q[d2_read_q] : send_c3 ? c3_rows_q[c3_read_q]
                : beat_layer_q == sf_op_pkg::C2 ? c2_rows_q[c2_read_q] : {LANES{1'b0}};
      end
      assign tap_valid_o = valid_q;
      assign tap_layer_o = tap_layer_q;
      assign tap_step_o = tap_step_q;
      assign tap_spikes_o = spikes_q;
      assign tap_rows_o = rows_q;
      assign tap_membrane_o = membrane_q;
    end else begin : g_no_tap
      assign {tap_valid_o, tap_layer_o, tap_step_o} = 7'd0;
      assign tap_spikes_o = {LANES{1'b0}};
      assign tap_rows_o = {LANES{1'b0}};
      assign tap_membrane_o = {(24 * LANES) {1'b0}};
      wire unused_tap_ok = &{1'b0, membrane, c2_rows, d2_rows, c3_rows};
    end
  endgenerate
endmodule

`default_nettype wire
