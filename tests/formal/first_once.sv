// Driven as the sequencer drives it (pending bits less those issued), the priority encoder issues every set bit exactly
// once, in rising order, and no other.
`default_nettype none

module first_once (
    input wire         clk_i,
    input wire         load_i,
    input wire [127:0] bits_i,
    input wire         take_i
);
  (* anyconst *) wire [6:0] watched;
  (* anyconst *) wire [6:0] other;
  reg [127:0] pending_q = 128'd0;
  reg set_q = 1'b0;     // the watched bit was in the bitmap
  reg [1:0] issued_q = 2'd0;  // times it was issued, 3: three or more
  wire any;
  wire [127:0] mask;
  wire [6:0] index;
  sf_first u_dut (
      .bits_i (pending_q),
      .any_o  (any),
      .mask_o (mask),
      .index_o(index)
  );

  wire load = load_i && !any;
  wire take = take_i && any;
  always @(posedge clk_i) begin
    if (load) begin
      pending_q <= bits_i;
      set_q <= bits_i[watched];
      issued_q <= 2'd0;
    end else if (take) begin
      pending_q <= pending_q & ~mask;
      if (index == watched && issued_q != 2'd3) issued_q <= issued_q + 2'd1;
    end
  end

  always @* begin
    any_means_any : assert (any == (pending_q != 128'd0));
    mask_is_the_index : assert (mask == (any ? 128'd1 << index : 128'd0));
    lowest : assert (!any || !(pending_q[other] && other < index));
    issued_or_pending : assert (pending_q[watched] == (set_q && issued_q == 2'd0));
    at_most_once : assert (issued_q <= {1'b0, set_q});
    every_one_in_the_end : assert (any || issued_q == {1'b0, set_q});
  end
endmodule

`default_nettype wire
