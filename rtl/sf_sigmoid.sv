// Logistic function, x signed Q4.12, to Q0.16, in six stages. Mirror: src/fx/sigmoid.c (fx_sigmoid)
`default_nettype none

module sf_sigmoid (
    input  wire               clk_i,
    input  wire signed [15:0] x_i,
    output reg         [15:0] s_o   // six cycles later
);
  // 1: magnitude; 2: table; 3: rise; 4: product; 5: p; 6: sign
  reg [14:0] m1_q;
  reg [4:0] minus_q;
  wire [15:0] magnitude = x_i[15] ? ~x_i + 16'd1 : x_i;
  wire [15:0] low_end;
  wire [15:0] high_end;
  sf_rom_sigmoid u_rom (
      .index_i(m1_q[14:7]),
      .low_o  (low_end),
      .high_o (high_end)
  );
  reg [15:0] low2_q, high2_q, low3_q, rise3_q, low4_q, p5_q;
  reg [6:0] frac2_q, frac3_q;
  reg [22:0] step4_q;
  wire [22:0] rounding = step4_q + 23'd64;
  always_ff @(posedge clk_i) begin
    minus_q <= {minus_q[3:0], x_i[15]};
    m1_q <= magnitude[15] ? 15'h7fff : magnitude[14:0];
    {low2_q, high2_q, frac2_q} <= {low_end, high_end, m1_q[6:0]};
    {rise3_q, low3_q, frac3_q} <= {high2_q - low2_q, low2_q, frac2_q};
    step4_q <= rise3_q * frac3_q;
    low4_q <= low3_q;
    p5_q <= low4_q + rounding[22:7];
    s_o <= minus_q[4] ? ~p5_q + 16'd1 : p5_q;
  end
  wire unused_ok = &{1'b0, rounding[6:0]};
endmodule

`default_nettype wire
