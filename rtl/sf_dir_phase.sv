// Phases of a direction, of which sf_waves takes sines: each axis from Q1.14 radians to turns, Q.16.
// Mirror: src/fx/tensorf.c (fx_vm_encode)
`default_nettype none

module sf_dir_phase (
    input  wire        clk_i,
    input  wire [47:0] dir_i,   // z, y, x
    output reg  [47:0] phase_o  // a cycle later
);
  localparam signed [17:0] TURNS = 18'sd41722;  // 2^16 * 4 / (2 pi)
  wire [47:0] phase;
  genvar a;
  generate
    for (a = 0; a < 3; a = a + 1) begin : g_axis
      wire signed [33:0] turns = $signed(dir_i[16*a+:16]) * TURNS + 34'sd32768;
      assign phase[16*a+:16] = turns[31:16];
      wire unused_ok = &{1'b0, turns[33:32], turns[15:0]};
    end
  endgenerate
  always_ff @(posedge clk_i) phase_o <= phase;
endmodule

`default_nettype wire
