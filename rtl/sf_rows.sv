// Rows of weights: what one presynaptic neuron sends out. Words of 32 bits side by side, each a memory of its own, so that
// tools make block RAMs of them without waste. A row is read one cycle later and stays until the next is read. Nothing is
// read while it is written: tools need not guard against that (no_rw_check, of Yosys).
`default_nettype none

module sf_rows #(
    parameter WORDS = 32,  // 32-bit words per row
    parameter ROWS = 192,
    parameter ROW_BITS = 8,
    parameter WORD_BITS = 5
) (
    input  wire                 clk_i,
    input  wire                 we_i,
    input  wire [ ROW_BITS-1:0] wrow_i,
    input  wire [WORD_BITS-1:0] wword_i,
    input  wire [         31:0] wdata_i,
    input  wire                 re_i,
    input  wire [ ROW_BITS-1:0] rrow_i,
    output wire [ 32*WORDS-1:0] row_o
);
  genvar w;
  generate
    for (w = 0; w < WORDS; w = w + 1) begin : g_word
      // verilator tracing_off
      (* no_rw_check *) reg [31:0] mem_q[0:ROWS-1];
      // verilator tracing_on
      reg [31:0] word_q;
      always_ff @(posedge clk_i) begin
        if (we_i && wword_i == WORD_BITS'(w)) mem_q[wrow_i] <= wdata_i;
        if (re_i) word_q <= mem_q[rrow_i];
      end
      assign row_o[32*w+:32] = word_q;
    end
  endgenerate
endmodule

`default_nettype wire
