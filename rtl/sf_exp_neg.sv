// exp(-tau) = 2^-(tau log2 e), tau unsigned Q.20, to Q0.20 with 1.0 = 2^20; two clock cycles after tau_i.
// Mirror: src/fx/exp2.c (fx_exp_neg)
`default_nettype none

module sf_exp_neg (
    input  wire        clk_i,
    input  wire [36:0] tau_i,
    output reg  [20:0] e_o
);
  `include "sf_round.svh"

  localparam [24:0] LOG2E_Q24 = 25'd24204406;
  localparam [25:0] TAU_MAX = 26'd32 << 20;

  wire [25:0] clamped = tau_i > {11'd0, TAU_MAX} ? TAU_MAX : tau_i[25:0];
  wire [50:0] product = 51'(clamped) * 51'(LOG2E_Q24);
  wire [63:0] magnitude = sf_rshift_round_wide({13'd0, product}, 6'd24);
  reg signed [26:0] y_q;  // Q.20, 0 .. -46.2
  always_ff @(posedge clk_i) y_q <= -$signed(magnitude[26:0]);

  wire signed [6:0] n = y_q[26:20];
  wire [25:0] low_end;
  wire [25:0] high_end;
  sf_rom_exp2 u_rom (
      .index_i(y_q[19:12]),
      .low_o  (low_end),
      .high_o (high_end)
  );

  // rise < 2^17, so the product is below 2^29; 2^24 <= t < 2^25.
  wire [25:0] rise = high_end - low_end;
  wire [29:0] step = 30'(rise) * 30'(y_q[11:0]) + 30'd2048;
  wire [25:0] t = low_end + 26'(step[29:12]);
  // A shift of 26 or more gives 0, as every longer one does.
  wire [6:0] shift = 7'(7'sd4 - n);
  wire [47:0] rounded = sf_rshift_round({22'd0, t}, shift > 7'd31 ? 5'd31 : shift[4:0]);
  always_ff @(posedge clk_i) e_o <= rounded[20:0];
  wire unused_ok = &{1'b0, magnitude[63:27], step[11:0], rounded[47:21]};
endmodule

`default_nettype wire
