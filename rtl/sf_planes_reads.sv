// The lines of planes and lines that a position reads, in order, and how much of each it takes.
// Mirror: src/fx/tensorf_lines.c (fx_tensorf_lines); src/fx/tensorf_place.h (vm_find)
//
// A point of a plane or a line has 16 components in a line of the memory, so ceil(components / 16) lines. Order: pair by
// pair (0,1,2), (0,2,1), (1,2,0) of axes (u, v, w): the points (u, v) and (u + 1, v) line by line, (u, v + 1) and
// (u + 1, v + 1), then w and w + 1 of the line; a neighbour without weight is left out. Where points have 1 or 3 lines, those
// of two neighbours lie in the two banks of the cache: both are asked for in one cycle. Else it is a line in every cycle.
//
//   P  Q           the position times res - 1, rounded: point and 8 bits of place per axis
//   1              x, y and the line within the point; 2: y * width, weight; 3: point; 4: times lines of a point; 5: line
`default_nettype none

module sf_planes_reads #(
    parameter integer LOG2_LINES = 6  // that are on their way
) (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    // programming: of density, then of appearance, by pair
    input  wire [ 35:0] res_i,            // grid points per axis, 1..2048
    input  wire [167:0] plane_first_i,    // first line of the planes, 28 bits
    input  wire [167:0] line_first_i,     // of the lines
    input  wire [ 11:0] point_lines_i,    // lines of a point, less 1
    // positions
    input  wire         s_valid_i,
    output wire         s_ready_o,
    input  wire         s_appearance_i,
    input  wire         s_tile_i,         // the cache is emptied before it
    input  wire [ 71:0] s_pos_i,          // {z, y, x}, Q0.24
    // lines of the cache
    output wire         line_valid_o,
    input  wire         line_ready_i,
    output wire         line_empty_o,
    output wire [ 27:0] line0_o,
    output wire [ 27:0] line1_o,          // of the neighbour; the same as line0_o without one
    // of the lines that have come
    input  wire         pop_i,
    output wire [ 16:0] weight0_o,        // of a plane's point Q.16, of a line's Q.8
    output wire [ 16:0] weight1_o,        // 0 without a neighbour
    output wire         of_line_o,        // else of a plane
    output wire         first_o,          // of its block of 16 components
    output wire         last_o,           // the block is whole
    output wire [  1:0] block_o,
    output wire [  1:0] pair_o,
    output wire         appearance_o,
    output wire         end_o             // of the position
);
  localparam [1:0] IDLE = 2'd0, MULTIPLY = 2'd1, ROUND = 2'd2, RUN = 2'd3;
  reg [1:0] state_q;
  reg appearance_q, tile_q;
  reg [71:0] pos_q;
  reg [34:0] scaled_q[0:2];
  reg [10:0] at_q[0:2];
  reg [7:0] g_q[0:2];
  assign s_ready_o = state_q == IDLE;

  // ---- the run of a position
  reg [1:0] pair_q, line_q;
  reg far_q, beside_q, of_line_q;  // y + 1; x + 1, or the second point of the line
  wire [1:0] u = pair_q == 2'd2 ? 2'd1 : 2'd0;
  wire [1:0] v = pair_q == 2'd0 ? 2'd1 : 2'd2;
  wire [1:0] w = pair_q == 2'd0 ? 2'd2 : pair_q == 2'd1 ? 2'd1 : 2'd0;
  wire [1:0] x_axis = of_line_q ? w : u;
  wire [2:0] of = {1'b0, pair_q} + (appearance_q ? 3'd3 : 3'd0);
  wire [1:0] last_line = point_lines_i[2*of+:2];
  wire alone = g_q[x_axis] == 8'd0;
  wire both = !alone && !last_line[0];  // points of 1 or 3 lines
  wire block_end = alone || both || beside_q;
  wire row_end = block_end && line_q == last_line;
  wire part_end = row_end && (of_line_q || far_q || g_q[v] == 8'd0);
  wire pair_end = part_end && of_line_q;
  wire run_end = pair_end && pair_q == 2'd2;
  wire move;
  wire issue = state_q == RUN && move;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) state_q <= IDLE;
    else if (clear_i) state_q <= IDLE;
    else begin
      case (state_q)
        IDLE: if (s_valid_i) state_q <= MULTIPLY;
        MULTIPLY: state_q <= ROUND;
        ROUND: state_q <= RUN;
        default: if (issue && run_end) state_q <= IDLE;
      endcase
    end
  end
  wire [10:0] last_x = res_i[10:0] - 11'd1;
  wire [10:0] last_y = res_i[22:12] - 11'd1;
  wire [10:0] last_z = res_i[34:24] - 11'd1;
  wire [34:0] half = 35'd32768;
  integer axis;
  always_ff @(posedge clk_i) begin
    if (state_q == IDLE) {appearance_q, tile_q, pos_q} <= {s_appearance_i, s_tile_i, s_pos_i};
    scaled_q[0] <= 35'(pos_q[23:0]) * 35'(last_x) + half;
    scaled_q[1] <= 35'(pos_q[47:24]) * 35'(last_y) + half;
    scaled_q[2] <= 35'(pos_q[71:48]) * 35'(last_z) + half;
    if (state_q == ROUND) begin
      for (axis = 0; axis < 3; axis = axis + 1) begin
        at_q[axis] <= scaled_q[axis][34:24];
        g_q[axis] <= scaled_q[axis][23:16];
      end
      {pair_q, line_q, far_q, beside_q, of_line_q} <= 7'd0;
    end else if (issue) begin
      beside_q <= !block_end;
      if (block_end) line_q <= row_end ? 2'd0 : line_q + 2'd1;
      if (row_end) far_q <= !part_end;
      if (part_end) of_line_q <= !of_line_q;
      if (pair_end) pair_q <= pair_q + 2'd1;
    end
  end

  // ---- 1 to 5
  localparam integer TAG = 9;  // {end, appearance, pair, block, last, first, of_line}
  reg [4:0] valid_q;
  reg [4:0] empty_q;
  reg begun_q;  // the first line of the position has been issued
  reg [TAG-1:0] tag1_q, tag2_q, tag3_q, tag4_q, tag5_q;
  reg [2:0] of1_q, of2_q, of3_q;
  reg [1:0] lines4_q;
  reg [10:0] x1_q, y1_q, x2_q;
  reg [11:0] width1_q;
  reg [8:0] a1_q, beside1_q, b1_q;
  reg [33:0] weights2_q, weights3_q, weights4_q, weights5_q;  // of both lines
  reg both1_q, both2_q, both3_q, both4_q;
  reg [22:0] row2_q, point3_q;
  reg [24:0] times4_q;
  reg [27:0] first4_q, line5_q, beside5_q;
  wire [8:0] one = 9'd256;
  wire [7:0] g = g_q[x_axis];
  wire [7:0] h = g_q[v];
  wire [1:0] lines3 = point_lines_i[2*of3_q+:2];
  wire [24:0] point3 = {2'd0, point3_q};
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid_q <= 5'd0;
    else if (clear_i) valid_q <= 5'd0;
    else if (move) valid_q <= {valid_q[3:0], state_q == RUN};
  end
  always_ff @(posedge clk_i) begin
    if (state_q == ROUND) begun_q <= 1'b0;
    else if (issue) begun_q <= 1'b1;
    if (move) begin
      empty_q <= {empty_q[3:0], tile_q && !begun_q};
      // 1
      x1_q <= at_q[x_axis] + {10'd0, beside_q};
      y1_q <= at_q[v] + {10'd0, far_q};
      width1_q <= res_i[12*u+:12];
      a1_q <= beside_q ? {1'b0, g} : one - {1'b0, g};
      beside1_q <= both ? {1'b0, g} : 9'd0;
      both1_q <= both;
      b1_q <= of_line_q ? 9'd1 : far_q ? {1'b0, h} : one - {1'b0, h};
      tag1_q <= {run_end, appearance_q, pair_q, line_q, of_line_q && block_end, !far_q && !beside_q, of_line_q};
      of1_q <= of;
      // 2
      row2_q <= tag1_q[0] ? 23'd0 : 23'(y1_q) * 23'(width1_q);
      x2_q <= x1_q;
      weights2_q <= {17'(beside1_q) * 17'(b1_q), 17'(a1_q) * 17'(b1_q)};
      {tag2_q, of2_q, both2_q} <= {tag1_q, of1_q, both1_q};
      // 3
      point3_q <= row2_q + {12'd0, x2_q};
      {tag3_q, of3_q, weights3_q, both3_q} <= {tag2_q, of2_q, weights2_q, both2_q};
      // 4
      times4_q <= (lines3[0] ^ lines3[1] ? point3 << 1 : lines3 == 2'd3 ? point3 << 2 : point3) + (lines3 == 2'd2 ? point3 : 25'd0);
      first4_q <= (tag3_q[0] ? line_first_i[28*of3_q+:28] : plane_first_i[28*of3_q+:28]) + {26'd0, tag3_q[4:3]};
      {tag4_q, lines4_q, weights4_q, both4_q} <= {tag3_q, lines3, weights3_q, both3_q};
      // 5
      line5_q <= first4_q + {3'd0, times4_q};
      beside5_q <= first4_q + {3'd0, times4_q} + (both4_q ? {26'd0, lines4_q} + 28'd1 : 28'd0);
      {tag5_q, weights5_q} <= {tag4_q, weights4_q};
    end
  end

  // ---- to the cache; what goes along waits for the answer
  reg [LOG2_LINES:0] inside_q;
  reg room_q;
  assign line_valid_o = valid_q[4] && room_q;
  assign line_empty_o = empty_q[4];
  assign line0_o = line5_q;
  assign line1_o = beside5_q;
  wire leaves = line_valid_o && line_ready_i;
  assign move = !valid_q[4] || leaves;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      inside_q <= '0;
      room_q <= 1'b0;
    end else if (clear_i) begin
      inside_q <= '0;
      room_q <= 1'b0;
    end else begin
      if (leaves != pop_i) inside_q <= leaves ? inside_q + 1'b1 : inside_q - 1'b1;
      room_q <= inside_q < (LOG2_LINES + 1)'((1 << LOG2_LINES) - 2);
    end
  end
  wire tag_valid;
  sf_fifo #(
      .WIDTH     (TAG + 34),
      .LOG2_DEPTH(LOG2_LINES)
  ) u_tags (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (leaves),
      .data_i ({tag5_q, weights5_q}),
      .valid_o(tag_valid),
      .pop_i  (pop_i),
      .data_o ({end_o, appearance_o, pair_o, block_o, last_o, first_o, of_line_o, weight1_o, weight0_o})
  );
  wire unused_ok = &{1'b0, tag_valid, res_i[35], res_i[23], res_i[11], scaled_q[0][15:0], scaled_q[1][15:0],
                     scaled_q[2][15:0]};
endmodule

`default_nettype wire
