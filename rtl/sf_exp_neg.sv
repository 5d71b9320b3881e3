// exp(-tau) = 2^-(tau log2 e), tau unsigned Q.20, to Q0.20 with 1.0 = 2^20; nine clock cycles after tau_i, one in every cycle.
// Mirror: src/fx/exp2.c (fx_exp_neg)
//
// From tau = 16 on the result rounds to 0. Below, log2 e in Q.23 is 46 * 2^18 + 43579: tau times the lower part takes two
// multipliers, the rest is shifts and sums.
`default_nettype none

module sf_exp_neg (
    input  wire        clk_i,
    input  wire [36:0] tau_i,
    output reg  [20:0] e_o
);
  localparam [15:0] LOG2E_LOW = 16'd43579;

  // 1: partial products
  reg [33:0] low1_q;
  reg [21:0] high1_q;
  reg [25:0] thrice1_q;
  reg [23:0] tau1_q;
  reg [6:0] zero_q;  // bit i: of stage i + 1
  always_ff @(posedge clk_i) begin
    low1_q <= 34'(tau_i[17:0]) * 34'(LOG2E_LOW);
    high1_q <= 22'(tau_i[23:18]) * 22'(LOG2E_LOW);
    thrice1_q <= {2'd0, tau_i[23:0]} + {1'b0, tau_i[23:0], 1'b0};
    tau1_q <= tau_i[23:0];
    zero_q <= {zero_q[5:0], |tau_i[36:24]};
  end

  // 2, 3: y = -round(tau log2 e), Q.20. The sum is in 2^-25; -floor(s) = ~floor(s - 1) takes one from it.
  reg signed [23:0] part2_q;
  reg [29:0] times46_2_q;
  wire signed [29:0] below = 30'(part2_q) + $signed(times46_2_q);
  reg [24:0] y3_q;  // modulo 2^25
  always_ff @(posedge clk_i) begin
    part2_q <= $signed({2'd0, high1_q}) + $signed({8'd0, low1_q[33:18]}) - 24'sd16;
    times46_2_q <= {thrice1_q, 4'd0} - {5'd0, tau1_q, 1'b0};
    y3_q <= ~below[29:5];
  end

  // 4: the ends of the piece of the table
  wire [25:0] low_end;
  wire [25:0] high_end;
  sf_rom_exp2 u_rom (
      .index_i(y3_q[19:12]),
      .low_o  (low_end),
      .high_o (high_end)
  );
  reg [25:0] low4_q, high4_q;
  reg [11:0] place4_q, place5_q;
  reg [4:0] down4_q, down5_q, down6_q, down7_q;  // -floor(y)
  always_ff @(posedge clk_i) begin
    low4_q <= low_end;
    high4_q <= high_end;
    place4_q <= y3_q[11:0];
    down4_q <= 5'd0 - y3_q[24:20];
  end

  // 5, 6, 7: the place in it; the rise is below 2^17
  reg [16:0] rise5_q;
  reg [25:0] low5_q, low6_q;
  reg [22:0] t7_q;
  reg [28:0] step6_q;
  wire [16:0] rise = high4_q[16:0] - low4_q[16:0];
  wire [28:0] step = 29'(rise5_q) * 29'(place5_q);
  wire [37:0] t = {low6_q, 12'd2048} + {9'd0, step6_q};
  always_ff @(posedge clk_i) begin
    rise5_q <= rise;
    low5_q <= low4_q;
    place5_q <= place4_q;
    down5_q <= down4_q;
    step6_q <= step;
    low6_q <= low5_q;
    down6_q <= down5_q;
    t7_q <= t[37:15];
    down7_q <= down6_q;
  end

  // 8, 9: to Q0.20, round half up
  reg [22:0] twice8_q;
  reg zero8_q;
  wire [22:0] rounded = twice8_q + 23'd1;
  always_ff @(posedge clk_i) begin
    twice8_q <= t7_q >> down7_q;
    zero8_q <= zero_q[6];
    e_o <= zero8_q ? 21'd0 : rounded[21:1];
  end
  wire unused_ok = &{1'b0, below[4:0], low1_q[17:0], high4_q[25:17], t[14:0], rounded[22], rounded[0]};
endmodule

`default_nettype wire
