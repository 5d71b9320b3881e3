// The accelerator: AXI4-Lite registers, AXI4-Stream samples in and results out, one clock, one interrupt.
// Tap ports are for observation only; TAP = 0 ties them off, and with the macro SF_NO_TAP they are not there. A tap beat shows,
// for a spiking layer and step, its spikes, the presynaptic rows it added up and its membranes after reset; for D2 and C3
// (step 0) the rows alone.
`default_nettype none
`include "sf_refuse.svh"

module sf_top #(
`ifdef SF_NO_TAP
    parameter TAP = 0,
`else
    parameter TAP = 1,
`endif
    parameter LANES = sf_arch_pkg::LANES,  // neurons of the widest layer: 32, 64, 128 or 256, at most the package's; CONFIG says it
    // How much hardware; ENGINE says it. Results and counts of events do not depend on it.
    parameter MACS = LANES < sf_arch_pkg::MACS ? LANES : sf_arch_pkg::MACS,  // multipliers: LANES, or a half, a quarter of them
    parameter NEURONS = sf_arch_pkg::NEURONS,                                // neuron units: a power of two, 4 to MACS
    parameter STEPS_AT_ONCE = sf_arch_pkg::STEPS_AT_ONCE                     // steps that C2 sums up side by side: 1, 2, 4 or 8
) (
    input  wire          clk_i,
    input  wire          rst_ni,
    // AXI4-Lite, 8 KiB
    input  wire          s_axil_awvalid_i,
    output wire          s_axil_awready_o,
    input  wire [  12:0] s_axil_awaddr_i,
    input  wire          s_axil_wvalid_i,
    output wire          s_axil_wready_o,
    input  wire [  31:0] s_axil_wdata_i,
    input  wire [   3:0] s_axil_wstrb_i,
    output wire          s_axil_bvalid_o,
    input  wire          s_axil_bready_i,
    output wire [   1:0] s_axil_bresp_o,
    input  wire          s_axil_arvalid_i,
    output wire          s_axil_arready_o,
    input  wire [  12:0] s_axil_araddr_i,
    output wire          s_axil_rvalid_o,
    input  wire          s_axil_rready_i,
    output wire [  31:0] s_axil_rdata_o,
    output wire [   1:0] s_axil_rresp_o,
    // samples
    input  wire          s_axis_tvalid_i,
    output wire          s_axis_tready_o,
    input  wire [  63:0] s_axis_tdata_i,
    input  wire          s_axis_tuser_i,
    input  wire          s_axis_tlast_i,
    // results
    output wire          m_axis_tvalid_o,
    input  wire          m_axis_tready_i,
    output wire [  63:0] m_axis_tdata_o,
    output wire          m_axis_tlast_o,
    output wire          irq_o
`ifndef SF_NO_TAP
    // tap
    ,
    output wire          tap_valid_o,
    output wire [   2:0] tap_layer_o,
    output wire [   2:0] tap_step_o,
    output wire [   sf_arch_pkg::LANES-1:0] tap_spikes_o,
    output wire [   sf_arch_pkg::LANES-1:0] tap_rows_o,
    output wire [24*sf_arch_pkg::LANES-1:0] tap_membrane_o
`endif
);
  wire [1:0] mode;
  wire [3:0] steps;
  wire [15:0] exp_mul, sigmoid_mul;
  wire [4:0] exp_shift, sigmoid_shift;
  wire [31:0] exp_bias, sigmoid_bias;
  wire [8:0] d1_in, c1_in, d1_out, d2_out, c1_out, c2_out, c3_out;
  wire [12:0] d1_k, d2_k, c1_k, c2_k, c3_k;
  wire [23:0] d1_theta, c1_theta, c2_theta;
  wire [10:0] c1_bias;
  wire c2_bias, c3_bias;
  wire we;
  wire [2:0] wlayer;
  wire [8:0] wrow;
  wire [5:0] wword;
  wire [31:0] wweights;
  wire running, soft_reset, clear_counters, snapshot, counters_busy, error_packet, error_value;
  wire [8:0] counter_index;
  wire [63:0] counter;

  wire sample_valid, sample_first, sample_done, input_empty;
  wire [4:0] feature_index;
  wire [7:0] dir_index;
  wire [11:0] feature, dir;
  wire engine_idle;
  wire result_valid, result_ready;
  wire [27:0] sigma;
  wire [59:0] colour;
  wire active = !(engine_idle && input_empty && !m_axis_tvalid_o);

  // What follows from the programming, in registers: it does not change while samples are inside.
  reg decodes_q;
  reg [7:0] n_dir_q;  // constant inputs of C1
  reg [4:0] n_h_q;
  wire [8:0] h = d1_out == 9'd0 ? 9'd0 : d2_out - 9'd1;
  wire [8:0] directions = c1_in - h;
  always_ff @(posedge clk_i) begin
    decodes_q <= d1_out == 9'd0;
    n_dir_q <= directions[7:0];
    n_h_q <= h[4:0];
  end
  wire unused_ok = &{1'b0, d1_in[8:6], directions[8], h[8:5]};

  wire [LANES-1:0] tap_spikes, tap_rows;
  wire [24*LANES-1:0] tap_membrane;
  wire tap_valid;
  wire [2:0] tap_layer, tap_step;
`ifdef SF_NO_TAP
  wire unused_tap_ok = &{1'b0, tap_valid, tap_layer, tap_step, tap_spikes, tap_rows, tap_membrane};
`else
  localparam TAPS = sf_arch_pkg::LANES;  // the tap's ports are as wide as the widest block's
  assign {tap_valid_o, tap_layer_o, tap_step_o} = {tap_valid, tap_layer, tap_step};
  assign tap_spikes_o = TAPS'(tap_spikes);
  assign tap_rows_o = TAPS'(tap_rows);
  assign tap_membrane_o = (24 * TAPS)'(tap_membrane);
`endif

  sf_csr #(
      .LANES        (LANES),
      .MACS         (MACS),
      .NEURONS      (NEURONS),
      .STEPS_AT_ONCE(STEPS_AT_ONCE)
  ) u_csr (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .awvalid_i      (s_axil_awvalid_i),
      .awready_o      (s_axil_awready_o),
      .awaddr_i       (s_axil_awaddr_i),
      .wvalid_i       (s_axil_wvalid_i),
      .wready_o       (s_axil_wready_o),
      .wdata_i        (s_axil_wdata_i),
      .wstrb_i        (s_axil_wstrb_i),
      .bvalid_o       (s_axil_bvalid_o),
      .bready_i       (s_axil_bready_i),
      .bresp_o        (s_axil_bresp_o),
      .arvalid_i      (s_axil_arvalid_i),
      .arready_o      (s_axil_arready_o),
      .araddr_i       (s_axil_araddr_i),
      .rvalid_o       (s_axil_rvalid_o),
      .rready_i       (s_axil_rready_i),
      .rdata_o        (s_axil_rdata_o),
      .rresp_o        (s_axil_rresp_o),
      .irq_o          (irq_o),
      .mode_o         (mode),
      .steps_o        (steps),
      .exp_mul_o      (exp_mul),
      .exp_shift_o    (exp_shift),
      .exp_bias_o     (exp_bias),
      .sigmoid_mul_o  (sigmoid_mul),
      .sigmoid_shift_o(sigmoid_shift),
      .sigmoid_bias_o (sigmoid_bias),
      .d1_in_o        (d1_in),
      .c1_in_o        (c1_in),
      .d1_out_o       (d1_out),
      .d2_out_o       (d2_out),
      .c1_out_o       (c1_out),
      .c2_out_o       (c2_out),
      .c3_out_o       (c3_out),
      .d1_k_o         (d1_k),
      .d2_k_o         (d2_k),
      .c1_k_o         (c1_k),
      .c2_k_o         (c2_k),
      .c3_k_o         (c3_k),
      .d1_theta_o     (d1_theta),
      .c1_theta_o     (c1_theta),
      .c2_theta_o     (c2_theta),
      .c1_bias_o      (c1_bias),
      .c2_bias_o      (c2_bias),
      .c3_bias_o      (c3_bias),
      .we_o           (we),
      .wlayer_o       (wlayer),
      .wrow_o         (wrow),
      .wword_o        (wword),
      .wweights_o     (wweights),
      .running_o      (running),
      .soft_reset_o   (soft_reset),
      .clear_o        (clear_counters),
      .snapshot_o     (snapshot),
      .active_i       (active),
      .counters_busy_i(counters_busy),
      .error_packet_i (error_packet),
      .error_value_i  (error_value),
      .counter_index_o(counter_index),
      .counter_i      (counter)
  );

  sf_stream_in u_stream_in (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (soft_reset),
      .enable_i       (running),
      .n_feature_i    (d1_in[5:0]),
      .n_dir_i        (n_dir_q),
      .tvalid_i       (s_axis_tvalid_i),
      .tready_o       (s_axis_tready_o),
      .tdata_i        (s_axis_tdata_i),
      .tuser_i        (s_axis_tuser_i),
      .tlast_i        (s_axis_tlast_i),
      .valid_o        (sample_valid),
      .first_o        (sample_first),
      .done_i         (sample_done),
      .feature_index_i(feature_index),
      .feature_o      (feature),
      .dir_index_i    (dir_index),
      .dir_o          (dir),
      .empty_o        (input_empty),
      .error_packet_o (error_packet),
      .error_value_o  (error_value)
  );

  sf_engine #(
      .TAP          (TAP),
      .LANES        (LANES),
      .MACS         (MACS),
      .NEURONS      (NEURONS),
      .STEPS_AT_ONCE(STEPS_AT_ONCE)
  ) u_engine (
      .clk_i           (clk_i),
      .rst_ni          (rst_ni),
      .clear_i         (soft_reset),
      .idle_o          (engine_idle),
      .we_i            (we),
      .wlayer_i        (wlayer),
      .wrow_i          (wrow),
      .wword_i         (wword),
      .wdata_i         (wweights),
      .mode_i          (mode),
      .steps_i         (steps),
      .decodes_i       (decodes_q),
      .d1_in_i         (d1_in[5:0]),
      .n_dir_i         (n_dir_q),
      .n_h_i           (n_h_q),
      .d1_out_i        (d1_out),
      .d2_out_i        (d2_out),
      .c1_out_i        (c1_out),
      .c2_out_i        (c2_out),
      .c3_out_i        (c3_out),
      .d1_k_i          (d1_k),
      .d2_k_i          (d2_k),
      .c1_k_i          (c1_k),
      .c2_k_i          (c2_k),
      .c3_k_i          (c3_k),
      .d1_theta_i      (d1_theta),
      .c1_theta_i      (c1_theta),
      .c2_theta_i      (c2_theta),
      .c1_bias_i       (c1_bias),
      .c2_bias_i       (c2_bias),
      .c3_bias_i       (c3_bias),
      .exp_mul_i       (exp_mul),
      .exp_shift_i     (exp_shift),
      .exp_bias_i      (exp_bias),
      .sigmoid_mul_i   (sigmoid_mul),
      .sigmoid_shift_i (sigmoid_shift),
      .sigmoid_bias_i  (sigmoid_bias),
      .sample_valid_i  (sample_valid),
      .sample_first_i  (sample_first),
      .sample_done_o   (sample_done),
      .feature_index_o (feature_index),
      .feature_i       (feature),
      .dir_index_o     (dir_index),
      .dir_i           (dir),
      .valid_o         (result_valid),
      .ready_i         (result_ready),
      .sigma_o         (sigma),
      .colour_o        (colour),
      .active_i        (active),
      .clear_counters_i(clear_counters),
      .snapshot_i      (snapshot),
      .counters_busy_o (counters_busy),
      .counter_index_i (counter_index),
      .counter_o       (counter),
      .tap_valid_o     (tap_valid),
      .tap_layer_o     (tap_layer),
      .tap_step_o      (tap_step),
      .tap_spikes_o    (tap_spikes),
      .tap_rows_o      (tap_rows),
      .tap_membrane_o  (tap_membrane)
  );

  sf_stream_out u_stream_out (
      .clk_i   (clk_i),
      .rst_ni  (rst_ni),
      .clear_i (soft_reset),
      .valid_i (result_valid),
      .ready_o (result_ready),
      .sigma_i (sigma),
      .colour_i(colour),
      .tvalid_o(m_axis_tvalid_o),
      .tready_i(m_axis_tready_i),
      .tdata_o (m_axis_tdata_o),
      .tlast_o (m_axis_tlast_o)
  );

  `SF_REFUSE((LANES != 32 && LANES != 64 && LANES != 128 && LANES != 256) || LANES > sf_arch_pkg::LANES,
             "LANES is not 32, 64, 128 or 256, or it is more than the package's")
  `SF_REFUSE(MACS != LANES && 2 * MACS != LANES && 4 * MACS != LANES, "MACS is not LANES, a half or a quarter of it")
  `SF_REFUSE(NEURONS < 4 || NEURONS > MACS || NEURONS > 64 || (NEURONS & (NEURONS - 1)) != 0,
             "NEURONS is not a power of two from 4 to 64, or it is more than MACS")
  `SF_REFUSE(STEPS_AT_ONCE != 1 && STEPS_AT_ONCE != 2 && STEPS_AT_ONCE != 4 && STEPS_AT_ONCE != 8,
             "STEPS_AT_ONCE is not 1, 2, 4 or 8")
  // The modules are written for these sizes; another change in arch.def must not go unnoticed.
  `SF_REFUSE((sf_arch_pkg::LANES != 128 && sf_arch_pkg::LANES != 256) || sf_arch_pkg::T_MAX != 8 || sf_arch_pkg::OUT_MAX != 16
             || sf_arch_pkg::FEATURE_MAX != 32 || sf_arch_pkg::DIR_MAX != 160 || sf_arch_pkg::BIAS_ROW != 256 || sf_arch_pkg::LAYERS != 5
             || sf_arch_pkg::WEIGHT_BITS != 8 || sf_arch_pkg::INPUT_BITS != 12
             || sf_arch_pkg::H_SHIFT < 0 || sf_arch_pkg::H_SHIFT > 4 || sf_arch_pkg::MEMBRANE_BITS != 24
             || sf_arch_pkg::AC_FRAC < 0 || sf_arch_pkg::AC_FRAC > 8 || sf_arch_pkg::LEAK_FRAC < 8 || sf_arch_pkg::LEAK_FRAC > 12
             || sf_arch_pkg::LOG_FRAC != 12 || sf_arch_pkg::SIGMA_BITS != 28 || sf_arch_pkg::SIGMA_FRAC != 12
             || sf_arch_pkg::COLOUR_BITS != 20 || sf_arch_pkg::COLOUR_FRAC != 16 || sf_arch_pkg::COUNTER_BITS != 64,
             "arch.def has other sizes than this RTL is written for")
endmodule

`default_nettype wire
