// The lanes: 128 accumulators and neurons, one row of weights per cycle. Mirror: src/fx/current.c
// D2 and C3 are narrow but run for all steps at once: their 16 outputs x 8 steps share the same accumulators.
// Widths: |sum| <= 32 * 2048 * 127 < 2^23 for the layers fed by values, 128 * 127 < 2^15 for those fed by spikes.
// Datapath registers have no reset: LOAD and step 0 define them before use.
`default_nettype none

module sf_layer #(
    parameter TAP = 1
) (
    input  wire                 clk_i,
    input  wire          [ 2:0] op_i,
    input  wire                 base_i,     // LOAD: start from the direction's current
    input  wire                 spikes_in_i, // FIRE: layer fed by spikes (C2), else by values
    input  wire                 first_i,    // FIRE: step 0
    input  wire          [ 1:0] mode_i,
    input  wire          [12:0] k_i,
    input  wire signed   [23:0] theta_i,
    input  wire signed   [11:0] value_i,    // MAC
    input  wire          [ 7:0] fired_i,    // SPLIT: steps at which the presynaptic neuron fired
    input  wire        [1023:0] row_i,
    input  wire         [127:0] narrow_i,
    output reg          [127:0] spikes_o,   // of the last FIRE, all lanes
    input  wire                 tap_i,      // the cycle after a FIRE
    input  wire                 tap_spikes_in_i,
    output reg         [3071:0] membrane_o, // after reset, 24 bits a lane: for the tap only
    input  wire          [ 6:0] h_lane_i,
    output wire signed   [11:0] h_o,
    input  wire                 take_colour_i,
    input  wire                 current_colour_i,
    input  wire          [ 6:0] current_lane_i,
    output wire signed   [15:0] current_o
);
  `include "sf_round.svh"
  `include "sf_plif.svh"

  reg signed [23:0] acc_q[0:127];
  // Rows of 128 x 24 bits, one access per operation: membranes of the layer fed by values (D1, then C1), membranes of
  // the layer fed by spikes (C2), the direction's current.
  reg [3071:0] state;    // names for a whole row within one operation, not registers
  reg [2047:0] current;
  reg [127:0] fired;
  reg [24:0] neuron;
  localparam [1:0] BASE_ROW = 2'd2;
  reg [3071:0] state_q[0:2];
  reg [2047:0] current_q[0:1];  // of D2, of C3
  wire [1:0] membrane_row = {1'b0, spikes_in_i};

  // h = current >>> H_SHIFT: 16384 >> 3 fits 12 bits; with a smaller H_SHIFT the scene's weights see to it.
  assign h_o = current_q[0][16*h_lane_i+sf_arch_pkg::H_SHIFT+:12];
  assign current_o = current_q[current_colour_i][16*current_lane_i+:16];

  always_ff @(posedge clk_i) begin
    if (op_i == sf_op_pkg::LOAD) begin
      for (int l = 0; l < 128; l++) acc_q[l] = base_i ? state_q[BASE_ROW][24*l+:24] : 24'd0;
    end
    if (op_i == sf_op_pkg::MAC) begin
      for (int l = 0; l < 128; l++) acc_q[l] = acc_q[l] + $signed(row_i[8*l+:8]) * value_i;
    end
    if (op_i == sf_op_pkg::ADD) begin
      for (int l = 0; l < 128; l++) acc_q[l] = acc_q[l] + 24'($signed(row_i[8*l+:8]));
    end
    if (op_i == sf_op_pkg::SPLIT) begin
      for (int t = 0; t < 8; t++) begin
        if (fired_i[t]) begin
          for (int o = 0; o < 16; o++) acc_q[16*t+o] = acc_q[16*t+o] + 24'($signed(narrow_i[8*o+:8]));
        end
      end
    end
    if (op_i == sf_op_pkg::KEEP) begin
      for (int l = 0; l < 128; l++) state[24*l+:24] = acc_q[l];
      state_q[BASE_ROW] <= state;
    end
    if (op_i == sf_op_pkg::TAKE) begin
      for (int l = 0; l < 128; l++) current[16*l+:16] = acc_q[l][15:0];
      current_q[take_colour_i] <= current;
    end
    if (op_i == sf_op_pkg::FIRE) begin
      state = state_q[membrane_row];
      for (int l = 0; l < 128; l++) begin
        neuron = sf_plif_step(state[24*l+:24], spikes_in_i ? acc_q[l] <<< sf_arch_pkg::AC_FRAC : acc_q[l], k_i,
                              theta_i, mode_i, first_i);
        fired[l] = neuron[24];
        state[24*l+:24] = neuron[23:0];
      end
      state_q[membrane_row] <= state;
      spikes_o <= fired;
    end
  end

  if (TAP != 0) begin : g_tap
    always_ff @(posedge clk_i) begin
      if (tap_i) membrane_o <= state_q[{1'b0, tap_spikes_in_i}];
    end
  end else begin : g_no_tap
    assign membrane_o = 3072'd0;
    wire unused_tap_ok = &{1'b0, tap_i, tap_spikes_in_i};
  end
endmodule

`default_nettype wire
