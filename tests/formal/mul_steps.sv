// Lemma for multipliers, by induction over the bits of k: a product is the sum of the factor shifted for each bit of k;
// after n bits it is at most factor * (2^n - 1). So with 0 <= k <= 1.0 = 2^n (whose only bit is its last) factor * k is
// at most factor * 2^n. For any n that the width leaves room for.
`default_nettype none

module mul_steps #(
    parameter W = 21,  // bits of the factor
    parameter P = 43   // bits of the product and one for the comparison
) (
    input wire clk_i,
    input wire bit_i,
    input wire last_i
);
  (* anyconst *) wire [W-1:0] factor;
  wire [P-1:0] wide = {{P - W{1'b0}}, factor};
  reg begun_q = 1'b0, any_q, done_q;  // any: a bit of k was set
  reg [P-1:0] shifted_q, product_q;
  always @(posedge clk_i) begin
    if (!begun_q) begin
      {begun_q, any_q, done_q} <= 3'b100;
      shifted_q <= wide;
      product_q <= {P{1'b0}};
    end else if (!done_q) begin
      if (bit_i) product_q <= product_q + shifted_q;
      if (!last_i) shifted_q <= shifted_q << 1;
      any_q <= any_q || bit_i;
      done_q <= last_i;
    end
  end

  always @* begin
    assume (!(last_i && bit_i && any_q));  // k <= 1.0
    assume (last_i || !shifted_q[P-2]);
    if (begun_q) begin
      none_yet : assert (any_q || product_q == {P{1'b0}});
      room : assert (!shifted_q[P-1]);
      below : assert (done_q || (shifted_q >= wide && product_q <= shifted_q - wide));
      at_most_the_factor : assert (!done_q || product_q <= shifted_q);
    end
  end
endmodule

`default_nettype wire
