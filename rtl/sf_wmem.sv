// Weight memory: one row is the fan-out of one presynaptic neuron. Written 4 weights at a time, read a row at a time,
// one cycle later.
`default_nettype none

module sf_wmem #(
    parameter WORDS = 32,  // 32-bit words per row
    parameter ROWS = 192,
    parameter ROW_BITS = 8
) (
    input  wire                clk_i,
    input  wire                we_i,
    input  wire [ROW_BITS-1:0] wrow_i,
    input  wire [         4:0] wword_i,
    input  wire [        31:0] wdata_i,
    input  wire                re_i,
    input  wire [ROW_BITS-1:0] rrow_i,
    output reg  [32*WORDS-1:0] row_o
);
  for (genvar w = 0; w < WORDS; w++) begin : g_bank
    reg [31:0] mem_q[0:ROWS-1];
    always_ff @(posedge clk_i) begin
      if (we_i && wword_i == w) mem_q[wrow_i] <= wdata_i;
      if (re_i) row_o[32*w+:32] <= mem_q[rrow_i];
    end
  end
endmodule

`default_nettype wire
