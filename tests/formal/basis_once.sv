// Blocks of a sample to its sums, however samples and whoever takes the sums wait: each component of each block is multiplied
// with its own row, is added exactly once, to the sum of its own sample, and nothing else is. There is one set of sums for each
// sample, in order, unchanged while it waits. Block, component and its value are any.
// The queue of blocks holds what was put in, in order (fifo_once). It has 4 places here, and its writer knows that there is room:
// in sf_planes five samples of 12 blocks at most are on their way, and 64 places are there.
`default_nettype none

`include "tests/formal/counting_fifo.svh"

module basis_once (
    input wire         clk_i,
    input wire         clear_i,
    input wire         valid_i,
    input wire [495:0] products_i,
    input wire [  1:0] block_i,
    input wire [  1:0] pair_i,
    input wire         end_i,
    input wire         ready_i,
    input wire         mark_i       // the block looked at is this one
);
  (* anyconst *) wire [3:0] component;
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire valid, valid1, end1, held, whole, begun, work, hand_over, hit2;
  wire [3:0] pair_block1, at;
  wire [1:0] added, first, last;  // of the stages with a product: x and row, product
  wire [991:0] sums;
  wire [15:0] x1, x2, shifted;
  wire [7:0] row;
  wire [23:0] product;
  wire [30:0] sum;
  wire [6:0] count;
  wire hit;
  wire [20:0] head;
  sf_basis u_dut (
      .clk_i           (clk_i),
      .rst_ni          (rst_n_q),
      .clear_i         (clear_i),
      .cfg_we_i        (1'b0),
      .cfg_addr_i      (11'd0),
      .cfg_data_i      (32'd0),
      .valid_i         (valid_i),
      .products_i      (products_i),
      .block_i         (block_i),
      .pair_i          (pair_i),
      .end_i           (end_i),
      .valid_o         (valid),
      .ready_i         (ready_i),
      .sums_o          (sums),
      .look_hit_i      (hit),
      .look_component_i(component),
      .look_block_o    ({valid1, x1}),
      .look_row_o      (row),
      .look_at_o       (at),
      .look_flags_o    ({end1, pair_block1, held, whole, begun, work, added, first, hand_over}),
      .look_way_o      ({hit2, x2, product, sum}),
      .look_shifted_o  (shifted),
      .look_count_o    (count),
      .look_head_o     (head),
      .look_ends_o     (last)
  );

  // ---- the blocks in the queue: end, pair and block, the value of the component, whether it is the one looked at
  reg [1:0] newest_q = 2'd0, oldest_q = 2'd0;
  reg [3:0] end_q, mark_q;
  reg [15:0] tag_q;
  reg [63:0] values_q;
  reg marked_q = 1'b0, mark1_q = 1'b0;
  reg [15:0] value_q;  // of the block looked at
  wire [30:0] rounded = products_i[31*component+:31] + 31'd16384;
  wire pop = work && at == 4'd15;
  wire [15:0] value_at_hand = values_q[16*oldest_q+:16];
  assign hit = mark_q[oldest_q] && at == component;
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) {newest_q, oldest_q, marked_q, mark1_q} <= 6'd0;
    else begin
      marked_q <= marked_q || (valid_i && mark_i);
      mark1_q <= valid_i && mark_i;
      if (valid1) newest_q <= newest_q + 2'd1;
      if (pop) oldest_q <= oldest_q + 2'd1;
    end
    if (valid_i && mark_i) value_q <= rounded[30:15];
    if (valid1) begin
      end_q[newest_q] <= end1;
      mark_q[newest_q] <= mark1_q;
      tag_q[4*newest_q+:4] <= pair_block1;
      values_q[16*newest_q+:16] <= x1;
    end
  end
  wire [1:0] second = oldest_q + 2'd1, third = oldest_q + 2'd2, fourth = oldest_q + 2'd3;
  wire end_a = count >= 7'd1 && end_q[oldest_q], end_b = count >= 7'd2 && end_q[second];
  wire end_c = count >= 7'd3 && end_q[third], end_d = count == 7'd4 && end_q[fourth];
  wire mark_a = count >= 7'd1 && mark_q[oldest_q], mark_b = count >= 7'd2 && mark_q[second];
  wire mark_c = count >= 7'd3 && mark_q[third], mark_d = count == 7'd4 && mark_q[fourth];

  // ---- samples are numbered: the one that comes in, the one that is added up, that of the block looked at
  localparam [2:0] NONE = 3'd0, FIRST = 3'd1, QUEUE = 3'd2, WORK = 3'd3, OUT = 3'd4, GONE = 3'd5;
  reg [2:0] in_q = 3'd0, sum_no_q = 3'd0, number_q;
  reg [2:0] where_q = NONE;
  reg live_q = 1'b0, sum_hit_q;  // sum has products of the sample at work; the one looked at is among them
  reg hit3_q;  // the product at hand is that of the component looked at
  wire [2:0] base = sum_no_q + {2'd0, held};  // of the block at hand
  wire leaves = valid && ready_i;
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) begin
      {in_q, sum_no_q, where_q} <= 9'd0;
      live_q <= 1'b0;
    end else begin
      in_q <= in_q + {2'd0, valid_i && end_i};
      sum_no_q <= sum_no_q + {2'd0, hand_over};
      live_q <= added[1] || (live_q && !hand_over);
      if (valid_i && mark_i) where_q <= FIRST;
      else if (mark1_q) where_q <= QUEUE;
      else if (work && hit) where_q <= WORK;
      else if (where_q == WORK && hand_over) where_q <= OUT;
      else if (where_q == OUT && leaves) where_q <= GONE;
    end
    if (valid_i && mark_i) number_q <= in_q;
    if (added[1]) sum_hit_q <= (sum_hit_q && !first[1]) || (where_q == WORK && hit3_q);
    hit3_q <= hit2 && added[0];
  end
  reg waits_q = 1'b0;
  reg [30:0] waited_q;
  always @(posedge clk_i) begin
    waits_q <= rst_n_q && !clear_i && valid && !ready_i;
    waited_q <= sums[30:0];
  end
  wire [30:0] value = {{15{value_q[15]}}, value_q};
  wire inside = added[0] || added[1] || live_q;
  always @* begin
    assume (!valid_i || count + {6'd0, valid1} < 7'd4);
    assume (!mark_i || !marked_q);
    assume (count == 7'd0 || head == {end_q[oldest_q], tag_q[4*oldest_q+:4], value_at_hand});  // fifo_once
    if (!rst_n_q) at_reset : assert ({newest_q, oldest_q, marked_q, mark1_q, in_q, sum_no_q, where_q, live_q, waits_q} == 17'd0);
    else begin
      counts : assert (count <= 7'd4 && count + {6'd0, valid1} <= 7'd4 && count[1:0] == newest_q - oldest_q);
      own_row : assert (!work || row == {tag_q[4*oldest_q+:4], at});
      at_a_block : assert (at == 4'd0 || (count != 7'd0 && !held));
      numbers : assert (in_q == base + {2'd0, end_a} + {2'd0, end_b} + {2'd0, end_c} + {2'd0, end_d} + {2'd0, valid1 && end1});
      begun_with_a_product : assert (held ? !begun && inside : begun == inside);
      at_the_first : assert (begun || at == 4'd0);
      first_begins : assert ((!added[1] || first[1] == !live_q) && (!added[0] || first[0] == !(live_q || added[1])));
      held_until_whole : assert (!whole || (held && live_q && added == 2'd0));
      held_from_the_last : assert (held == (whole || |(added & last)) && !(added[1] && last[1] && added[0]));
      none_while_whole : assert (!hand_over || whole);
      marked_once : assert (marked_q == (where_q != NONE) && mark1_q == (where_q == FIRST) && (!mark1_q || valid1)
                            && {2'd0, mark_a} + {2'd0, mark_b} + {2'd0, mark_c} + {2'd0, mark_d}
                            <= {2'd0, where_q == QUEUE || where_q == WORK});
      in_the_queue : assert (where_q != QUEUE || ((mark_a && at <= component) || mark_b || mark_c || mark_d));
      only_once : assert (where_q == QUEUE || !(mark_a && at <= component) && !mark_b && !mark_c && !mark_d);
      stays_itself : assert ((where_q != FIRST || x1 == value_q) && (!mark_a || value_at_hand == value_q)
          && (!mark_b || values_q[16*second+:16] == value_q) && (!mark_c || values_q[16*third+:16] == value_q)
          && (!mark_d || values_q[16*fourth+:16] == value_q));
      at_hand : assert (!(mark_a && at != 4'd0 && at <= component) || shifted == value_q);
      of_its_sample : assert ((where_q != FIRST || number_q == base + {2'd0, end_a} + {2'd0, end_b} + {2'd0, end_c} + {2'd0, end_d})
          && (where_q != QUEUE || number_q == base + (mark_a ? 3'd0 : {2'd0, end_a} + (mark_b ? 3'd0 : {2'd0, end_b}
                                                     + (mark_c ? 3'd0 : {2'd0, end_c}))))
          && (where_q != WORK || number_q == sum_no_q));
      on_its_way : assert (where_q == WORK ? {1'b0, added[0] && hit2} + {1'b0, added[1] && hit3_q} + {1'b0, live_q && sum_hit_q} == 2'd1
                                           : !(added[0] && hit2) && !(added[1] && hit3_q) && !(live_q && sum_hit_q));
      product_of_it : assert ((!(added[0] && hit2) || x2 == value_q) && (!added[1] || product == (hit3_q ? {{8{value_q[15]}}, value_q} : 24'd0)));
      added_exactly_once : assert (!live_q || sum == (sum_hit_q ? value : 31'd0));
      none_left_behind : assert (!hand_over || !(where_q == FIRST || where_q == QUEUE) || number_q != sum_no_q);
      sums_of_the_sample : assert ((where_q != OUT || valid) && (!valid || sums[30:0] == (where_q == OUT ? value : 31'd0)));
      waits_unchanged : assert (!waits_q || (valid && sums[30:0] == waited_q));
    end
  end
endmodule

`default_nettype wire
