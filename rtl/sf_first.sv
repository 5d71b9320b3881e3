// Priority encoder over a spike bitmap: the lowest set bit, as a mask and as an index.
`default_nettype none

module sf_first #(
    parameter WIDTH = 128,  // a power of two
    parameter BITS = 7      // of the index
) (
    input  wire [WIDTH-1:0] bits_i,
    output wire             any_o,
    output wire [WIDTH-1:0] mask_o,
    output wire [ BITS-1:0] index_o
);
  assign any_o = |bits_i;
  assign mask_o = bits_i & (~bits_i + {{(WIDTH - 1) {1'b0}}, 1'b1});
  // Bit b of the index: is the place of the one bit an odd multiple of 2^b?
  genvar b;
  generate
    for (b = 0; b < BITS; b = b + 1) begin : g_index
      assign index_o[b] = |(mask_o & {(WIDTH >> (b + 1)) {{(1 << b) {1'b1}}, {(1 << b) {1'b0}}}});
    end
  endgenerate
endmodule

`default_nettype wire
