// Samples of rays between the density and the decoder, whatever their weights and however reads, answers and the compositor
// wait. Every sample whose density was asked for is decided on exactly once, in order; it becomes one item for the compositor,
// or none once its ray has ended. An appearance is read once for each item that is marked as decoded, before the next sample is
// decided on, and for nothing else. Every ray has one first and one last item and nothing behind it. Densities run ahead by five,
// no queue runs over, and the weights of a ray and the light that is left add up to 2^20.
// Products and exponentials are any, but the light that is left never grows (exp_neg_one, mul_steps). A queue holds what was put
// in, in order (fifo_once); here it only counts, and the flags of the words are kept by the property.
`default_nettype none

`include "tests/formal/counting_fifo.svh"

module sf_mul_28x25 (
    input  wire        clk_i,
    input  wire [27:0] a_i,
    input  wire [24:0] b_i,
    input  wire        of_tau_i,
    output wire [52:0] product_o
);
  (* anyseq *) wire [52:0] product;
  assign product_o = product;
endmodule

module sf_exp_neg (
    input  wire        clk_i,
    input  wire [36:0] tau_i,
    output wire [20:0] e_o
);
  (* anyseq *) wire [20:0] e;
  assign e_o = e;
endmodule

module light_once (
    input wire clk_i,
    input wire clear_i,
    input wire enable_i,
    input wire valid_i,
    input wire first_i,
    input wire last_i,
    input wire empty_i,
    input wire tile_i,
    input wire read_ready_i,
    input wire sigma_valid_i,
    input wire take_i
);
  localparam [1:0] IDLE = 2'd0, DECIDE = 2'd2, APPEARANCE = 2'd3;
  localparam [21:0] ONE = 22'd1 << sf_arch_pkg::TRANS_FRAC;
  (* anyconst *) wire [19:0] trans_stop, weight_stop;
  (* anyconst *) wire [10:0] max_samples;
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire ready, error_order, read_valid, read_appearance, read_tile, valid, idle;
  wire asked, goes, keep, keep_empty, decoded, ends, inside, drop, broken, ended, head_first, head_last;
  wire [1:0] state;
  wire [2:0] waiting;
  wire [6:0] items, n_waiting, n_lengths, n_exps, n_items;
  wire [20:0] full, weight, light;
  wire [10:0] samples;
  wire [9:0] none;
  wire [52:0] product;
  wire [11:0] coming;
  wire held, held_first, held_last;
  wire [24:0] item;  // {first, last, empty, decoded, weight}
  sf_light u_dut (
      .clk_i            (clk_i),
      .rst_ni           (rst_n_q),
      .clear_i          (clear_i),
      .enable_i         (enable_i),
      .trans_stop_i     (trans_stop),
      .max_samples_i    (max_samples),
      .weight_stop_i    (weight_stop),
      .valid_i          (valid_i),
      .ready_o          (ready),
      .first_i          (first_i),
      .last_i           (last_i),
      .empty_i          (empty_i),
      .tile_i           (tile_i),
      .pos_i            (72'd0),
      .dir_i            (48'd0),
      .delta_i          (25'd0),
      .distance_i       (44'd0),
      .error_order_o    (error_order),
      .read_valid_o     (read_valid),
      .read_ready_i     (read_ready_i),
      .read_appearance_o(read_appearance),
      .read_tile_o      (read_tile),
      .sigma_valid_i    (sigma_valid_i),
      .sigma_i          (28'd0),
      .valid_o          (valid),
      .take_i           (take_i),
      .idle_o           (idle),
      .look_flags_o     ({asked, goes, keep, keep_empty, decoded, ends, inside, drop, broken, ended, head_first, head_last}),
      .look_state_o     (state),
      .look_waiting_o   (waiting),
      .look_items_o     (items),
      .look_light_o     ({full, weight, light, none, samples}),
      .look_product_o   (product),
      .look_coming_o    (coming),
      .look_counts_o    ({n_waiting, n_lengths, n_exps, n_items}),
      .look_held_o      ({held, held_first, held_last}),
      .look_item_o      (item)
  );

  // ---- the samples that are on their way, all of one ray: flags as they were asked for, oldest at `oldest_q`
  reg [2:0] newest_q = 3'd0, oldest_q = 3'd0;  // behind the newest
  reg [7:0] first_q, last_q;
  reg kept_q = 1'b0;        // an item of the ray has been given
  reg gone_q = 1'b0;        // and the sample is done with
  reg last_asked_q = 1'b0;  // its last was asked for
  reg first_taken_q;        // flags of the beat at hand
  reg last_taken_q;
  always @(posedge clk_i) begin
    if (ready && valid_i) {first_taken_q, last_taken_q} <= {first_i, last_i};
    if (!rst_n_q || clear_i) begin
      {newest_q, oldest_q} <= 6'd0;
      {kept_q, gone_q, last_asked_q} <= 3'd0;
    end else begin
      if (asked) begin
        newest_q <= newest_q + 3'd1;
        first_q[newest_q] <= first_taken_q;
        last_q[newest_q] <= last_taken_q;
        last_asked_q <= last_taken_q;
      end
      if (goes) oldest_q <= oldest_q + 3'd1;
      if (asked && first_taken_q) {kept_q, gone_q} <= 2'd0;
      else {kept_q, gone_q} <= {kept_q || keep, gone_q || goes};
    end
  end
  wire [2:0] behind = newest_q - 3'd1;
  reg flags_ok;
  integer i;
  always @* begin
    flags_ok = 1'b1;
    for (i = 0; i < 8; i = i + 1) begin
      if (3'(i) - oldest_q < waiting) begin
        if (first_q[i] != (3'(i) == oldest_q && !gone_q)) flags_ok = 1'b0;
        if (last_q[i] != (3'(i) == behind && last_asked_q)) flags_ok = 1'b0;
      end
    end
  end

  // ---- items: of a ray that has begun and not ended; appearances that are owed; weights of the ray
  wire push = keep || keep_empty;
  wire begins = keep_empty || head_first;
  wire closes = keep_empty || head_last || ends;
  wire appearance = read_valid && read_ready_i && read_appearance;
  reg open_q = 1'b0, owed_q = 1'b0;
  reg [21:0] given_q;
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) {open_q, owed_q} <= 2'd0;
    else begin
      if (push) open_q <= !closes;
      owed_q <= (owed_q && !appearance) || (keep && decoded);
    end
    if (keep) given_q <= (head_first ? 22'd0 : given_q) + {1'b0, weight};
  end

  reg cleared_q = 1'b0;
  always @(posedge clk_i) cleared_q <= clear_i;

  wire [6:0] on_their_way = {6'd0, coming[0]} + {6'd0, coming[1]} + {6'd0, coming[2]} + {6'd0, coming[3]} + {6'd0, coming[4]}
      + {6'd0, coming[5]} + {6'd0, coming[6]} + {6'd0, coming[7]} + {6'd0, coming[8]} + {6'd0, coming[9]} + {6'd0, coming[10]}
      + {6'd0, coming[11]};
  wire of_a_ray = inside || waiting > (state == APPEARANCE ? 3'd1 : 3'd0);  // a ray has samples that are not decided on
  wire [10:0] most = max_samples == 11'd0 ? 11'd1 : max_samples;
  always @* begin
    assume (!sigma_valid_i || n_lengths != 7'd0);  // sf_planes: an answer for each density
    assume (!take_i || valid);
    assume (product <= {12'd0, full, 20'd0});
    if (n_waiting != 7'd0) assume (head_first == first_q[oldest_q] && head_last == last_q[oldest_q]);  // fifo_once
    if (!rst_n_q) at_reset : assert ({newest_q, oldest_q, kept_q, gone_q, last_asked_q, open_q, owed_q} == 11'd0);
    else begin
      ahead_by_five : assert (waiting <= 3'd6);
      looks_ahead_first : assert (!keep || !(inside && !drop) || waiting == 3'd6);
      counts : assert (n_waiting == {4'd0, waiting} && newest_q - oldest_q == waiting && n_items == items);
      none_lost_on_the_way : assert (n_lengths <= 7'd6 && n_exps <= 7'd6 && n_lengths + on_their_way + n_exps == n_waiting);
      room_for_items : assert (items <= 7'd64 && (!push || items < 7'd64));
      beat_at_hand : assert (!held || (held_first == first_taken_q && held_last == last_taken_q));
      decided_on_once : assert (!goes || (n_waiting != 7'd0 && n_exps != 7'd0));
      at_hand : assert (state == IDLE || n_exps != 7'd0);
      kept_before_its_appearance : assert (state == APPEARANCE ? kept_q : kept_q == gone_q);
      flags : assert (flags_ok);
      one_ray_at_a_time : assert (!(asked && first_taken_q) || waiting == 3'd0);
      item_only_of_a_sample : assert (!keep || (goes || decoded));
      item_says_so : assert (!push || item == (keep_empty ? {4'b1110, 21'd0} : {begins, closes, 1'b0, decoded, weight}));
      a_density_is_one_read : assert (asked == (read_valid && read_ready_i && !read_appearance));
      first_opens : assert (!push || begins == !open_q);
      open_until_the_last : assert (open_q == (kept_q && !drop && of_a_ray));
      ends_once : assert (kept_q ? drop == ended || !of_a_ray : !drop);
      begun_with_a_sample : assert (!inside || waiting != 3'd0 || gone_q);
      more_may_come : assert (drop || (inside ? !last_asked_q : last_asked_q || waiting == 3'd0));
      appearance_of_the_decoded : assert (owed_q == (state == APPEARANCE) && (!appearance || owed_q) && !(keep && owed_q));
      weight_within_the_light : assert (state != DECIDE || weight <= full);
      conserves_one : assert (!kept_q || given_q + {1'b0, light} == ONE);
      at_most : assert (!kept_q || (samples <= most && (drop || !of_a_ray || samples < max_samples)));
      cleared : assert (!cleared_q || (!held && idle && !broken && state == IDLE));
      idle_means_nothing : assert (!idle || (n_waiting == 7'd0 && n_items == 7'd0 && !owed_q));
    end
  end
endmodule

`default_nettype wire
