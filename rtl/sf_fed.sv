// A layer fed by spikes: the spikes of the layer before it come in, the layer's sums of a sample wait, complete, until they
// are released. Rows are read by sf_sums, in the order in which sf_spikes hands neurons on. Mirror: src/fx/net.c
`default_nettype none

module sf_fed #(
    parameter LANES = 128,       // neurons of the layer before
    parameter NEURONS = 16,
    parameter GROUP_BITS = 3,    // of the number of a group of NEURONS
    parameter OUTS = 128,        // these as sf_sums'
    parameter ADDERS = 128,
    parameter PART_BITS = 1,
    parameter BANKS = 2,
    parameter TAP = 1
) (
    input  wire                      clk_i,
    input  wire                      rst_ni,
    input  wire                      clear_i,
    input  wire                      has_bias_i,
    input  wire [               3:0] steps_i,
    input  wire [    GROUP_BITS-1:0] last_group_i,   // of the layer before
    input  wire [     PART_BITS-1:0] last_part_i,    // of this layer
    // weights: row BIAS_ROW has the biases
    input  wire                      we_i,
    input  wire [               8:0] wrow_i,
    input  wire [$clog2(OUTS/4)-1:0] wword_i,
    input  wire [              31:0] wdata_i,
    // spikes of the layer before; a place is taken before they come
    input  wire                      take_i,
    output wire                      space_o,
    input  wire                      spikes_valid_i,
    input  wire [               2:0] spikes_step_i,
    input  wire [    GROUP_BITS-1:0] spikes_group_i,
    input  wire [       NEURONS-1:0] spikes_i,
    // sums, until released; they are there three cycles after a load
    output wire                      full_o,
    input  wire                      load_i,
    input  wire [               2:0] load_step_i,
    input  wire [     PART_BITS-1:0] load_part_i,
    input  wire                      release_i,
    output wire [     16*ADDERS-1:0] sums_o,
    // events, in the cycle in which they happen
    output wire                      row_o,          // a row is read,
    output wire [               7:0] fired_o,        // and the steps at which its neuron fired
    output wire                      bias_row_o,
    output wire                      busy_o,
    output wire                      idle_o,
    output wire [         LANES-1:0] tap_rows_o
);
  localparam INDEX_BITS = $clog2(LANES);
  wire item, item_bias, item_last, next, spikes_idle, sums_idle;
  wire [INDEX_BITS-1:0] index;
  wire [7:0] fired;
  wire of_bias = wrow_i == 9'(sf_arch_pkg::BIAS_ROW);

  sf_spikes #(
      .NEURONS   (NEURONS),
      .INDEX_BITS(INDEX_BITS),
      .GROUP_BITS(GROUP_BITS)
  ) u_spikes (
      .clk_i    (clk_i),
      .rst_ni   (rst_ni),
      .clear_i  (clear_i),
      .bias_i   (has_bias_i),
      .steps_i  (steps_i),
      .group_i  (last_group_i),
      .take_i   (take_i),
      .space_o  (space_o),
      .we_i     (spikes_valid_i),
      .wstep_i  (spikes_step_i),
      .wgroup_i (spikes_group_i),
      .wspikes_i(spikes_i),
      .valid_o  (item),
      .bias_o   (item_bias),
      .index_o  (index),
      .fired_o  (fired),
      .last_o   (item_last),
      .next_i   (next),
      .idle_o   (spikes_idle)
  );
  sf_sums #(
      .ROWS     (LANES),
      .ROW_BITS (INDEX_BITS),
      .OUTS     (OUTS),
      .ADDERS   (ADDERS),
      .PART_BITS(PART_BITS),
      .BANKS    (BANKS),
      .TAP      (TAP)
  ) u_sums (
      .clk_i      (clk_i),
      .rst_ni     (rst_ni),
      .clear_i    (clear_i),
      .part_i     (last_part_i),
      .we_i       (we_i && !of_bias),
      .bias_we_i  (we_i && of_bias),
      .wrow_i     (wrow_i[INDEX_BITS-1:0]),
      .wword_i    (wword_i),
      .wdata_i    (wdata_i),
      .valid_i    (item),
      .bias_i     (item_bias),
      .index_i    (index),
      .fired_i    (fired),
      .last_i     (item_last),
      .next_o     (next),
      .full_o     (full_o),
      .load_i     (load_i),
      .load_step_i(load_step_i),
      .load_part_i(load_part_i),
      .release_i  (release_i),
      .sums_o     (sums_o),
      .row_o      (row_o),
      .bias_row_o (bias_row_o),
      .fired_o    (fired_o),
      .busy_o     (busy_o),
      .idle_o     (sums_idle),
      .tap_rows_o (tap_rows_o)
  );
  assign idle_o = spikes_idle && sums_idle;
  wire unused_ok = &{1'b0, wrow_i};
endmodule

`default_nettype wire
