// Priority encoder over a spike bitmap: the lowest set bit, as a mask and as an index.
`default_nettype none

module sf_first (
    input  wire [127:0] bits_i,
    output wire         any_o,
    output wire [127:0] mask_o,
    output wire [  6:0] index_o
);
  assign any_o = |bits_i;
  assign mask_o = bits_i & (~bits_i + 128'd1);
  assign index_o[0] = |(mask_o & {64{2'b10}});
  assign index_o[1] = |(mask_o & {32{4'hc}});
  assign index_o[2] = |(mask_o & {16{8'hf0}});
  assign index_o[3] = |(mask_o & {8{16'hff00}});
  assign index_o[4] = |(mask_o & {4{32'hffff0000}});
  assign index_o[5] = |(mask_o & {2{64'hffffffff00000000}});
  assign index_o[6] = |mask_o[127:64];
endmodule

`default_nettype wire
