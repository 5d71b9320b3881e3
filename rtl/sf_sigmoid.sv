// Logistic function, x signed Q4.12, to Q0.16. Mirror: src/fx/sigmoid.c (fx_sigmoid)
`default_nettype none

module sf_sigmoid (
    input  wire signed [15:0] x_i,
    output wire        [15:0] s_o
);
  wire [15:0] magnitude = x_i[15] ? ~x_i + 16'd1 : x_i;
  wire [14:0] m = magnitude[15] ? 15'h7fff : magnitude[14:0];
  wire [15:0] low_end;
  wire [15:0] high_end;
  sf_rom_sigmoid u_rom (
      .index_i(m[14:7]),
      .low_o  (low_end),
      .high_o (high_end)
  );

  wire [15:0] rise = high_end - low_end;
  wire [22:0] step = 23'(rise) * 23'(m[6:0]) + 23'd64;
  wire [15:0] p = low_end + step[22:7];
  assign s_o = x_i[15] ? ~p + 16'd1 : p;
  wire unused_ok = &{1'b0, step[6:0]};
endmodule

`default_nettype wire
