// Samples of rays to weights, where densities alone decide which samples are decoded and where a ray ends.
// Mirror: src/fx/render.c (fx_tensorf_weight, render_tensorf)
//
// One sample after the other: its density is asked for, its weight follows 17 cycles after that, and then, if it has one,
// its appearance: the order in which the core reads the field. The rest of a ray that has ended is dropped.
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
  localparam integer LOG2_ITEMS = 5;

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

  // ---- a sample at a time
  localparam [2:0] IDLE = 3'd0, DENSITY = 3'd1, WAIT = 3'd2, WEIGH = 3'd3, KEEP = 3'd4, APPEARANCE = 3'd5;
  reg [2:0] state_q;
  reg [4:0] at_q;  // cycles in WEIGH
  reg room_q;
  wire bad = inside_q ? first_q || empty_q : !first_q || (empty_q && !last_q);
  wire begin_sample = state_q == IDLE && held_q && !swallows && !bad && room_q;
  assign error_order_o = state_q == IDLE && held_q && !broken_q && bad;
  wire keep = (begin_sample && empty_q) || state_q == KEEP;
  wire decoded, ends;
  wire sample_end = (state_q == KEEP && !decoded) || (state_q == APPEARANCE && read_ready_i);
  assign taken = (state_q == IDLE && held_q && swallows) || (begin_sample && empty_q) || sample_end;
  assign read_valid_o = state_q == DENSITY || state_q == APPEARANCE;
  assign read_appearance_o = state_q == APPEARANCE;
  assign read_tile_o = state_q == DENSITY && tile_q;
  assign read_pos_o = pos_q;
  assign read_dir_o = ray_dir_q;
  wire [4:0] last_cycle = 5'd16;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      at_q <= 5'd0;
      {inside_q, drop_q, broken_q, tile_q} <= 4'd0;
    end else if (clear_i) begin
      state_q <= IDLE;
      at_q <= 5'd0;
      {inside_q, drop_q, broken_q, tile_q} <= 4'd0;
    end else begin
      if (error_order_o) broken_q <= 1'b1;
      case (state_q)
        IDLE: if (begin_sample && !empty_q) state_q <= DENSITY;
        DENSITY: if (read_ready_i) state_q <= WAIT;
        WAIT: if (sigma_valid_i) state_q <= WEIGH;
        WEIGH: if (at_q == last_cycle) state_q <= KEEP;
        KEEP: state_q <= decoded ? APPEARANCE : IDLE;
        default: if (read_ready_i) state_q <= IDLE;
      endcase
      at_q <= state_q == WEIGH ? at_q + 5'd1 : 5'd0;
      if (begin_sample && first_q) tile_q <= tile_q || in_tile_q;
      else if (state_q == DENSITY && read_ready_i) tile_q <= 1'b0;
      if (taken && !broken_q) inside_q <= !last_q;
      if (begin_sample) drop_q <= 1'b0;
      else if (state_q == KEEP && ends) drop_q <= 1'b1;
    end
  end
  always_ff @(posedge clk_i) if (begin_sample && first_q) ray_dir_q <= dir_q;

  // ---- density times length, its exponential times the light that is left
  reg [20:0] transmittance_q, weight_q;
  reg [10:0] samples_q;
  reg [27:0] sigma_q;
  wire [52:0] product;
  wire [20:0] e;
  wire attenuate = at_q == 5'd12;
  sf_mul_28x25 u_mul (
      .clk_i    (clk_i),
      .a_i      (attenuate ? {7'd0, transmittance_q} : sigma_q),
      .b_i      (attenuate ? {4'd0, e} : delta_q),
      .of_tau_i (at_q == 5'd0),
      .product_o(product)
  );
  sf_exp_neg u_exp_neg (
      .clk_i(clk_i),
      .tau_i(product[52:16]),
      .e_o  (e)
  );
  reg decoded_q, ends_q;
  wire [20:0] lost = transmittance_q - product[40:20] - {20'd0, product[19]};
  wire [20:0] left = transmittance_q - weight_q;
  wire [10:0] more = samples_q + {10'd0, weight_q > {1'b0, weight_stop_i}};
  always_ff @(posedge clk_i) begin
    if (sigma_valid_i) sigma_q <= sigma_i;
    if (at_q == 5'd15) weight_q <= lost;
    if (at_q == 5'd16) begin
      transmittance_q <= left;
      samples_q <= more;
      decoded_q <= weight_q > {1'b0, weight_stop_i};
      ends_q <= left <= {1'b0, trans_stop_i} || more >= max_samples_i;
    end
    if (begin_sample && first_q) begin
      transmittance_q <= 21'd1 << 20;
      samples_q <= 11'd0;
    end
  end
  assign decoded = decoded_q;
  assign ends = ends_q;

  // ---- to the compositor
  reg [LOG2_ITEMS:0] items_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      items_q <= '0;
      room_q <= 1'b0;
    end else if (clear_i) begin
      items_q <= '0;
      room_q <= 1'b0;
    end else begin
      if (keep != take_i) items_q <= keep ? items_q + 1'b1 : items_q - 1'b1;
      room_q <= items_q < (LOG2_ITEMS + 1)'((1 << LOG2_ITEMS) - 1) && !keep;
    end
  end
  sf_fifo #(
      .WIDTH     (69),
      .LOG2_DEPTH(LOG2_ITEMS)
  ) u_items (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (keep),
      .data_i ({first_q, last_q || (ends && !empty_q), empty_q, decoded && !empty_q, weight_q, distance_q}),
      .valid_o(valid_o),
      .pop_i  (take_i),
      .data_o ({first_o, last_o, empty_o, decoded_o, weight_o, distance_o})
  );
  assign idle_o = !valid_o && state_q == IDLE && (!held_q || broken_q);
  wire unused_ok = &{1'b0, product[15:0]};
endmodule

`default_nettype wire
