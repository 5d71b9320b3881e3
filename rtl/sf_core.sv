// Layer engine: D1, D2, C1, C2 and C3 work at the same time, each on a sample of its own. D1 and C1 share one array of
// multipliers (sf_values), the spiking layers one set of neuron units (sf_neurons). sf_turns says whose neurons step.
// D2, C2 and C3 are in sf_fed_layers. Mirror: src/fx/net.c
//
//   D1 -> neurons -> spikes -> D2 -> h -> C1 -> neurons -> spikes -> C2 -> neurons -> spikes -> C3
//
// A layer's sums of a sample wait, complete, until the neurons take them. Cycles without stalls: src/cycles/cycles.c
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
    output wire                neurons_valid_o,    // a group of neurons had a turn
    output wire         [ 1:0] neurons_layer_o,    // 0: D1, 1: C1, 2: C2
    output wire         [ 2:0] neurons_step_o,
    output wire                neurons_first_o,    // the sample's first
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
  localparam GROUPS = LANES / NEURONS;
  localparam GROUP_BITS = GROUPS > 1 ? $clog2(GROUPS) : 1;
  localparam PARTS = LANES / MACS;
  localparam PART_BITS = PARTS > 1 ? $clog2(PARTS) : 1;
  wire [$clog2(LANES/4)-1:0] wword = wword_i[$clog2(LANES/4)-1:0];
  wire unused_ok = &{1'b0, wword_i};

  // ---- whose neurons step: a bit for D1, C1 and C2, from bit 0 on
  wire [2:0] full, space, take;
  wire [GROUP_BITS-1:0] d1_group, c1_group, c2_group;
  wire [PART_BITS-1:0] d1_part, c1_part, c2_part, load_part, load_c2_part;
  wire load, load_c1, d1_taken, c1_taken, load_c2, release_c2, idle_turns;
  wire [2:0] load_step, load_c2_step;
  wire turn_valid, turn_last;
  wire [1:0] turn_layer;
  wire [2:0] turn_step;
  wire turn_first, turn_charges, turn_fires;
  wire radix = mode_i == sf_op_pkg::RADIX;
  wire [GROUP_BITS-1:0] turn_group;
  sf_turns #(
      .MACS      (MACS),
      .PART_BITS (PART_BITS),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS)
  ) u_turns (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .decodes_i     (decodes_i),
      .radix_i       (radix),
      .steps_i       (steps_i),
      .d1_out_i      (d1_out_i),
      .c1_out_i      (c1_out_i),
      .c2_out_i      (c2_out_i),
      .d1_group_o    (d1_group),
      .c1_group_o    (c1_group),
      .c2_group_o    (c2_group),
      .d1_part_o     (d1_part),
      .c1_part_o     (c1_part),
      .c2_part_o     (c2_part),
      .full_i        (full),
      .space_i       (space),
      .take_o        (take),
      .load_o        (load),
      .load_c1_o     (load_c1),
      .load_step_o   (load_step),
      .load_part_o   (load_part),
      .d1_taken_o    (d1_taken),
      .c1_taken_o    (c1_taken),
      .load_c2_o     (load_c2),
      .load_c2_step_o(load_c2_step),
      .load_c2_part_o(load_c2_part),
      .release_c2_o  (release_c2),
      .valid_o       (turn_valid),
      .layer_o       (turn_layer),
      .step_o        (turn_step),
      .first_o       (turn_first),
      .charges_o     (turn_charges),
      .fires_o       (turn_fires),
      .group_o       (turn_group),
      .last_o        (turn_last),
      .idle_o        (idle_turns)
  );

  // ---- from currents to spikes
  wire [24*MACS-1:0] values;
  wire [16*MACS-1:0] c2_sums;
  wire spikes_valid, spikes_last, idle_neurons;
  wire [1:0] spikes_layer;
  wire [2:0] spikes_step;
  wire [GROUP_BITS-1:0] spikes_group;
  wire [NEURONS-1:0] spikes;
  wire [24*NEURONS-1:0] membrane;
  sf_neurons #(
      .MACS      (MACS),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS)
  ) u_neurons (
      .clk_i        (clk_i),
      .rst_ni       (rst_ni),
      .clear_i      (clear_i),
      .mode_i       (mode_i),
      .steps_i      (steps_i),
      .d1_k_i       (d1_k_i),
      .c1_k_i       (c1_k_i),
      .c2_k_i       (c2_k_i),
      .d1_theta_i   (d1_theta_i),
      .c1_theta_i   (c1_theta_i),
      .c2_theta_i   (c2_theta_i),
      .d1_out_i     (d1_out_i),
      .c1_out_i     (c1_out_i),
      .c2_out_i     (c2_out_i),
      .valid_i      (turn_valid),
      .layer_i      (turn_layer),
      .step_i       (turn_step),
      .first_i      (turn_first),
      .charges_i    (turn_charges),
      .fires_i      (turn_fires),
      .group_i      (turn_group),
      .last_i       (turn_last),
      .values_i     (values),
      .c2_sums_i    (c2_sums),
      .valid_o      (spikes_valid),
      .layer_o      (spikes_layer),
      .step_o       (spikes_step),
      .group_o      (spikes_group),
      .last_o       (spikes_last),
      .spikes_o     (spikes),
      .membrane_o   (membrane),
      .count_o      (neurons_valid_o),
      .count_layer_o(neurons_layer_o),
      .count_step_o (neurons_step_o),
      .count_first_o(neurons_first_o),
      .count_last_o (neurons_last_o),
      .count_fired_o(neurons_fired_o),
      .idle_o       (idle_neurons)
  );

  // ---- D1 and C1
  wire dir_we, h_valid, h_first, h_done, idle_values;
  wire [2:0] h_step;
  wire [3:0] h_index;
  wire [11:0] h, h_dir;
  wire [1:0] busy_values;
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
      .radix_i        (radix),
      .steps_i        (steps_i),
      .d1_part_i      (d1_part),
      .c1_part_i      (c1_part),
      .d1_we_i        (we_i && wlayer_i == sf_op_pkg::D1),
      .c1_we_i        (we_i && wlayer_i == sf_op_pkg::C1),
      .wrow_i         (wrow_i),
      .wword_i        (wword),
      .wdata_i        (wdata_i),
      .valid_i        (sample_valid_i && !hold_i),
      .first_i        (sample_first_i),
      .done_o         (sample_done_o),
      .feature_index_o(feature_index_o),
      .feature_i      (feature_i),
      .dir_we_o       (dir_we),
      .dir_index_o    (dir_index_o),
      .dir_i          (dir_i),
      .h_valid_i      (h_valid),
      .h_first_i      (h_first),
      .h_done_o       (h_done),
      .h_step_o       (h_step),
      .h_index_o      (h_index),
      .h_i            (h),
      .h_dir_i        (h_dir),
      .d1_full_o      (full[sf_op_pkg::SPIKING_D1]),
      .c1_full_o      (full[sf_op_pkg::SPIKING_C1]),
      .d1_taken_i     (d1_taken),
      .c1_taken_i     (c1_taken),
      .load_i         (load),
      .load_c1_i      (load_c1),
      .load_step_i    (load_step),
      .load_part_i    (load_part),
      .current_o      (values),
      .d1_row_o       (d1_row_o),
      .c1_row_o       (c1_row_o),
      .c1_bias_row_o  (c1_bias_row_o),
      .c1_products_o  (c1_products_o),
      .c1_step_o      (c1_step_o),
      .ray_o          (ray_o),
      .busy_o         (busy_values),
      .idle_o         (idle_values)
  );

  // ---- what waits for C1
  wire h_room, idle_inputs;
  wire [255:0] d2_sums;
  sf_c1_inputs u_c1_inputs (
      .clk_i      (clk_i),
      .rst_ni     (rst_ni),
      .clear_i    (clear_i),
      .radix_i    (radix),
      .steps_i    (steps_i),
      .d1_done_i  (sample_done_o && !decodes_i),
      .d1_first_i (sample_first_i),
      .dir_we_i   (dir_we),
      .dir_index_i(dir_index_o[3:0]),
      .dir_i      (dir_i),
      .room_o     (h_room),
      .begin_i    (density_begin_o),
      .valid_i    (density_valid_o),
      .step_i     (density_step_o),
      .last_i     (density_last_o),
      .sums_i     (d2_sums[255:16]),
      .valid_o    (h_valid),
      .first_o    (h_first),
      .done_i     (h_done),
      .ray_i      (ray_o),
      .dir_o      (h_dir),
      .h_step_i   (h_step),
      .h_index_i  (h_index),
      .h_o        (h),
      .idle_o     (idle_inputs)
  );

  // ---- D2, C2, C3: of D2's sums the first is the density, the others are h
  wire [2:0] busy_fed;
  wire idle_fed;
  sf_fed_layers #(
      .TAP          (TAP),
      .LANES        (LANES),
      .MACS         (MACS),
      .PART_BITS    (PART_BITS),
      .NEURONS      (NEURONS),
      .GROUP_BITS   (GROUP_BITS),
      .STEPS_AT_ONCE(STEPS_AT_ONCE)
  ) u_fed (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .c2_bias_i     (c2_bias_i),
      .c3_bias_i     (c3_bias_i),
      .steps_i       (steps_i),
      .d1_group_i    (d1_group),
      .c1_group_i    (c1_group),
      .c2_group_i    (c2_group),
      .c2_part_i     (c2_part),
      .we_i          (we_i),
      .wlayer_i      (wlayer_i),
      .wrow_i        (wrow_i),
      .wword_i       (wword),
      .wdata_i       (wdata_i),
      .take_i        (take),
      .space_o       (space),
      .spikes_valid_i(spikes_valid),
      .spikes_layer_i(spikes_layer),
      .spikes_step_i (spikes_step),
      .spikes_group_i(spikes_group),
      .spikes_last_i (spikes_last),
      .spikes_i      (spikes),
      .membrane_i    (membrane),
      .d2_ready_i    (density_ready_i),
      .d2_room_i     (h_room),
      .d2_begin_o    (density_begin_o),
      .d2_valid_o    (density_valid_o),
      .d2_step_o     (density_step_o),
      .d2_last_o     (density_last_o),
      .d2_sums_o     (d2_sums),
      .c2_full_o     (full[sf_op_pkg::SPIKING_C2]),
      .c2_load_i     (load_c2),
      .c2_load_step_i(load_c2_step),
      .c2_load_part_i(load_c2_part),
      .c2_release_i  (release_c2),
      .c2_sums_o     (c2_sums),
      .c3_ready_i    (colour_ready_i),
      .c3_begin_o    (colour_begin_o),
      .c3_valid_o    (colour_valid_o),
      .c3_step_o     (colour_step_o),
      .c3_last_o     (colour_last_o),
      .c3_sums_o     (colour_o),
      .d2_row_o      (d2_row_o),
      .d2_fired_o    (d2_fired_o),
      .c2_row_o      (c2_row_o),
      .c2_fired_o    (c2_fired_o),
      .c2_bias_row_o (c2_bias_row_o),
      .c3_row_o      (c3_row_o),
      .c3_fired_o    (c3_fired_o),
      .c3_bias_row_o (c3_bias_row_o),
      .busy_o        (busy_fed),
      .stall_o       (stall_o),
      .idle_o        (idle_fed),
      .tap_valid_o   (tap_valid_o),
      .tap_layer_o   (tap_layer_o),
      .tap_step_o    (tap_step_o),
      .tap_spikes_o  (tap_spikes_o),
      .tap_rows_o    (tap_rows_o),
      .tap_membrane_o(tap_membrane_o)
  );
  assign density_o = d2_sums[15:0];
  assign busy_o = {busy_fed[2], busy_fed[1], busy_values[1], busy_fed[0], busy_values[0]};
  assign idle_o = idle_turns && idle_neurons && idle_values && idle_inputs && idle_fed;
endmodule

`default_nettype wire
