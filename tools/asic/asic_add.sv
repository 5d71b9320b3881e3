// An addition alone: the price int_add.WIDTH of a technology file.
`default_nettype none

module asic_add #(
    parameter WIDTH = 8
) (
    input  wire signed [WIDTH-1:0] a_i,
    input  wire signed [WIDTH-1:0] b_i,
    output wire signed [WIDTH-1:0] y_o
);
  assign y_o = a_i + b_i;
endmodule

`default_nettype wire
