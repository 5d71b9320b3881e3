// exp(-tau) of the compositor is at most 1.0, for every tau. Its multipliers are cut: any product of tau, and within a piece
// of the table any rise up to the whole (and none at its begin).
`default_nettype none

module exp_neg_one (
    input wire        clk_i,
    input wire [36:0] tau_i
);
  wire [20:0] e;
  sf_exp_neg u_dut (
      .clk_i(clk_i),
      .tau_i(tau_i),
      .e_o  (e)
  );
  wire [16:0] peek_rise5_q;
  wire [11:0] peek_place5_q;
  wire [28:0] peek_step;
  reg [3:0] age_q = 4'd0;
  always @(posedge clk_i) if (age_q < 4'd9) age_q <= age_q + 4'd1;

  always @* begin
    assume (peek_step <= {peek_rise5_q, 12'd0});
    assume (peek_place5_q != 12'd0 || peek_step == 29'd0);
    at_most_one : assert (age_q < 4'd9 || e <= 21'd1 << sf_arch_pkg::TRANS_FRAC);
  end
endmodule

`default_nettype wire
