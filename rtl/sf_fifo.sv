// A queue of 2^LOG2_DEPTH words. It has no full flag: whoever writes knows by its own count that there is room.
`default_nettype none

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
    output wire [WIDTH-1:0] data_o
);
  reg [WIDTH-1:0] word_q[0:(1<<LOG2_DEPTH)-1];
  reg [LOG2_DEPTH:0] write_q, read_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q <= '0;
      read_q <= '0;
    end else if (clear_i) begin
      write_q <= '0;
      read_q <= '0;
    end else begin
      if (push_i) write_q <= write_q + 1'b1;
      if (pop_i) read_q <= read_q + 1'b1;
    end
  end

  always_ff @(posedge clk_i) if (push_i) word_q[write_q[LOG2_DEPTH-1:0]] <= data_i;

  assign valid_o = write_q != read_q;
  assign data_o = word_q[read_q[LOG2_DEPTH-1:0]];
endmodule

`default_nettype wire
