// Neuron unit: leak, compare, soft reset, in five stages; one neuron's step may begin in every cycle. The membrane is
// stored outside: it is read in the first stage and written in the cycle after the last. Mirror: src/fx/plif.c
// (fx_plif_step). No-decay and radix mode alone need the saturation; 0 <= k <= 1.0, theta >= 1, and theta < 2^22 in radix mode
// are enforced by sf_csr. In radix mode the membrane doubles and k scales the current: 0 where there is none.
`default_nettype none

module sf_plif (
    input  wire               clk_i,
    input  wire signed [23:0] v_i,
    input  wire signed [23:0] current_i,
    input  wire        [12:0] k_i,        // in the second stage: one cycle after v_i
    input  wire signed [23:0] theta_i,    // in the fifth, four cycles after v_i
    input  wire               nodecay_i,  // in the first
    input  wire               radix_i,
    input  wire               first_i,
    output reg  signed [23:0] v_o,        // five cycles after v_i
    output reg                spike_o
);
  localparam FRAC = sf_arch_pkg::LEAK_FRAC;

  // 1: what k multiplies, and what the product is added to
  wire signed [24:0] old = first_i ? 25'sd0 : 25'(v_i);
  reg signed [24:0] x1_q, base1_q;
  always_ff @(posedge clk_i) begin
    x1_q <= (nodecay_i ? 25'sd0 : 25'(current_i)) - (radix_i ? 25'sd0 : old);
    base1_q <= old + (radix_i ? old : nodecay_i ? 25'(current_i) : 25'sd0);
  end

  // 2: 25 x 13 bits as two products of the multipliers' size
  reg signed [30:0] low2_q;
  reg signed [21:0] high2_q;
  reg signed [24:0] base2_q;
  wire signed [13:0] k = $signed({1'b0, k_i});
  always_ff @(posedge clk_i) begin
    low2_q <= $signed({1'b0, x1_q[16:0]}) * k;
    high2_q <= $signed(x1_q[24:17]) * k;
    base2_q <= base1_q;
  end

  // 3: x / 2^n, round half up. No-decay mode adds what a negated product gives: -round(p) = floor((-p + half - 1) / 2^n).
  localparam signed [38:0] HALF = 39'sd1 <<< (FRAC - 1);
  reg signed [25:0] leak3_q;
  reg signed [24:0] base3_q;
  reg nodecay1_q, nodecay2_q;
  wire signed [38:0] product = {high2_q, 17'd0} + 39'(low2_q) + (nodecay2_q ? HALF - 39'sd1 : HALF);
  always_ff @(posedge clk_i) begin
    nodecay1_q <= nodecay_i;
    nodecay2_q <= nodecay1_q;
    leak3_q <= 26'(product >>> FRAC);
    base3_q <= base2_q;
  end

  // 4: the new membrane
  reg signed [26:0] v4_q;
  always_ff @(posedge clk_i) v4_q <= 27'(base3_q) + 27'(leak3_q);

  // 5: saturate, compare, reset
  wire signed [23:0] v5 = v4_q[26:23] == {4{v4_q[26]}} ? v4_q[23:0] : {v4_q[26], {23{!v4_q[26]}}};
  wire signed [24:0] above = 25'(v5) - 25'(theta_i);
  always_ff @(posedge clk_i) begin
    spike_o <= !above[24];
    v_o <= above[24] ? v5 : above[23:0];
  end
endmodule

`default_nettype wire
