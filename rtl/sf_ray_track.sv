// Samples of rays in: their positions go on to the encoder, and what only the compositor needs waits here, in order,
// for the sample's density and colour. Once the compositor has stopped the ray that is coming in, the rest of it is
// dropped here; the compositor swallows those of its samples that are inside already.
`default_nettype none

module sf_ray_track (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        enable_i,
    // samples
    input  wire        valid_i,
    output wire        ready_o,
    input  wire        first_i,
    input  wire        last_i,
    input  wire        empty_i,         // a ray without samples: no position, no density
    input  wire        tile_i,          // the first ray of a tile
    input  wire [71:0] pos_i,
    input  wire [47:0] dir_i,
    input  wire [24:0] delta_i,
    input  wire [43:0] distance_i,
    output wire        error_order_o,
    // to the encoder
    output wire        encode_valid_o,
    input  wire        encode_ready_i,
    output wire        encode_first_o,
    output wire        encode_tile_o,   // the first sample since a ray of a new tile began
    output wire [71:0] encode_pos_o,
    output wire [47:0] encode_dir_o,
    // to the compositor, with the result of the sample
    output wire        valid_o,
    input  wire        take_i,
    output wire        first_o,
    output wire        last_o,
    output wire        empty_o,
    output wire [24:0] delta_o,
    output wire [43:0] distance_o,
    input  wire        stop_i,          // of the ray whose sample was taken last
    output wire        idle_o
);
  // As many samples as encoder, nets and streams hold between them, and a few more: a full store only stalls the input.
  localparam integer DEPTH = 16;

  // ---- input: a beat waits in a register, so that its sender need not know who has room behind it
  reg held_q, first_q, last_q, empty_q, in_tile_q;
  reg [71:0] pos_q;
  reg [47:0] dir_q;
  reg [24:0] delta_q;
  reg [43:0] distance_q;
  wire taken, swallows;
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

  reg inside_q;   // the next sample belongs to the same ray as the last one
  reg drop_q;     // and is not needed
  reg broken_q;
  reg tile_q;     // a tile has begun, and the encoder has none of its samples yet
  reg [4:0] ray_q, composed_q;  // rays are told apart by their number: fewer than 32 are inside
  wire bad = inside_q ? first_q || empty_q : !first_q || (empty_q && !last_q);
  reg [4:0] write_q, read_q;
  wire full = write_q - read_q == 5'(DEPTH);
  wire drop = inside_q && drop_q;
  wire room = !full && encode_ready_i;
  assign swallows = broken_q || drop;
  assign taken = swallows || room;
  wire beat = held_q && !broken_q && (drop || room);
  assign error_order_o = beat && bad;
  wire accept = beat && !bad && !drop;
  wire [4:0] ray = first_q ? ray_q + 5'd1 : ray_q;
  wire stop_here = stop_i && composed_q == ray_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {inside_q, drop_q, broken_q, tile_q} <= 4'd0;
      {ray_q, write_q, read_q} <= 15'd0;
    end else if (clear_i) begin
      {inside_q, drop_q, broken_q, tile_q} <= 4'd0;
      {ray_q, write_q, read_q} <= 15'd0;
    end else begin
      if (error_order_o) broken_q <= 1'b1;
      if (beat && !bad) inside_q <= !last_q;
      if (accept && first_q) ray_q <= ray;
      drop_q <= !(accept && first_q) && (stop_here || drop_q);
      if (accept) tile_q <= encode_tile_o && empty_q;
      if (accept) write_q <= write_q + 5'd1;
      if (take_i) read_q <= read_q + 5'd1;
    end
  end
  assign encode_valid_o = accept && !empty_q;
  assign encode_first_o = first_q;
  assign encode_tile_o = tile_q || (first_q && in_tile_q);
  assign encode_pos_o = pos_q;
  assign encode_dir_o = dir_q;

  // ---- beside the nets
  reg [76:0] store[0:DEPTH-1];
  wire [76:0] head = store[read_q[3:0]];
  wire [4:0] head_ray;
  always_ff @(posedge clk_i) begin
    if (accept) store[write_q[3:0]] <= {ray, empty_q, last_q, first_q, distance_q, delta_q};
    if (take_i) composed_q <= head_ray;
  end
  assign valid_o = write_q != read_q;
  assign {head_ray, empty_o, last_o, first_o, distance_o, delta_o} = head;
  assign idle_o = !valid_o && (!held_q || broken_q);
endmodule

`default_nettype wire
