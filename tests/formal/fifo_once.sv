// A queue whose writer knows that there is room: every word comes out once, in order and unchanged, whatever waits, and the
// queue shows a word if and only if there is one. The word looked at is any.
`default_nettype none

module fifo_once (
    input wire       clk_i,
    input wire       clear_i,
    input wire       push_i,
    input wire       pop_i,
    input wire [7:0] data_i
);
  (* anyconst *) wire [3:0] number;  // of the word looked at, modulo 16
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire valid;
  wire [7:0] data, look;
  sf_fifo #(
      .WIDTH     (8),
      .LOG2_DEPTH(3)
  ) u_dut (
      .clk_i  (clk_i),
      .rst_ni (rst_n_q),
      .clear_i(clear_i),
      .push_i (push_i),
      .data_i (data_i),
      .valid_o(valid),
      .pop_i  (pop_i),
      .data_o (data),
      .look_i (number[2:0]),
      .look_o (look)
  );
  wire [3:0] peek_write_q, peek_read_q;

  // Words are numbered as they are pushed; which is pushed next, which is popped next.
  reg [3:0] pushed_q = 4'd0, popped_q = 4'd0;
  reg [7:0] word_q;  // what was pushed as `number`
  wire [3:0] inside = pushed_q - popped_q;
  wire [3:0] age = pushed_q - number;
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) {pushed_q, popped_q} <= 8'd0;
    else begin
      pushed_q <= pushed_q + {3'd0, push_i};
      popped_q <= popped_q + {3'd0, pop_i};
    end
    if (push_i && pushed_q == number) word_q <= data_i;
  end

  always @* begin
    assume (!push_i || inside < 4'd8);
    assume (!pop_i || inside != 4'd0);
    if (rst_n_q) begin
      never_more_than_it_holds : assert (inside <= 4'd8);
      counts : assert (peek_write_q == pushed_q && peek_read_q == popped_q);
      shown_while_there : assert (valid == (inside != 4'd0));
      kept : assert (!(age != 4'd0 && age <= inside) || look == word_q);
      comes_out_unchanged : assert (!(valid && popped_q == number) || data == word_q);
    end
  end
endmodule

`default_nettype wire
