// 2^y, y signed Q.12, to U16.12. Mirror: src/fx/exp2.c (fx_exp2)
`default_nettype none

module sf_exp2 (
    input  wire signed [17:0] y_i,
    output wire        [27:0] e_o
);
  `include "sf_round.svh"

  wire signed [5:0] n = y_i[17:12];
  wire [25:0] low_end;
  wire [25:0] high_end;
  sf_rom_exp2 u_rom (
      .index_i(y_i[11:4]),
      .low_o  (low_end),
      .high_o (high_end)
  );

  // 2^24 <= t <= 2^25
  wire [25:0] rise = high_end - low_end;
  wire [29:0] step = 30'(rise) * 30'(y_i[3:0]) + 30'd8;
  wire [25:0] t = low_end + step[29:4];
  wire [4:0] down = 5'(6'sd12 - n);
  wire [47:0] rounded = sf_rshift_round({22'd0, t}, down);
  wire [47:0] raised = {22'd0, t} << 5'(n - 6'sd12);
  assign e_o = n >= 6'sd16 ? 28'hfffffff : n < -6'sd13 ? 28'd0 : n <= 6'sd12 ? rounded[27:0] : raised[27:0];
  wire unused_ok = &{1'b0, step[3:0], rounded[47:28], raised[47:28]};
endmodule

`default_nettype wire
