// In the place of sf_fifo, whose words come out once and in order (fifo_once): it counts, and a word that comes out is any.
// A property that has to know the words keeps them itself, by in_o. No word is put into a full one.
module sf_fifo #(
    parameter integer WIDTH = 8,
    parameter integer LOG2_DEPTH = 4
) (
    input  wire             clk_i,
    input  wire             rst_ni,
    input  wire             clear_i,
    input  wire             push_i,
    input  wire [WIDTH-1:0] data_i,
    output wire             valid_o,
    input  wire             pop_i,
    output wire [WIDTH-1:0] data_o,
    output wire [      6:0] count_o,
    output wire [WIDTH-1:0] in_o
);
  (* anyseq *) wire [WIDTH-1:0] word;
  reg [6:0] count_q = 7'd0;
  always @(posedge clk_i) begin
    if (!rst_ni || clear_i) count_q <= 7'd0;
    else count_q <= count_q + {6'd0, push_i} - {6'd0, pop_i};
  end
  assign valid_o = count_q != 7'd0;
  assign data_o = word;
  assign count_o = count_q;
  assign in_o = data_i;
  always @* if (rst_ni) fits : assert (count_q <= 7'd1 << LOG2_DEPTH);
endmodule
