// 2^y, y signed Q.12, to U16.12, in six stages. Mirror: src/fx/exp2.c (fx_exp2)
`default_nettype none

module sf_exp2 (
    input  wire               clk_i,
    input  wire signed [17:0] y_i,
    output reg         [27:0] e_o   // six cycles later
);
  wire [25:0] low_end;
  wire [25:0] high_end;
  sf_rom_exp2 u_rom (
      .index_i(y_i[11:4]),
      .low_o  (low_end),
      .high_o (high_end)
  );

  // 1: table; 2: rise; 3: product; 4: 2^24 <= t <= 2^25; 5: and half of what is shifted away; 6: shift
  reg [25:0] low1_q, high1_q, low2_q, low3_q, t4_q;
  reg [16:0] rise2_q;  // the table rises by at most 2^25 - 2^(25 - 1/256) < 2^17
  reg [20:0] step3_q;
  reg [26:0] rounded5_q;
  reg [3:0] frac1_q, frac2_q;
  reg signed [5:0] n1_q, n2_q, n3_q, n4_q, n5_q;
  wire [4:0] down4 = 5'(6'sd12 - n4_q);
  wire [4:0] down5 = 5'(6'sd12 - n5_q);
  wire [26:0] half = n4_q > 6'sd12 ? 27'd0 : 27'(({1'b0, 26'd1} << down4) >> 1);
  wire [20:0] rounding = step3_q + 21'd8;
  wire [26:0] lowered = rounded5_q >> down5;
  wire [28:0] raised = {2'd0, rounded5_q} << 2'(n5_q - 6'sd12);
  always_ff @(posedge clk_i) begin
    {low1_q, high1_q} <= {low_end, high_end};
    {frac1_q, n1_q} <= {y_i[3:0], y_i[17:12]};
    rise2_q <= 17'(high1_q - low1_q);
    {low2_q, frac2_q, n2_q} <= {low1_q, frac1_q, n1_q};
    step3_q <= rise2_q * frac2_q;
    {low3_q, n3_q} <= {low2_q, n2_q};
    t4_q <= low3_q + {9'd0, rounding[20:4]};
    n4_q <= n3_q;
    rounded5_q <= {1'b0, t4_q} + half;
    n5_q <= n4_q;
    e_o <= n5_q >= 6'sd16 ? 28'hfffffff : n5_q < -6'sd13 ? 28'd0 : n5_q <= 6'sd12 ? {1'b0, lowered} : raised[27:0];
  end
  wire unused_ok = &{1'b0, rounding[3:0], raised[28]};
endmodule

`default_nettype wire
