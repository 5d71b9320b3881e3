// The neuron unit equals its specification (the equations of src/fx/plif.c), written here in 64 bits and case by case, for
// the inputs of five cycles ago, whatever came before and after; in decay and hybrid mode the membrane before the reset
// lies between the old one and the current, ends included. In radix mode it is 2 v and the current's share: k of it, rounded.
// Both multipliers are cut: what mul_bounds and mul_split allow.
`default_nettype none

module plif_spec #(
    parameter [1:0] MODE = 2'd0,
    parameter [0:0] FIRST = 1'b0
) (
    input wire               clk_i,
    input wire signed [23:0] v_i,
    input wire signed [23:0] current_i,
    input wire        [12:0] k_i,
    input wire signed [23:0] theta_i
);
  localparam integer FRAC = sf_arch_pkg::LEAK_FRAC;
  localparam signed [63:0] MAX = 64'sd8388607;
  localparam signed [63:0] HALF = 64'sd1 << (FRAC - 1);
  localparam NODECAY = MODE == sf_op_pkg::NODECAY;
  localparam RADIX = MODE == sf_op_pkg::RADIX;
  localparam LEAPS = MODE == sf_op_pkg::HYBRID && FIRST;  // sf_neurons gives 1.0 for k

  wire signed [23:0] v;
  wire spike;
  sf_plif u_dut (
      .*,
      .nodecay_i(NODECAY),
      .radix_i  (RADIX),
      .first_i  (FIRST),
      .v_o      (v),
      .spike_o  (spike)
  );
  wire signed [24:0] peek_x1_q;

  // What came in n cycles ago; the products are of the cycle after v_i.
  reg [2:0] age_q = 3'd0;
  reg signed [23:0] v1_q, v2_q, v3_q, v4_q, v5_q;
  reg signed [23:0] current1_q, current2_q, current3_q, current4_q, current5_q;
  reg signed [23:0] theta5_q;
  reg signed [63:0] product2_q, product3_q, product4_q, product5_q;
  wire signed [13:0] k = $signed({1'b0, k_i});
  wire signed [30:0] low = $signed({1'b0, peek_x1_q[16:0]}) * k;
  wire signed [21:0] high = $signed(peek_x1_q[24:17]) * k;
  wire signed [63:0] low_wide = {{33{low[30]}}, low};
  wire signed [63:0] high_wide = {{42{high[21]}}, high};
  wire signed [63:0] split = (high_wide <<< 17) + low_wide;
  always @(posedge clk_i) begin
    if (age_q != 3'd5) age_q <= age_q + 3'd1;
    {v5_q, v4_q, v3_q, v2_q, v1_q} <= {v4_q, v3_q, v2_q, v1_q, v_i};
    {current5_q, current4_q, current3_q, current2_q, current1_q} <= {current4_q, current3_q, current2_q, current1_q, current_i};
    theta5_q <= theta_i;
    product2_q <= NODECAY ? -split : split;
    {product5_q, product4_q, product3_q} <= {product4_q, product3_q, product2_q};
  end

  wire signed [63:0] old1 = FIRST ? 64'sd0 : {{40{v1_q[23]}}, v1_q};
  wire signed [63:0] current1 = {{40{current1_q[23]}}, current1_q};
  wire signed [63:0] factor1 = RADIX ? current1 : NODECAY ? -old1 : current1 - old1;
  wire signed [63:0] whole = factor1 <<< FRAC;
  wire multiplies_factor = {{39{peek_x1_q[24]}}, peek_x1_q} == factor1;  // else nothing is known of the product

  wire signed [63:0] theta = {{40{theta5_q[23]}}, theta5_q};
  wire signed [63:0] old = FIRST ? 64'sd0 : {{40{v5_q[23]}}, v5_q};
  wire signed [63:0] current = {{40{current5_q[23]}}, current5_q};
  wire signed [63:0] leak = (product5_q + HALF) >>> FRAC;
  wire signed [63:0] exact = RADIX ? (old <<< 1) + leak : old - leak + current;
  wire signed [63:0] limited = exact > MAX ? MAX : exact < -MAX - 64'sd1 ? -MAX - 64'sd1 : exact;
  wire signed [63:0] leaky = LEAPS ? current : old + leak;
  wire signed [63:0] membrane = NODECAY || RADIX ? limited : leaky;
  wire fires = membrane >= theta;
  wire signed [63:0] after = fires ? membrane - theta : membrane;

  always @* begin
    // What sf_csr enforces.
    assume (k_i <= 13'd1 << FRAC);
    assume (theta_i >= 24'sd1);
    if (LEAPS) assume (!multiplies_factor || (split == whole && k_i == 13'd1 << FRAC));
    // mul_bounds: of each product, and of the whole that mul_split makes of them
    assume (low[30:29] == 2'd0 && low[28:0] <= {peek_x1_q[16:0], {FRAC{1'b0}}});
    assume (peek_x1_q[24] ? (high[21] && high[20:0] >= {1'b1, peek_x1_q[24:17], {FRAC{1'b0}}}) || high == 22'sd0
                          : !high[21] && high[20:0] <= {1'b0, peek_x1_q[24:17], {FRAC{1'b0}}});
    assume (whole < 64'sd0 ? split <= 64'sd0 && split >= whole : split >= 64'sd0 && split <= whole);

    if (age_q != 3'd0) multiplies_the_factor : assert (multiplies_factor);
    if (age_q == 3'd5) begin
      spike_is_the_comparison : assert (spike == fires);
      membrane_is_exact : assert ({{40{v[23]}}, v} == after);
      reset_leaves_no_debt : assert (!spike || v >= 24'sd0);
      if (!NODECAY && !RADIX) between_v_and_current : assert (old < current ? membrane >= old && membrane <= current
                                                                  : membrane >= current && membrane <= old);
    end
  end
endmodule

`default_nettype wire
