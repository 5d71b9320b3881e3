// A current to the argument of a table, in five stages: the argument is there five cycles later. `colour_i` goes along and
// chooses the table. Mirror: src/fx/integrate.c (fx_exp2_argument, fx_sigmoid_argument)
`default_nettype none

module sf_scale (
    input  wire               clk_i,
    input  wire signed [23:0] current_i,  // 16 bits, or a weighted sum of such
    input  wire               colour_i,   // the sigmoid's scale and 16 bits, else the exponential's and 18
    input  wire        [15:0] exp_mul_i,
    input  wire        [ 4:0] exp_shift_i,
    input  wire signed [31:0] exp_bias_i,
    input  wire        [15:0] sigmoid_mul_i,
    input  wire        [ 4:0] sigmoid_shift_i,
    input  wire signed [31:0] sigmoid_bias_i,
    output reg  signed [17:0] y_o
);
  reg [3:0] colour_q;
  always_ff @(posedge clk_i) colour_q <= {colour_q[2:0], colour_i};

  // 1: product; 2: and half of what is shifted away; 3: shift; 4: and bias; 5: saturate
  wire [15:0] mul = colour_i ? sigmoid_mul_i : exp_mul_i;
  wire [4:0] shift1 = colour_q[0] ? sigmoid_shift_i : exp_shift_i;
  wire [4:0] shift2 = colour_q[1] ? sigmoid_shift_i : exp_shift_i;
  reg signed [40:0] product_q;
  reg signed [41:0] rounded_q, shifted_q;
  reg signed [42:0] sum_q;
  wire [31:0] half = (32'd1 << shift1) >> 1;
  wire [26:0] above = sum_q[42:16] ^ {27{sum_q[42]}};  // bits that a number of 17 bits has not
  wire over = colour_q[3] ? |above || sum_q[15] != sum_q[42] : |above[26:1];
  always_ff @(posedge clk_i) begin
    product_q <= current_i * $signed({1'b0, mul});
    rounded_q <= 42'(product_q) + $signed({10'd0, half});
    shifted_q <= rounded_q >>> shift2;
    sum_q <= 43'(shifted_q) + (colour_q[2] ? 43'(sigmoid_bias_i) : 43'(exp_bias_i));
    y_o <= !over ? sum_q[17:0]
         : colour_q[3] ? (sum_q[42] ? 18'h38000 : 18'h07fff)
         : (sum_q[42] ? 18'h20000 : 18'h1ffff);
  end
endmodule

`default_nettype wire
