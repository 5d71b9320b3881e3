// Samples of rays to weights, where densities alone decide which samples are decoded and where a ray ends.
// Mirror: src/fx/render.c (fx_tensorf_weight, render_tensorf)
//
// Densities run ahead: of each ray the next AHEAD of them are read before a sample's weight is looked at and, if it has
// one, its appearance is read. That is the core's order (src/fx/cache.h). Densities become exp(-density * length) as they
// come; the light that is left is multiplied by one after the other. The rest of a ray that has ended is dropped.
`default_nettype none

module sf_light (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        enable_i,
    // programming
    input  wire [19:0] trans_stop_i,
    input  wire [10:0] max_samples_i,
    input  wire [19:0] weight_stop_i,
    // samples: as sf_ray_track
    input  wire        valid_i,
    output wire        ready_o,
    input  wire        first_i,
    input  wire        last_i,
    input  wire        empty_i,
    input  wire        tile_i,
    input  wire [71:0] pos_i,
    input  wire [47:0] dir_i,
    input  wire [24:0] delta_i,
    input  wire [43:0] distance_i,
    output wire        error_order_o,
    // to the planes: densities, and appearances of what has a weight
    output wire        read_valid_o,
    input  wire        read_ready_i,
    output wire        read_appearance_o,
    output wire        read_tile_o,       // the first since a ray of a new tile began
    output wire [71:0] read_pos_o,
    output wire [47:0] read_dir_o,
    input  wire        sigma_valid_i,     // answers, one for each density
    input  wire [27:0] sigma_i,
    // to the compositor
    output wire        valid_o,
    input  wire        take_i,
    output wire        first_o,
    output wire        last_o,            // where the ray ends
    output wire        empty_o,
    output wire        decoded_o,         // its colour comes from the decoder
    output wire [20:0] weight_o,
    output wire [43:0] distance_o,
    output wire        idle_o
);
  localparam integer AHEAD = 5;  // FX_AHEAD
  localparam integer LOG2_ITEMS = 6, LOG2_AHEAD = 3;
  localparam integer EXP_CYCLES = 12;  // product and exponential

  // ---- input: a beat waits in a register
  reg held_q, first_q, last_q, empty_q, in_tile_q;
  reg [71:0] pos_q;
  reg [47:0] dir_q;
  reg [24:0] delta_q;
  reg [43:0] distance_q;
  reg inside_q, drop_q, broken_q, tile_q;  // as in sf_ray_track
  reg [47:0] ray_dir_q;                    // of the first sample
  wire taken;
  wire swallows = broken_q || (inside_q && drop_q);
  assign ready_o = !held_q && (enable_i || swallows);
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) held_q <= 1'b0;
    else if (clear_i) held_q <= 1'b0;
    else held_q <= held_q ? !taken : valid_i && ready_o;
  end
  always_ff @(posedge clk_i) begin
    if (!held_q) begin
      {first_q, last_q, empty_q, in_tile_q} <= {first_i, last_i, empty_i, tile_i};
      {pos_q, dir_q, delta_q, distance_q} <= {pos_i, dir_i, delta_i, distance_i};
    end
  end

  // ---- turns: a density while the ray has more and fewer than AHEAD are on their way behind the oldest; else the oldest
  localparam [1:0] IDLE = 2'd0, MULTIPLY = 2'd1, DECIDE = 2'd2, APPEARANCE = 2'd3;
  reg [1:0] state_q;       // of the oldest
  reg [1:0] at_q;          // cycles in MULTIPLY
  reg [2:0] waiting_q;     // samples whose density was asked for
  reg room_q;
  wire unfinished = inside_q && !drop_q;
  wire density_turn = unfinished ? waiting_q <= 3'(AHEAD) : waiting_q == 3'd0;
  wire bad = inside_q ? first_q || empty_q : !first_q || (empty_q && !last_q);
  wire good = held_q && !swallows && !bad && density_turn;
  wire keep_empty = good && empty_q && room_q;
  wire ask = good && !empty_q;
  wire asked = ask && read_ready_i && state_q != APPEARANCE;
  assign error_order_o = held_q && !broken_q && bad && (drop_q || density_turn);
  assign taken = (held_q && swallows) || keep_empty || asked;

  wire ended, ends, decoded, e_valid;
  wire decide = state_q == DECIDE && !density_turn && room_q;
  wire keep = decide && !ended;
  wire goes = (decide && (ended || !decoded)) || (state_q == APPEARANCE && read_ready_i);
  assign read_valid_o = ask || state_q == APPEARANCE;
  assign read_appearance_o = state_q == APPEARANCE;
  assign read_tile_o = state_q != APPEARANCE && (tile_q || (first_q && in_tile_q));
  assign read_dir_o = ray_dir_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      at_q <= 2'd0;
      waiting_q <= 3'd0;
      {inside_q, drop_q, broken_q, tile_q} <= 4'd0;
    end else if (clear_i) begin
      state_q <= IDLE;
      at_q <= 2'd0;
      waiting_q <= 3'd0;
      {inside_q, drop_q, broken_q, tile_q} <= 4'd0;
    end else begin
      if (error_order_o) broken_q <= 1'b1;
      case (state_q)
        IDLE: if (e_valid) state_q <= MULTIPLY;
        MULTIPLY: if (at_q == 2'd3) state_q <= DECIDE;
        DECIDE: if (decide) state_q <= ended || !decoded ? IDLE : APPEARANCE;
        default: if (read_ready_i) state_q <= IDLE;
      endcase
      at_q <= state_q == MULTIPLY ? at_q + 2'd1 : 2'd0;
      if (asked != goes) waiting_q <= asked ? waiting_q + 3'd1 : waiting_q - 3'd1;
      if (keep_empty) tile_q <= tile_q || in_tile_q;
      else if (asked) tile_q <= 1'b0;
      if (taken && !broken_q) inside_q <= !last_q;
      if ((asked || keep_empty) && first_q) drop_q <= 1'b0;
      else if (keep && ends) drop_q <= 1'b1;
    end
  end
  always_ff @(posedge clk_i) if (asked && first_q) ray_dir_q <= dir_q;

  // ---- what waits for a weight; what waits for a density
  wire head_valid, head_first, head_last, length_valid;
  wire [71:0] head_pos;
  wire [43:0] head_distance;
  wire [24:0] length;
  sf_fifo #(
      .WIDTH     (118),
      .LOG2_DEPTH(LOG2_AHEAD)
  ) u_waiting (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (asked),
      .data_i ({first_q, last_q, pos_q, distance_q}),
      .valid_o(head_valid),
      .pop_i  (goes),
      .data_o ({head_first, head_last, head_pos, head_distance})
  );
  sf_fifo #(
      .WIDTH     (25),
      .LOG2_DEPTH(LOG2_AHEAD)
  ) u_lengths (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (asked),
      .data_i (delta_q),
      .valid_o(length_valid),
      .pop_i  (sigma_valid_i),
      .data_o (length)
  );
  assign read_pos_o = state_q == APPEARANCE ? head_pos : pos_q;

  // ---- exp(-density * length)
  wire [52:0] depth;
  wire [20:0] e_now, e;
  reg [EXP_CYCLES-1:0] coming_q;
  sf_mul_28x25 u_depth (
      .clk_i    (clk_i),
      .a_i      (sigma_i),
      .b_i      (length),
      .of_tau_i (1'b1),
      .product_o(depth)
  );
  sf_exp_neg u_exp_neg (
      .clk_i(clk_i),
      .tau_i(depth[52:16]),
      .e_o  (e_now)
  );
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) coming_q <= '0;
    else if (clear_i) coming_q <= '0;
    else coming_q <= {coming_q[EXP_CYCLES-2:0], sigma_valid_i};
  end
  sf_fifo #(
      .WIDTH     (21),
      .LOG2_DEPTH(LOG2_AHEAD)
  ) u_exps (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (coming_q[EXP_CYCLES-1]),
      .data_i (e_now),
      .valid_o(e_valid),
      .pop_i  (goes),
      .data_o (e)
  );

  // ---- the light that is left, and what this sample takes of it
  reg [20:0] transmittance_q, weight_q;
  reg [10:0] samples_q;
  reg ended_q;  // the ray, at a sample before this one
  wire [20:0] full = head_first ? 21'd1 << 20 : transmittance_q;
  wire [10:0] fewer = head_first ? 11'd0 : samples_q;
  wire [52:0] product;
  sf_mul_28x25 u_left (
      .clk_i    (clk_i),
      .a_i      ({7'd0, full}),
      .b_i      ({4'd0, e}),
      .of_tau_i (1'b0),
      .product_o(product)
  );
  wire [20:0] lost = full - product[40:20] - {20'd0, product[19]};
  wire [20:0] left = full - weight_q;
  assign decoded = weight_q > {1'b0, weight_stop_i};
  wire [10:0] more = fewer + {10'd0, decoded};
  assign ends = left <= {1'b0, trans_stop_i} || more >= max_samples_i;
  assign ended = ended_q && !head_first;
  always_ff @(posedge clk_i) begin
    if (at_q == 2'd3) weight_q <= lost;
    if (keep) begin
      transmittance_q <= left;
      samples_q <= more;
      ended_q <= ends;
    end
  end

  // ---- to the compositor
  wire push = keep || keep_empty;
  reg [LOG2_ITEMS:0] items_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      items_q <= '0;
      room_q <= 1'b0;
    end else if (clear_i) begin
      items_q <= '0;
      room_q <= 1'b0;
    end else begin
      if (push != take_i) items_q <= push ? items_q + 1'b1 : items_q - 1'b1;
      room_q <= items_q < (LOG2_ITEMS + 1)'((1 << LOG2_ITEMS) - 1) && !push;
    end
  end
  sf_fifo #(
      .WIDTH     (69),
      .LOG2_DEPTH(LOG2_ITEMS)
  ) u_items (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (push),
      .data_i (keep_empty ? {3'b111, 1'b0, 21'd0, 44'd0} : {head_first, head_last || ends, 1'b0, decoded, weight_q, head_distance}),
      .valid_o(valid_o),
      .pop_i  (take_i),
      .data_o ({first_o, last_o, empty_o, decoded_o, weight_o, distance_o})
  );
  assign idle_o = !valid_o && waiting_q == 3'd0 && (!held_q || broken_q);
  wire unused_ok = &{1'b0, product[52:41], product[18:0], depth[15:0], head_valid, length_valid};
endmodule

`default_nettype wire
