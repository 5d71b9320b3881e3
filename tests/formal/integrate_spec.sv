// The integrator of the output layers equals its specification in 48 bits, which hold every value exactly (29 x 13 bits); between accumulator and input in decay and
// hybrid mode; saturating at the top and never below 0 in no-decay mode; within its accumulator's width always.
`default_nettype none

module integrate_spec #(
    parameter [1:0] MODE = 2'd0,
    parameter [0:0] FIRST = 1'b0
) (
    input wire [27:0] acc_i,
    input wire [27:0] in_i,
    input wire [12:0] k_i,
    input wire        colour_i
);
  localparam integer FRAC = sf_arch_pkg::LEAK_FRAC;
  localparam signed [47:0] HALF = 48'sd1 << (FRAC - 1);
  localparam signed [47:0] SIGMA_MAX = (48'sd1 << sf_arch_pkg::SIGMA_BITS) - 48'sd1;
  localparam signed [47:0] COLOUR_MAX = (48'sd1 << sf_arch_pkg::COLOUR_BITS) - 48'sd1;
  localparam NODECAY = MODE == sf_op_pkg::NODECAY;

  wire [27:0] acc;
  sf_integrate u_dut (
      .acc_i   (acc_i),
      .in_i    (in_i),
      .k_i     (k_i),
      .mode_i  (MODE),
      .first_i (FIRST),
      .colour_i(colour_i),
      .acc_o   (acc)
  );

  wire signed [47:0] max = colour_i ? COLOUR_MAX : SIGMA_MAX;
  wire signed [47:0] a = FIRST ? 48'sd0 : {20'd0, acc_i};
  wire signed [47:0] x = {20'd0, in_i};
  wire signed [47:0] k = {35'd0, k_i};
  wire signed [47:0] result = {20'd0, acc};
  wire signed [47:0] factor = NODECAY ? a : x - a;
  wire signed [47:0] product = factor * k;
  wire signed [47:0] leak = (product + HALF) >>> FRAC;
  wire signed [47:0] leaky = MODE == sf_op_pkg::HYBRID && FIRST ? x : a + leak;
  wire signed [47:0] exact = a - leak + x;
  wire signed [47:0] whole = factor <<< FRAC;

  always @* begin
    assume (k_i <= 13'd1 << FRAC);
    assume ({20'd0, acc_i} <= max && x <= max);
    // mul_bounds
    assume (factor < 48'sd0 ? product <= 48'sd0 && product >= whole : product >= 48'sd0 && product <= whole);

    fits_its_width : assert (result <= max);
    if (NODECAY) begin
      never_negative : assert (exact >= 48'sd0);
      saturates : assert (result == (exact > max ? max : exact));
    end else begin
      equals_specification : assert (result == leaky);
      between_acc_and_input : assert (a < x ? result >= a && result <= x : result >= x && result <= a);
    end
  end
endmodule

`default_nettype wire
