// The integrator of the output layers equals its specification in 64 bits, for the inputs of four cycles ago, whatever came
// before and after; between accumulator and input in decay and hybrid mode; saturating at the top and never below 0 in
// no-decay mode; in radix mode the input itself; within its accumulator's width always. Both multipliers are cut: what mul_bounds and mul_split allow.
`default_nettype none

module integrate_spec #(
    parameter [1:0] MODE = 2'd0,
    parameter [0:0] FIRST = 1'b0
) (
    input wire        clk_i,
    input wire [27:0] acc_i,
    input wire [27:0] in_i,
    input wire [12:0] k_i,
    input wire        colour_i
);
  localparam integer FRAC = sf_arch_pkg::LEAK_FRAC;
  localparam signed [63:0] HALF = 64'sd1 << (FRAC - 1);
  localparam signed [63:0] SIGMA_MAX = (64'sd1 << sf_arch_pkg::SIGMA_BITS) - 64'sd1;
  localparam signed [63:0] COLOUR_MAX = (64'sd1 << sf_arch_pkg::COLOUR_BITS) - 64'sd1;
  localparam NODECAY = MODE == sf_op_pkg::NODECAY;
  localparam RADIX = MODE == sf_op_pkg::RADIX;
  localparam FROM_ZERO = FIRST || RADIX;
  localparam LEAPS = RADIX || (MODE == sf_op_pkg::HYBRID && FIRST);  // to the input

  wire [27:0] acc;
  sf_integrate u_dut (
      .*,
      .first_i    (FIRST),
      .mode_i     (MODE),
      .k_density_i(k_i),
      .k_colour_i (k_i),
      .acc_o      (acc)
  );
  wire signed [28:0] peek_x1_q;

  // What came in n cycles ago; the products are of the cycle after it.
  reg [2:0] age_q = 3'd0;
  reg [27:0] acc1_q, acc2_q, acc3_q, acc4_q, in1_q, in2_q, in3_q, in4_q;
  reg [3:0] colour_q;
  reg signed [63:0] product2_q, product3_q, product4_q;
  reg [12:0] k1_q;
  wire signed [13:0] k = $signed({1'b0, k1_q});
  wire signed [30:0] low = $signed({1'b0, peek_x1_q[16:0]}) * k;
  wire signed [25:0] high = $signed(peek_x1_q[28:17]) * k;
  wire signed [63:0] low_wide = {{33{low[30]}}, low};
  wire signed [63:0] high_wide = {{38{high[25]}}, high};
  wire signed [63:0] split = (high_wide <<< 17) + low_wide;
  always @(posedge clk_i) begin
    if (age_q != 3'd4) age_q <= age_q + 3'd1;
    {acc4_q, acc3_q, acc2_q, acc1_q} <= {acc3_q, acc2_q, acc1_q, acc_i};
    {in4_q, in3_q, in2_q, in1_q} <= {in3_q, in2_q, in1_q, in_i};
    colour_q <= {colour_q[2:0], colour_i};
    k1_q <= LEAPS ? 13'd1 << FRAC : k_i;
    product2_q <= NODECAY ? -split : split;
    {product4_q, product3_q} <= {product3_q, product2_q};
  end

  wire signed [63:0] a1 = FROM_ZERO ? 64'sd0 : {36'd0, acc1_q};
  wire signed [63:0] factor1 = NODECAY ? -a1 : {36'd0, in1_q} - a1;
  wire signed [63:0] whole = factor1 <<< FRAC;
  wire multiplies_factor = {{35{peek_x1_q[28]}}, peek_x1_q} == factor1;  // else nothing is known of the product

  wire signed [63:0] max = colour_q[3] ? COLOUR_MAX : SIGMA_MAX;
  wire signed [63:0] a = FROM_ZERO ? 64'sd0 : {36'd0, acc4_q};
  wire signed [63:0] x = {36'd0, in4_q};
  wire signed [63:0] result = {36'd0, acc};
  wire signed [63:0] leak = (product4_q + HALF) >>> FRAC;
  wire signed [63:0] leaky = LEAPS ? x : a + leak;
  wire signed [63:0] exact = a - leak + x;
  wire signed [63:0] max_in = colour_i ? COLOUR_MAX : SIGMA_MAX;

  always @* begin
    assume (k_i <= 13'd1 << FRAC);
    assume ({36'd0, acc_i} <= max_in && {36'd0, in_i} <= max_in);
    if (LEAPS) assume (!multiplies_factor || split == whole);
    // mul_bounds: of each product, and of the whole that mul_split makes of them
    assume (low[30:29] == 2'd0 && low[28:0] <= {peek_x1_q[16:0], {FRAC{1'b0}}});
    assume (peek_x1_q[28] ? (high[25] && high[24:0] >= {1'b1, peek_x1_q[28:17], {FRAC{1'b0}}}) || high == 26'sd0
                          : !high[25] && high[24:0] <= {1'b0, peek_x1_q[28:17], {FRAC{1'b0}}});
    assume (whole < 64'sd0 ? split <= 64'sd0 && split >= whole : split >= 64'sd0 && split <= whole);

    if (age_q != 3'd0) multiplies_the_factor : assert (multiplies_factor);
    if (age_q == 3'd4) begin
      fits_its_width : assert (result <= max);
      if (NODECAY) begin
        never_negative : assert (exact >= 64'sd0);
        saturates : assert (result == (exact > max ? max : exact));
      end else begin
        equals_specification : assert (result == leaky);
        between_acc_and_input : assert (a < x ? result >= a && result <= x : result >= x && result <= a);
      end
    end
  end
endmodule

`default_nettype wire
