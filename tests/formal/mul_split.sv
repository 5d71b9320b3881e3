// Lemma for the neuron unit's two multipliers, by induction over the bits of k: x * k is high * k * 2^17 + low * k, where
// low is the lowest 17 bits of x and high, signed, the rest. A product is the sum of its factor, doubled for each bit of k.
`default_nettype none

module mul_split #(
    parameter W = 25,   // bits of the factor
    parameter LOW = 17
) (
    input wire clk_i,
    input wire bit_i
);
  localparam P = W + 15;
  (* anyconst *) wire signed [W-1:0] x;
  reg begun_q = 1'b0;
  reg [P-1:0] factor_q, whole_q;  // modulo 2^P, which holds the products of 13 bits and their signs
  reg [P-1:0] high_factor_q, high_q, low_factor_q, low_q;
  always @(posedge clk_i) begin
    if (!begun_q) begin
      begun_q <= 1'b1;
      factor_q <= {{P - W{x[W-1]}}, x};
      high_factor_q <= {{P - W + LOW{x[W-1]}}, x[W-1:LOW]};
      low_factor_q <= {{P - LOW{1'b0}}, x[LOW-1:0]};
      {whole_q, high_q, low_q} <= {3 * P{1'b0}};
    end else begin
      if (bit_i) begin
        whole_q <= whole_q + factor_q;
        high_q <= high_q + high_factor_q;
        low_q <= low_q + low_factor_q;
      end
      factor_q <= factor_q << 1;
      high_factor_q <= high_factor_q << 1;
      low_factor_q <= low_factor_q << 1;
    end
  end

  always @* begin
    if (begun_q) begin
      factors : assert (factor_q == (high_factor_q << LOW) + low_factor_q);
      products : assert (whole_q == (high_q << LOW) + low_q);
    end
  end
endmodule

`default_nettype wire
