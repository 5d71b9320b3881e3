// Dual issue: the spikes that are left, two at a time, the lowest of the even and the lowest of the odd neurons. Each
// parity has a weight bank of its own. A bitmap is offered by `load_i` and worked off while `take_i`.
`default_nettype none

module sf_pick #(
    parameter LANES = 128,
    parameter BITS = 6      // of an index within a bank
) (
    input  wire             clk_i,
    input  wire             load_i,   // bits_i is a new bitmap, in this cycle already
    input  wire             take_i,   // the picked ones are gone from the next cycle on
    input  wire [LANES-1:0] bits_i,
    output wire             even_o,
    output wire             odd_o,
    output wire [ BITS-1:0] even_index_o,
    output wire [ BITS-1:0] odd_index_o,
    output wire [LANES-1:0] even_mask_o,
    output wire [LANES-1:0] odd_mask_o,
    output wire             last_o    // nothing is left after these
);
  localparam [LANES-1:0] EVEN = {(LANES / 2) {2'b01}};
  reg [LANES-1:0] left_q;
  wire [LANES-1:0] bits = load_i ? bits_i : left_q;
  wire even_parity, odd_parity;

  sf_first #(
      .WIDTH(LANES),
      .BITS (BITS + 1)
  ) u_even (
      .bits_i (bits & EVEN),
      .any_o  (even_o),
      .mask_o (even_mask_o),
      .index_o({even_index_o, even_parity})
  );
  sf_first #(
      .WIDTH(LANES),
      .BITS (BITS + 1)
  ) u_odd (
      .bits_i (bits & ~EVEN),
      .any_o  (odd_o),
      .mask_o (odd_mask_o),
      .index_o({odd_index_o, odd_parity})
  );
  wire unused_ok = &{1'b0, even_parity, odd_parity};
  wire [LANES-1:0] left = bits & ~even_mask_o & ~odd_mask_o;
  assign last_o = left == {LANES{1'b0}};
  always_ff @(posedge clk_i) left_q <= take_i ? left : bits;
endmodule

`default_nettype wire
