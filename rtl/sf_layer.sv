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
    input  wire          [ 6:0] current_lane_i,
    output wire signed   [15:0] current_o
);
  `include "sf_round.svh"
  `include "sf_plif.svh"

  reg signed [23:0] acc_q[0:127];
  reg signed [23:0] base_q[0:127];
  reg signed [23:0] v_value_q[0:127];  // membranes of D1, then C1
  reg signed [23:0] v_spike_q[0:127];  // membranes of C2
  reg signed [15:0] current_q[0:127];

  // h = current >>> H_SHIFT: 16384 >> 3 fits 12 bits. AC_FRAC = 8 and H_SHIFT = 3 are wired here.
  wire signed [15:0] h_current = current_q[h_lane_i];
  assign h_o = h_current[14:3];
  assign current_o = current_q[current_lane_i];
  wire unused_ok = &{1'b0, h_current[15], h_current[2:0]};

  always_ff @(posedge clk_i) begin
    if (op_i == sf_op_pkg::LOAD) begin
      for (int l = 0; l < 128; l++) acc_q[l] <= base_i ? base_q[l] : 24'sd0;
    end
    if (op_i == sf_op_pkg::MAC) begin
      for (int l = 0; l < 128; l++) acc_q[l] <= acc_q[l] + $signed(row_i[8*l+:8]) * value_i;
    end
    if (op_i == sf_op_pkg::ADD) begin
      for (int l = 0; l < 128; l++) acc_q[l] <= acc_q[l] + 24'($signed(row_i[8*l+:8]));
    end
    if (op_i == sf_op_pkg::SPLIT) begin
      for (int t = 0; t < 8; t++) begin
        if (fired_i[t]) begin
          for (int o = 0; o < 16; o++)
            acc_q[16*t+o] <= acc_q[16*t+o] + 24'($signed(narrow_i[8*o+:8]));
        end
      end
    end
    if (op_i == sf_op_pkg::KEEP) begin
      for (int l = 0; l < 128; l++) base_q[l] <= acc_q[l];
    end
    if (op_i == sf_op_pkg::TAKE) begin
      for (int l = 0; l < 128; l++) current_q[l] <= acc_q[l][15:0];
    end
  end

  reg [24:0] fire;  // one lane's result; a name, not a register
  always_ff @(posedge clk_i) begin
    if (op_i == sf_op_pkg::FIRE && !spikes_in_i) begin
      for (int l = 0; l < 128; l++) begin
        fire = sf_plif_step(v_value_q[l], acc_q[l], k_i, theta_i, mode_i, first_i);
        v_value_q[l] <= fire[23:0];
        spikes_o[l] <= fire[24];
      end
    end
    if (op_i == sf_op_pkg::FIRE && spikes_in_i) begin
      for (int l = 0; l < 128; l++) begin
        fire = sf_plif_step(v_spike_q[l], {acc_q[l][15:0], 8'd0}, k_i, theta_i, mode_i, first_i);
        v_spike_q[l] <= fire[23:0];
        spikes_o[l] <= fire[24];
      end
    end
  end

  if (TAP != 0) begin : g_tap
    always_ff @(posedge clk_i) begin
      if (tap_i) begin
        for (int l = 0; l < 128; l++) membrane_o[24*l+:24] <= tap_spikes_in_i ? v_spike_q[l] : v_value_q[l];
      end
    end
  end else begin : g_no_tap
    assign membrane_o = 3072'd0;
    wire unused_tap_ok = &{1'b0, tap_i, tap_spikes_in_i};
  end
endmodule

`default_nettype wire
