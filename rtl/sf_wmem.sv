// Weight memory: one row is the fan-out of one presynaptic neuron. Written 4 weights at a time, read a row at a time,
// one cycle later.
`default_nettype none

module sf_wmem #(
    parameter WORDS = 32,  // 32-bit words per row
    parameter ROWS = 192,
    parameter ROW_BITS = 8,
    parameter WORD_BITS = 5
) (
    input  wire                clk_i,
    input  wire                we_i,
    input  wire [ROW_BITS-1:0] wrow_i,
    input  wire [WORD_BITS-1:0] wword_i,
    input  wire [        31:0] wdata_i,
    input  wire                re_i,
    input  wire [ROW_BITS-1:0] rrow_i,
    output reg  [32*WORDS-1:0] row_o
);
  // verilator tracing_off
  reg [32*WORDS-1:0] mem_q[0:ROWS-1];
  // verilator tracing_on
  always_ff @(posedge clk_i) begin
    if (we_i) mem_q[wrow_i][32*wword_i+:32] <= wdata_i;
    if (re_i) row_o <= mem_q[rrow_i];
  end
endmodule

`default_nettype wire
