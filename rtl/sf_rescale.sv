// A sum times mul / 2^shift, rounded half up, plus a bias, in four stages. Mirror: src/fx/tensorf.c (scaled)
`default_nettype none

module sf_rescale #(
    parameter integer IN = 39
) (
    input  wire                  clk_i,
    input  wire signed [ IN-1:0] sum_i,
    input  wire        [   15:0] mul_i,
    input  wire        [    5:0] shift_i,  // 0..40, one cycle after the sum
    input  wire signed [   23:0] bias_i,   // three cycles after it
    output reg  signed [IN+17:0] y_o       // four cycles after the sum
);
  // 1: product; 2: and half of what is shifted away; 3: shift; 4: and bias
  reg signed [IN+15:0] product_q;
  reg signed [IN+16:0] rounded_q, shifted_q;
  reg [5:0] shift2_q;
  wire [40:0] half = (41'd1 << shift_i) >> 1;
  always_ff @(posedge clk_i) begin
    product_q <= sum_i * $signed({1'b0, mul_i});
    rounded_q <= (IN + 17)'(product_q) + $signed((IN + 17)'(half));
    shift2_q <= shift_i;
    shifted_q <= rounded_q >>> shift2_q;
    y_o <= (IN + 18)'(shifted_q) + (IN + 18)'(bias_i);
  end
endmodule

`default_nettype wire
