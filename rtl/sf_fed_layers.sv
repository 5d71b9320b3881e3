// D2, C2 and C3, the layers fed by spikes, and the tap that shows what they add up. D2 and C3 send their sums out; those of
// C2 are currents of its neurons. Mirror: src/fx/net.c
`default_nettype none

module sf_fed_layers #(
    parameter TAP = 1,
    parameter LANES = 128,
    parameter MACS = 128,
    parameter PART_BITS = 1,
    parameter NEURONS = 16,
    parameter GROUP_BITS = 3,
    parameter STEPS_AT_ONCE = 2
) (
    input  wire                       clk_i,
    input  wire                       rst_ni,
    input  wire                       clear_i,
    input  wire                       c2_bias_i,
    input  wire                       c3_bias_i,
    input  wire [                3:0] steps_i,
    input  wire [     GROUP_BITS-1:0] d1_group_i,        // the last group of a layer
    input  wire [     GROUP_BITS-1:0] c1_group_i,
    input  wire [     GROUP_BITS-1:0] c2_group_i,
    input  wire [      PART_BITS-1:0] c2_part_i,         // the last part
    // weights
    input  wire                       we_i,
    input  wire [                2:0] wlayer_i,
    input  wire [                8:0] wrow_i,
    input  wire [$clog2(LANES/4)-1:0] wword_i,
    input  wire [               31:0] wdata_i,
    // spikes; a bit for those of D1, C1 and C2, from bit 0 on
    input  wire [                2:0] take_i,
    output wire [                2:0] space_o,
    input  wire                       spikes_valid_i,
    input  wire [                1:0] spikes_layer_i,
    input  wire [                2:0] spikes_step_i,
    input  wire [     GROUP_BITS-1:0] spikes_group_i,
    input  wire                       spikes_last_i,     // the layer's last group
    input  wire [        NEURONS-1:0] spikes_i,
    input  wire [     24*NEURONS-1:0] membrane_i,
    // sums of D2
    input  wire                       d2_ready_i,
    input  wire                       d2_room_i,
    output wire                       d2_begin_o,
    output wire                       d2_valid_o,
    output wire [                2:0] d2_step_o,
    output wire                       d2_last_o,
    output wire [              255:0] d2_sums_o,
    // sums of C2, there three cycles after a load
    output wire                       c2_full_o,
    input  wire                       c2_load_i,
    input  wire [                2:0] c2_load_step_i,
    input  wire [      PART_BITS-1:0] c2_load_part_i,
    input  wire                       c2_release_i,
    output wire [        16*MACS-1:0] c2_sums_o,
    // sums of C3
    input  wire                       c3_ready_i,
    output wire                       c3_begin_o,
    output wire                       c3_valid_o,
    output wire [                2:0] c3_step_o,
    output wire                       c3_last_o,
    output wire [               47:0] c3_sums_o,
    // events, in the cycle in which they happen
    output wire                       d2_row_o,
    output wire [                7:0] d2_fired_o,
    output wire                       c2_row_o,
    output wire [                7:0] c2_fired_o,
    output wire                       c2_bias_row_o,
    output wire                       c3_row_o,
    output wire [                7:0] c3_fired_o,
    output wire                       c3_bias_row_o,
    output wire [                2:0] busy_o,            // D2, C2, C3 from bit 0 on
    output wire                       stall_o,           // D2 or C3 waits for the readout
    output wire                       idle_o,
    // tap
    output wire                       tap_valid_o,
    output wire [                2:0] tap_layer_o,
    output wire [                2:0] tap_step_o,
    output wire [          LANES-1:0] tap_spikes_o,
    output wire [          LANES-1:0] tap_rows_o,
    output wire [       24*LANES-1:0] tap_membrane_o
);
  wire d2_stall, c3_stall, d2_idle, c2_idle, c3_idle, unused_d2_bias_row;
  wire d2_rows_valid, c3_rows_valid;
  wire [LANES-1:0] d2_rows, c2_rows, c3_rows;
  wire [255:0] c3_sums;

  sf_narrow #(
      .LANES     (LANES),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS),
      .TAP       (TAP)
  ) u_d2 (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .has_bias_i    (1'b0),
      .steps_i       (steps_i),
      .last_group_i  (d1_group_i),
      .we_i          (we_i && wlayer_i == sf_op_pkg::D2),
      .wrow_i        (wrow_i),
      .wword_i       (wword_i[1:0]),
      .wdata_i       (wdata_i),
      .take_i        (take_i[sf_op_pkg::SPIKING_D1]),
      .space_o       (space_o[sf_op_pkg::SPIKING_D1]),
      .spikes_valid_i(spikes_valid_i && spikes_layer_i == sf_op_pkg::SPIKING_D1),
      .spikes_step_i (spikes_step_i),
      .spikes_group_i(spikes_group_i),
      .spikes_i      (spikes_i),
      .ready_i       (d2_ready_i),
      .room_i        (d2_room_i),
      .begin_o       (d2_begin_o),
      .valid_o       (d2_valid_o),
      .step_o        (d2_step_o),
      .last_o        (d2_last_o),
      .sums_o        (d2_sums_o),
      .stall_o       (d2_stall),
      .row_o         (d2_row_o),
      .fired_o       (d2_fired_o),
      .bias_row_o    (unused_d2_bias_row),
      .busy_o        (busy_o[0]),
      .idle_o        (d2_idle),
      .tap_valid_o   (d2_rows_valid),
      .tap_rows_o    (d2_rows)
  );

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
      .last_group_i  (c1_group_i),
      .last_part_i   (c2_part_i),
      .we_i          (we_i && wlayer_i == sf_op_pkg::C2),
      .wrow_i        (wrow_i),
      .wword_i       (wword_i),
      .wdata_i       (wdata_i),
      .take_i        (take_i[sf_op_pkg::SPIKING_C1]),
      .space_o       (space_o[sf_op_pkg::SPIKING_C1]),
      .spikes_valid_i(spikes_valid_i && spikes_layer_i == sf_op_pkg::SPIKING_C1),
      .spikes_step_i (spikes_step_i),
      .spikes_group_i(spikes_group_i),
      .spikes_i      (spikes_i),
      .full_o        (c2_full_o),
      .load_i        (c2_load_i),
      .load_step_i   (c2_load_step_i),
      .load_part_i   (c2_load_part_i),
      .release_i     (c2_release_i),
      .sums_o        (c2_sums_o),
      .row_o         (c2_row_o),
      .fired_o       (c2_fired_o),
      .bias_row_o    (c2_bias_row_o),
      .busy_o        (busy_o[1]),
      .idle_o        (c2_idle),
      .tap_rows_o    (c2_rows)
  );

  sf_narrow #(
      .LANES     (LANES),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS),
      .TAP       (TAP)
  ) u_c3 (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .has_bias_i    (c3_bias_i),
      .steps_i       (steps_i),
      .last_group_i  (c2_group_i),
      .we_i          (we_i && wlayer_i == sf_op_pkg::C3),
      .wrow_i        (wrow_i),
      .wword_i       (wword_i[1:0]),
      .wdata_i       (wdata_i),
      .take_i        (take_i[sf_op_pkg::SPIKING_C2]),
      .space_o       (space_o[sf_op_pkg::SPIKING_C2]),
      .spikes_valid_i(spikes_valid_i && spikes_layer_i == sf_op_pkg::SPIKING_C2),
      .spikes_step_i (spikes_step_i),
      .spikes_group_i(spikes_group_i),
      .spikes_i      (spikes_i),
      .ready_i       (c3_ready_i),
      .room_i        (1'b1),
      .begin_o       (c3_begin_o),
      .valid_o       (c3_valid_o),
      .step_o        (c3_step_o),
      .last_o        (c3_last_o),
      .sums_o        (c3_sums),
      .stall_o       (c3_stall),
      .row_o         (c3_row_o),
      .fired_o       (c3_fired_o),
      .bias_row_o    (c3_bias_row_o),
      .busy_o        (busy_o[2]),
      .idle_o        (c3_idle),
      .tap_valid_o   (c3_rows_valid),
      .tap_rows_o    (c3_rows)
  );
  assign c3_sums_o = c3_sums[47:0];
  assign stall_o = d2_stall || c3_stall;
  assign idle_o = d2_idle && c2_idle && c3_idle;
  wire unused_ok = &{1'b0, c3_sums, unused_d2_bias_row};

  generate
    if (TAP != 0) begin : g_tap
      sf_tap #(
          .LANES     (LANES),
          .NEURONS   (NEURONS),
          .GROUP_BITS(GROUP_BITS)
      ) u_tap (
          .clk_i         (clk_i),
          .rst_ni        (rst_ni),
          .clear_i       (clear_i),
          .spikes_valid_i(spikes_valid_i),
          .spikes_layer_i(spikes_layer_i),
          .spikes_step_i (spikes_step_i),
          .spikes_group_i(spikes_group_i),
          .spikes_last_i (spikes_last_i),
          .spikes_i      (spikes_i),
          .membrane_i    (membrane_i),
          .c2_load_i     (c2_load_i && c2_load_part_i == {PART_BITS{1'b0}}),
          .c2_rows_i     (c2_rows),
          .d2_valid_i    (d2_rows_valid),
          .d2_rows_i     (d2_rows),
          .c3_valid_i    (c3_rows_valid),
          .c3_rows_i     (c3_rows),
          .valid_o       (tap_valid_o),
          .layer_o       (tap_layer_o),
          .step_o        (tap_step_o),
          .spikes_o      (tap_spikes_o),
          .rows_o        (tap_rows_o),
          .membrane_o    (tap_membrane_o)
      );
    end else begin : g_no_tap
      assign {tap_valid_o, tap_layer_o, tap_step_o} = 7'd0;
      assign tap_spikes_o = {LANES{1'b0}};
      assign tap_rows_o = {LANES{1'b0}};
      assign tap_membrane_o = {(24 * LANES) {1'b0}};
      wire unused_tap_ok = &{1'b0, spikes_last_i, membrane_i, d2_rows_valid, c3_rows_valid, d2_rows, c2_rows, c3_rows};
    end
  endgenerate
endmodule

`default_nettype wire
