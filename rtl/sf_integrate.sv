// Leaky integrator of an output layer, one step, in five stages: the accumulator is read in the first and may be written at
// the end of the fifth. One unit serves density (28 bits) and colour (20 bits): only the saturation differs.
// In radix mode the input comes once: it takes the accumulator's place. Mirror: src/fx/integrate.c
`default_nettype none

module sf_integrate (
    input  wire        clk_i,
    input  wire [27:0] acc_i,
    input  wire [27:0] in_i,
    input  wire        first_i,
    input  wire [ 1:0] mode_i,
    input  wire        colour_i,
    input  wire [12:0] k_density_i,
    input  wire [12:0] k_colour_i,
    output wire [27:0] acc_o       // four cycles later
);
  localparam FRAC = sf_arch_pkg::LEAK_FRAC;
  localparam signed [42:0] HALF = 43'sd1 <<< (FRAC - 1);
  wire nodecay = mode_i == sf_op_pkg::NODECAY;

  // 1: what leaks, and what it is added to
  wire radix = mode_i == sf_op_pkg::RADIX;
  wire signed [28:0] a = first_i || radix ? 29'sd0 : $signed({1'b0, acc_i});
  wire signed [28:0] x = $signed({1'b0, in_i});
  reg signed [28:0] x1_q;
  reg [28:0] base1_q;
  reg [12:0] k1_q;
  reg [3:0] colour_q;
  always_ff @(posedge clk_i) begin
    x1_q <= nodecay ? -a : x - a;
    base1_q <= nodecay ? a + x : a;
    k1_q <= radix || (mode_i == sf_op_pkg::HYBRID && first_i) ? 13'd1 << FRAC : colour_i ? k_colour_i : k_density_i;
    colour_q <= {colour_q[2:0], colour_i};
  end

  // 2: 29 x 13 bits as two products of the multipliers' size
  reg signed [30:0] low2_q;
  reg signed [25:0] high2_q;
  reg [28:0] base2_q, base3_q;
  wire signed [13:0] k = $signed({1'b0, k1_q});
  always_ff @(posedge clk_i) begin
    low2_q <= $signed({1'b0, x1_q[16:0]}) * k;
    high2_q <= $signed(x1_q[28:17]) * k;
    base2_q <= base1_q;
  end

  // 3: x / 2^n, round half up. No-decay mode adds what a negated product gives: -round(p) = floor((-p + half - 1) / 2^n).
  wire signed [42:0] product = {high2_q, 17'd0} + 43'(low2_q) + (nodecay ? HALF - 43'sd1 : HALF);
  reg [28:0] leak3_q;
  always_ff @(posedge clk_i) begin
    leak3_q <= 29'(product >>> FRAC);
    base3_q <= base2_q;
  end

  // 4: the new value; no leak of at most 1 makes it negative, or larger than the sum of both. 5: saturate
  reg [28:0] v4_q;
  always_ff @(posedge clk_i) v4_q <= base3_q + leak3_q;
  wire over = colour_q[3] ? v4_q[20] : v4_q[28];
  assign acc_o = over ? (colour_q[3] ? 28'h00fffff : 28'hfffffff) : v4_q[27:0];
endmodule

`default_nettype wire
