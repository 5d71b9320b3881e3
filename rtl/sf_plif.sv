// Neuron unit: combinational, storage outside. Mirror: src/fx/plif.c (fx_plif_step)
// The lanes of sf_neurons use the same function; this module is the unit by itself, for synthesis reports and unit
// benches.
`default_nettype none

module sf_plif (
    input  wire signed [23:0] v_i,
    input  wire signed [23:0] current_i,
    input  wire        [12:0] k_i,
    input  wire signed [23:0] theta_i,
    input  wire        [ 1:0] mode_i,
    input  wire               first_i,
    output wire signed [23:0] v_o,
    output wire               spike_o
);
  `include "sf_round.svh"
  `include "sf_plif.svh"

  assign {spike_o, v_o} = sf_plif_step(v_i, current_i, k_i, theta_i, mode_i, first_i);
endmodule

`default_nettype wire
