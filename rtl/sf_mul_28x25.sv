// A product of 28 x 25 bits from 18 x 18 ones, three cycles after its factors; with of_tau_i half an LSB of tau, 2^15, more.
`default_nettype none

module sf_mul_28x25 (
    input  wire        clk_i,
    input  wire [27:0] a_i,
    input  wire [24:0] b_i,
    input  wire        of_tau_i,
    output reg  [52:0] product_o
);
  reg [27:0] a_q;
  reg [24:0] b_q;
  reg [35:0] low_q;
  reg [27:0] cross_q;
  reg [24:0] other_cross_q;
  reg [16:0] high_q;
  reg [1:0] of_tau_q;
  wire [28:0] crosses = {1'b0, cross_q} + {4'd0, other_cross_q};
  always_ff @(posedge clk_i) begin
    a_q <= a_i;
    b_q <= b_i;
    low_q <= 36'(a_q[17:0]) * 36'(b_q[17:0]);
    cross_q <= 28'(a_q[27:18]) * 28'(b_q[17:0]);
    other_cross_q <= 25'(a_q[17:0]) * 25'(b_q[24:18]);
    high_q <= 17'(a_q[27:18]) * 17'(b_q[24:18]);
    of_tau_q <= {of_tau_q[0], of_tau_i};
    product_o <= {high_q, low_q} + {6'd0, crosses, 2'd0, of_tau_q[1], 15'd0};
  end
endmodule

`default_nettype wire
