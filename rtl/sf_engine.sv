// The engine: the layers, the readout behind them, and the counters of their events.
`default_nettype none

module sf_engine #(
    parameter TAP = 1,
    parameter LANES = 128,       // these as sf_top's
    parameter MACS = 128,
    parameter NEURONS = 16,
    parameter STEPS_AT_ONCE = 2
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    output wire                idle_o,
    // programming of the layers, as sf_csr has checked it
    input  wire                we_i,
    input  wire [         2:0] wlayer_i,
    input  wire [         8:0] wrow_i,
    input  wire [         5:0] wword_i,
    input  wire [        31:0] wdata_i,
    input  wire [         1:0] mode_i,
    input  wire [         3:0] steps_i,
    input  wire                decodes_i,          // no D1 and D2
    input  wire [         5:0] d1_in_i,
    input  wire [         7:0] n_dir_i,            // constant inputs of C1
    input  wire [         4:0] n_h_i,
    input  wire [         8:0] d1_out_i,
    input  wire [         8:0] d2_out_i,
    input  wire [         8:0] c1_out_i,
    input  wire [         8:0] c2_out_i,
    input  wire [         8:0] c3_out_i,
    input  wire [        12:0] d1_k_i,
    input  wire [        12:0] d2_k_i,
    input  wire [        12:0] c1_k_i,
    input  wire [        12:0] c2_k_i,
    input  wire [        12:0] c3_k_i,
    input  wire [        23:0] d1_theta_i,
    input  wire [        23:0] c1_theta_i,
    input  wire [        23:0] c2_theta_i,
    input  wire [        10:0] c1_bias_i,
    input  wire                c2_bias_i,
    input  wire                c3_bias_i,
    // and of the readout
    input  wire [        15:0] exp_mul_i,
    input  wire [         4:0] exp_shift_i,
    input  wire [        31:0] exp_bias_i,
    input  wire [        15:0] sigmoid_mul_i,
    input  wire [         4:0] sigmoid_shift_i,
    input  wire [        31:0] sigmoid_bias_i,
    // inputs of a sample
    input  wire                sample_valid_i,
    input  wire                sample_first_i,
    output wire                sample_done_o,
    output wire [         4:0] feature_index_o,
    input  wire [        11:0] feature_i,
    output wire [         7:0] dir_index_o,
    input  wire [        11:0] dir_i,
    // its result
    output wire                valid_o,
    input  wire                ready_i,
    output wire [        27:0] sigma_o,
    output wire [        59:0] colour_o,
    // counters
    input  wire                active_i,           // samples are inside the block
    input  wire                clear_counters_i,
    input  wire                snapshot_i,
    output wire                counters_busy_o,
    input  wire [         8:0] counter_index_i,
    output wire [        63:0] counter_o,
    // tap
    output wire                tap_valid_o,
    output wire [         2:0] tap_layer_o,
    output wire [         2:0] tap_step_o,
    output wire [   LANES-1:0] tap_spikes_o,
    output wire [   LANES-1:0] tap_rows_o,
    output wire [24*LANES-1:0] tap_membrane_o
);
  wire hold, core_idle, readout_idle, stall_out;
  wire density_ready, density_valid, colour_ready, colour_valid;
  wire density_begin, density_last, colour_begin, colour_last;
  wire [2:0] density_step, colour_step;
  wire [15:0] density_current;
  wire [47:0] colour_current;
  wire d1_row, c1_row, c1_bias_row, c1_products, ray;
  wire [2:0] c1_step, neurons_step, update_step;
  wire d2_row, c2_row, c2_bias_row, c3_row, c3_bias_row;
  wire [7:0] d2_fired, c2_fired, c3_fired;
  wire [4:0] busy;
  wire neurons_valid, neurons_last;
  wire [1:0] neurons_layer;
  wire [8:0] neurons_fired;
  wire update, update_colour, special;
  wire quiet = core_idle && readout_idle;
  assign idle_o = quiet;

  sf_core #(
      .TAP          (TAP),
      .LANES        (LANES),
      .MACS         (MACS),
      .NEURONS      (NEURONS),
      .STEPS_AT_ONCE(STEPS_AT_ONCE)
  ) u_core (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .hold_i         (hold),
      .idle_o         (core_idle),
      .we_i           (we_i),
      .wlayer_i       (wlayer_i),
      .wrow_i         (wrow_i),
      .wword_i        (wword_i),
      .wdata_i        (wdata_i),
      .d1_in_i        (d1_in_i),
      .decodes_i      (decodes_i),
      .d1_out_i       (d1_out_i),
      .n_dir_i        (n_dir_i),
      .n_h_i          (n_h_i),
      .c1_out_i       (c1_out_i),
      .c2_out_i       (c2_out_i),
      .d1_k_i         (d1_k_i),
      .c1_k_i         (c1_k_i),
      .c2_k_i         (c2_k_i),
      .d1_theta_i     (d1_theta_i),
      .c1_theta_i     (c1_theta_i),
      .c2_theta_i     (c2_theta_i),
      .c1_bias_i      (c1_bias_i),
      .c2_bias_i      (c2_bias_i),
      .c3_bias_i      (c3_bias_i),
      .mode_i         (mode_i),
      .steps_i        (steps_i),
      .sample_valid_i (sample_valid_i),
      .sample_first_i (sample_first_i),
      .sample_done_o  (sample_done_o),
      .feature_index_o(feature_index_o),
      .feature_i      (feature_i),
      .dir_index_o    (dir_index_o),
      .dir_i          (dir_i),
      .density_ready_i(density_ready),
      .density_begin_o(density_begin),
      .density_valid_o(density_valid),
      .density_step_o (density_step),
      .density_last_o (density_last),
      .density_o      (density_current),
      .colour_ready_i (colour_ready),
      .colour_begin_o (colour_begin),
      .colour_valid_o (colour_valid),
      .colour_step_o  (colour_step),
      .colour_last_o  (colour_last),
      .colour_o       (colour_current),
      .d1_row_o       (d1_row),
      .c1_row_o       (c1_row),
      .c1_bias_row_o  (c1_bias_row),
      .c1_products_o  (c1_products),
      .c1_step_o      (c1_step),
      .d2_row_o       (d2_row),
      .d2_fired_o     (d2_fired),
      .c2_row_o       (c2_row),
      .c2_fired_o     (c2_fired),
      .c2_bias_row_o  (c2_bias_row),
      .c3_row_o       (c3_row),
      .c3_fired_o     (c3_fired),
      .c3_bias_row_o  (c3_bias_row),
      .busy_o         (busy),
      .ray_o          (ray),
      .neurons_valid_o(neurons_valid),
      .neurons_layer_o(neurons_layer),
      .neurons_step_o (neurons_step),
      .neurons_last_o (neurons_last),
      .neurons_fired_o(neurons_fired),
      .stall_o        (stall_out),
      .tap_valid_o    (tap_valid_o),
      .tap_layer_o    (tap_layer_o),
      .tap_step_o     (tap_step_o),
      .tap_spikes_o   (tap_spikes_o),
      .tap_rows_o     (tap_rows_o),
      .tap_membrane_o (tap_membrane_o)
  );

  sf_readout u_readout (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .decodes_i      (decodes_i),
      .density_ready_o(density_ready),
      .density_begin_i(density_begin),
      .density_valid_i(density_valid),
      .density_step_i (density_step),
      .density_last_i (density_last),
      .density_i      (density_current),
      .colour_ready_o (colour_ready),
      .colour_begin_i (colour_begin),
      .colour_valid_i (colour_valid),
      .colour_step_i  (colour_step),
      .colour_last_i  (colour_last),
      .colour_i       (colour_current),
      .idle_o         (readout_idle),
      .mode_i         (mode_i),
      .steps_i        (steps_i),
      .k_density_i    (d2_k_i),
      .k_colour_i     (c3_k_i),
      .exp_mul_i      (exp_mul_i),
      .exp_shift_i    (exp_shift_i),
      .exp_bias_i     (exp_bias_i),
      .sigmoid_mul_i  (sigmoid_mul_i),
      .sigmoid_shift_i(sigmoid_shift_i),
      .sigmoid_bias_i (sigmoid_bias_i),
      .update_o       (update),
      .update_colour_o(update_colour),
      .update_step_o  (update_step),
      .special_o      (special),
      .valid_o        (valid_o),
      .ready_i        (ready_i),
      .sigma_o        (sigma_o),
      .colour_o       (colour_o)
  );

  sf_counters u_counters (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .d1_out_i       (d1_out_i),
      .d2_out_i       (d2_out_i),
      .c1_out_i       (c1_out_i),
      .c2_out_i       (c2_out_i),
      .c3_out_i       (c3_out_i),
      .d1_row_i       (d1_row),
      .c1_row_i       (c1_row),
      .c1_bias_row_i  (c1_bias_row),
      .c1_products_i  (c1_products),
      .c1_step_i      (c1_step),
      .d2_row_i       (d2_row),
      .d2_fired_i     (d2_fired),
      .c2_row_i       (c2_row),
      .c2_fired_i     (c2_fired),
      .c2_bias_row_i  (c2_bias_row),
      .c3_row_i       (c3_row),
      .c3_fired_i     (c3_fired),
      .c3_bias_row_i  (c3_bias_row),
      .busy_i         (busy),
      .ray_i          (ray),
      .neurons_valid_i(neurons_valid),
      .neurons_layer_i(neurons_layer),
      .neurons_step_i (neurons_step),
      .neurons_last_i (neurons_last),
      .neurons_fired_i(neurons_fired),
      .update_i       (update),
      .special_i      (special),
      .update_colour_i(update_colour),
      .update_step_i  (update_step),
      .sample_i       (valid_o && ready_i),
      .active_i       (active_i),
      .stall_in_i     (active_i && !sample_valid_i && !hold),
      .stall_out_i    (stall_out),
      .clear_i        (clear_counters_i),
      .snapshot_i     (snapshot_i),
      .quiet_i        (quiet),
      .hold_o         (hold),
      .busy_o         (counters_busy_o),
      .index_i        (counter_index_i),
      .counter_o      (counter_o)
  );
endmodule

`default_nettype wire
