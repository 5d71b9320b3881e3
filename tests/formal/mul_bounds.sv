// Lemma for the proofs that cut the multiplier: 0 <= k <= 1.0 keeps factor * k between 0 and factor, ends included.
`default_nettype none

module mul_bounds #(
    parameter W = 25,    // bits of the factor
    parameter FRAC = 12  // fraction bits of k
) (
    input wire signed [W-1:0] factor_i,
    input wire [FRAC:0] k_i
);
  localparam P = W + FRAC + 1;
  wire signed [P-1:0] factor = {{FRAC + 1{factor_i[W-1]}}, factor_i};
  wire signed [P-1:0] k = {{W{1'b0}}, k_i};
  wire signed [P-1:0] product = factor * k;
  wire signed [P-1:0] whole = factor <<< FRAC;

  always @* begin
    assume (!k_i[FRAC] || k_i[FRAC-1:0] == {FRAC{1'b0}});
    if (factor_i < 0) negative : assert (product <= 0 && product >= whole);
    else positive : assert (product >= 0 && product <= whole);
  end
endmodule

`default_nettype wire
