// The neurons: LANES units shared by the spiking layers D1, C1 and C2, one step of one layer per cycle. Membranes are
// rows of a memory, one per layer. Mirror: src/fx/plif.c
`default_nettype none

module sf_neurons #(
    parameter LANES = 128,
    parameter TAP = 1
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    input  wire         [ 1:0] mode_i,
    input  wire         [38:0] k_i,        // of D1, C1, C2
    input  wire         [71:0] theta_i,
    input  wire         [26:0] n_out_i,
    // one of them steps, or none
    input  wire         [ 2:0] fire_i,     // C2, C1, D1
    input  wire         [ 2:0] step_i,
    input  wire [24*LANES-1:0] d1_i,       // currents
    input  wire [24*LANES-1:0] c1_i,
    input  wire [16*LANES-1:0] c2_i,
    // in the next cycle
    output wire         [ 2:0] valid_o,
    output wire         [ 2:0] step_o,
    output wire [   LANES-1:0] spikes_o,
    output wire         [ 8:0] count_o,
    // tap, in the cycle after that: membranes after reset
    output wire [24*LANES-1:0] tap_membrane_o
);
  `include "sf_round.svh"
  `include "sf_plif.svh"

  reg [2:0] valid_q, step_q;
  reg [LANES-1:0] fired_q, lanes_q;
  reg [24*LANES-1:0] state_q[0:2];
  reg [24*LANES-1:0] state;  // names for a whole row within one operation, not registers
  reg [LANES-1:0] fired;
  reg [24:0] neuron;
  wire [1:0] which = fire_i[2] ? 2'd2 : fire_i[1] ? 2'd1 : 2'd0;
  wire [12:0] k = k_i[13*which+:13];
  wire signed [23:0] theta = theta_i[24*which+:24];
  wire [8:0] n_out = n_out_i[9*which+:9];
  wire first = step_i == 3'd0;

  always_ff @(posedge clk_i) begin
    if (fire_i != 3'd0) begin
      state = state_q[which];
      if (fire_i[2]) begin
        for (int l = 0; l < LANES; l++) begin
          neuron = sf_plif_step(state[24*l+:24], 24'($signed(c2_i[16*l+:16])) <<< sf_arch_pkg::AC_FRAC, k, theta, mode_i,
                                first);
          fired[l] = neuron[24];
          state[24*l+:24] = neuron[23:0];
        end
      end else begin
        for (int l = 0; l < LANES; l++) begin
          neuron = sf_plif_step(state[24*l+:24], fire_i[1] ? c1_i[24*l+:24] : d1_i[24*l+:24], k, theta, mode_i, first);
          fired[l] = neuron[24];
          state[24*l+:24] = neuron[23:0];
        end
      end
      state_q[which] <= state;
      fired_q <= fired;
      lanes_q <= ~(~{LANES{1'b0}} << n_out);  // lanes that the layer has
    end
    step_q <= step_i;
  end
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid_q <= 3'd0;
    else valid_q <= clear_i ? 3'd0 : fire_i;
  end

  assign valid_o = valid_q;
  assign step_o = step_q;
  assign spikes_o = fired_q & lanes_q;
  assign count_o = 9'($countones(spikes_o));

  generate
    if (TAP != 0) begin : g_tap
      reg [24*LANES-1:0] membrane_q;
      always_ff @(posedge clk_i) begin
        if (valid_q != 3'd0) membrane_q <= state_q[valid_q[2] ? 2'd2 : valid_q[1] ? 2'd1 : 2'd0];
      end
      assign tap_membrane_o = membrane_q;
    end else begin : g_no_tap
      assign tap_membrane_o = {(24 * LANES) {1'b0}};
    end
  endgenerate
endmodule

`default_nettype wire
