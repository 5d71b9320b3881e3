// Dual issue: of every bitmap offered each set bit is issued exactly once, no other is, and never two of one parity in a
// cycle; last_o tells that nothing is left. In a cycle without take_i nothing is lost.
`default_nettype none

module pick_once #(
    parameter LANES = 32,
    parameter BITS = 4
) (
    input wire             clk_i,
    input wire             load_i,
    input wire             take_i,
    input wire [LANES-1:0] bits_i
);
  (* anyconst *) wire [BITS:0] watched;
  wire even, odd, last;
  wire [BITS-1:0] even_index, odd_index;
  wire [LANES-1:0] even_mask, odd_mask;
  sf_pick #(
      .LANES(LANES),
      .BITS (BITS)
  ) u_dut (
      .clk_i       (clk_i),
      .load_i      (load_i),
      .take_i      (take_i),
      .bits_i      (bits_i),
      .even_o      (even),
      .odd_o       (odd),
      .even_index_o(even_index),
      .odd_index_o (odd_index),
      .even_mask_o (even_mask),
      .odd_mask_o  (odd_mask),
      .last_o      (last)
  );
  wire [LANES-1:0] peek_left_q;

  reg begun_q = 1'b0;  // a bitmap was offered
  reg ended_q = 1'b0;  // and its last bits taken
  reg set_q;           // the watched bit was in it
  reg issued_q;
  wire here = watched[0] ? odd && odd_index == watched[BITS:1] : even && even_index == watched[BITS:1];
  wire set = load_i ? bits_i[watched] : set_q;
  wire issued = !load_i && issued_q;
  wire after = issued || (take_i && here);
  wire [LANES-1:0] one = {{LANES - 1{1'b0}}, 1'b1};
  always @(posedge clk_i) begin
    begun_q <= begun_q || load_i;
    ended_q <= take_i ? last : !load_i && ended_q;
    set_q <= set;
    issued_q <= after;
  end

  always @* begin
    assume (!load_i || !begun_q || ended_q);  // sf_split, sf_c2: the next bitmap when the last is worked off
    if (begun_q || load_i) begin
      only_of_the_set : assert (!(even || odd) || !here || set);
      at_most_once : assert (!here || !issued);
      one_of_each_parity : assert (even_mask == (even ? one << {even_index, 1'b0} : {LANES{1'b0}})
                                && odd_mask == (odd ? one << {odd_index, 1'b1} : {LANES{1'b0}}));
      every_one_in_the_end : assert (!(take_i && last) || after == set);
      last_is_last : assert (!last || !set || issued || here);
      not_idle : assert (load_i || ended_q || even || odd || set == issued);
    end
    if (begun_q) begin
      left_or_issued : assert (peek_left_q[watched] == (set_q && !issued_q));
      issued_were_set : assert (!issued_q || set_q);
      ended : assert (!ended_q || peek_left_q == {LANES{1'b0}});
    end
  end
endmodule

`default_nettype wire
