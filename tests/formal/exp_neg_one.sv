// exp(-tau) of the compositor is at most 1.0, for every tau. Its two multipliers are cut: any product of tau up to that
// of the largest, any rise within a piece of the table up to the whole
// (and none at its begin).
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
  wire [50:0] peek_product;
  wire [25:0] peek_rise;
  wire [29:0] peek_step;
  wire [47:0] peek_rounded;
  wire [26:0] peek_y_q;
  reg [1:0] age_q = 2'd0;
  always @(posedge clk_i) if (!age_q[1]) age_q <= age_q + 2'd1;

  localparam [50:0] LARGEST = 51'd24204406 << 25;  // log2(e), tau = 32
  always @* begin
    assume (peek_product <= LARGEST);
    assume (peek_step >= 30'd2048);
    assume (peek_step - 30'd2048 <= {peek_rise[17:0], 12'd0});
    assume (peek_y_q[11:0] != 12'd0 || peek_step == 30'd2048);
    fits : assert (age_q == 2'd0 || peek_rounded <= 48'd1 << sf_arch_pkg::TRANS_FRAC);
    at_most_one : assert (!age_q[1] || e <= 21'd1 << sf_arch_pkg::TRANS_FRAC);
  end
endmodule

`default_nettype wire
