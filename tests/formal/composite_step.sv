// The arithmetic of compositing (src/fx/composite.c): whatever exp(-tau) is given, 0..1 included, the weights and the
// transmittance left add up to 1 exactly, after any number of samples; transmittance never rises.
`default_nettype none

module composite_step (
    input wire        clk_i,
    input wire        begin_i,
    input wire        add_i,
    input wire [20:0] decay_i
);
  `include "sf_round.svh"
  localparam integer FRAC = sf_arch_pkg::TRANS_FRAC;
  localparam [20:0] ONE = 21'd1 << FRAC;
  reg [20:0] left_q = ONE;
  reg [20:0] sum_q = 21'd0;
  wire signed [47:0] product = {27'd0, left_q} * {27'd0, decay_i};
  wire signed [47:0] after = sf_rshift_round(product, FRAC[4:0]);
  wire [20:0] weight = left_q - after[20:0];

  always @(posedge clk_i) begin
    if (begin_i) begin
      left_q <= ONE;
      sum_q <= 21'd0;
    end else if (add_i) begin
      left_q <= after[20:0];
      sum_q <= sum_q + weight;
    end
  end

  always @* begin
    // mul_bounds, as exp(-tau) <= 1
    assume (product >= 48'sd0 && product <= {27'd0, left_q} << FRAC);
    conserves_one : assert ({1'b0, sum_q} + {1'b0, left_q} == {1'b0, ONE});
    never_above_one : assert (left_q <= ONE);
    never_rises : assert (after >= 48'sd0 && after <= {27'd0, left_q});
  end
endmodule

`default_nettype wire
