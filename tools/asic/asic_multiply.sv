// A multiplication alone: the price int_multiply.WIDTH of a technology file.
`default_nettype none

module asic_multiply #(
    parameter WIDTH = 8
) (
    input  wire signed [  WIDTH-1:0] a_i,
    input  wire signed [  WIDTH-1:0] b_i,
    output wire signed [2*WIDTH-1:0] y_o
);
  assign y_o = a_i * b_i;
endmodule

`default_nettype wire
