// The lines that positions read from planes and lines, for any sizes and programming, however the cache, its answers and the
// positions wait. Every line that a position needs is asked for exactly once, none that it does not need is, and they come in
// order, the end of a position with its last line and before the next position. Each has its own address, of points within
// the programmed sizes, its weights and its tag, and the cache is emptied before the first line of a tile alone. There is
// always a place for what waits for an answer. Position and line looked at are any.
// A line is told by its key {pair, of a line, far, block, beside}: the order of the keys is the order of the lines.
`default_nettype none

module planes_reads_once (
    input wire         clk_i,
    input wire         clear_i,
    input wire         s_valid_i,
    input wire         s_appearance_i,
    input wire         s_tile_i,
    input wire         line_ready_i,
    input wire         pop_i,
    input wire [104:0] look_products_i,  // position times size - 1, of x, y, z
    input wire [ 22:0] look_row_i        // y times width
);
  (* anyconst *) wire [35:0] res;
  (* anyconst *) wire [167:0] plane_first, line_first;
  (* anyconst *) wire [11:0] point_lines;
  (* anyconst *) wire [2:0] number;   // of the position looked at, modulo 8
  (* anyconst *) wire [6:0] watched;  // key of the line looked at
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire ready, line_valid, line_empty;
  wire [27:0] line0, line1;
  wire [32:0] at;
  wire [23:0] g;
  wire [10:0] y1;
  wire [11:0] width1;
  wire [6:0] key;  // of the line that the run is at
  wire appearance;
  wire [4:0] valid;
  sf_planes_reads u_dut (
      .clk_i          (clk_i),
      .rst_ni         (rst_n_q),
      .clear_i        (clear_i),
      .res_i          (res),
      .plane_first_i  (plane_first),
      .line_first_i   (line_first),
      .point_lines_i  (point_lines),
      .s_valid_i      (s_valid_i),
      .s_ready_o      (ready),
      .s_appearance_i (s_appearance_i),
      .s_tile_i       (s_tile_i),
      .s_pos_i        (72'd0),
      .line_valid_o   (line_valid),
      .line_ready_i   (line_ready_i),
      .line_empty_o   (line_empty),
      .line0_o        (line0),
      .line1_o        (line1),
      .pop_i          (pop_i),
      .look_products_i(look_products_i),
      .look_row_i     (look_row_i),
      .look_at_o      (at),
      .look_g_o       (g),
      .look_y1_o      (y1),
      .look_width1_o  (width1),
      .look_key_o     (key),
      .look_appearance_o(appearance),
      .look_valid_o   (valid)
  );
  wire [1:0] peek_state_q;
  wire peek_tile_q, peek_begun_q, peek_run_end, peek_room_q;
  wire [6:0] peek_inside_q;
  wire [4:0] peek_empty_q;
  wire [8:0] peek_tag1_q, peek_tag2_q, peek_tag3_q, peek_tag4_q, peek_tag5_q;
  wire [2:0] peek_of1_q, peek_of2_q, peek_of3_q;
  wire [1:0] peek_lines4_q;
  wire [10:0] peek_x1_q, peek_x2_q;
  wire [33:0] peek_weights2_q, peek_weights3_q, peek_weights4_q, peek_weights5_q;
  wire peek_both1_q, peek_both2_q, peek_both3_q, peek_both4_q;
  wire [8:0] peek_a1_q, peek_b1_q, peek_beside1_q;
  wire [22:0] peek_row2_q, peek_point3_q;
  wire [24:0] peek_times4_q;
  wire [27:0] peek_first4_q, peek_line5_q, peek_beside5_q;
  localparam [1:0] IDLE = 2'd0, ROUND = 2'd2, RUN = 2'd3;
  wire run = peek_state_q == RUN;
  wire leaves = line_valid && line_ready_i;
  wire move = !valid[4] || leaves;
  wire issue = run && move;

  // ---- what a position needs: axes of its pairs are (0,1,2), (0,2,1), (1,2,0)
  wire of_line = key[4], far = key[3], beside = key[0];
  function [7:0] place(input [1:0] axis, input [23:0] all);
    place = axis == 2'd0 ? all[7:0] : axis == 2'd1 ? all[15:8] : all[23:16];
  endfunction
  function [10:0] point(input [1:0] axis, input [32:0] all);
    point = axis == 2'd0 ? all[10:0] : axis == 2'd1 ? all[21:11] : all[32:22];
  endfunction
  function [11:0] size(input [1:0] axis, input [35:0] all);
    size = axis == 2'd0 ? all[11:0] : axis == 2'd1 ? all[23:12] : all[35:24];
  endfunction
  function [1:0] x_axis(input [6:0] k);
    x_axis = !k[4] ? {1'b0, k[6]} : k[6] ? 2'd0 : k[5] ? 2'd1 : 2'd2;
  endfunction
  function [1:0] y_axis(input [6:0] k);
    y_axis = k[6:5] == 2'd0 ? 2'd1 : 2'd2;
  endfunction
  function [1:0] last_block(input [6:0] k, input appearance, input [11:0] all);
    last_block = !appearance ? (k[6] ? all[5:4] : k[5] ? all[3:2] : all[1:0]) : k[6] ? all[11:10] : k[5] ? all[9:8] : all[7:6];
  endfunction
  // Points of an odd number of lines have their neighbour with them.
  function needed(input [6:0] k, input appearance, input [23:0] all_g, input [11:0] all_lines);
    needed = k[6:5] != 2'd3 && k[2:1] <= last_block(k, appearance, all_lines)
        && (!k[3] || (!k[4] && place(y_axis(k), all_g) != 8'd0))
        && (!k[0] || (place(x_axis(k), all_g) != 8'd0 && last_block(k, appearance, all_lines) & 2'd1) != 1'b0);
  endfunction

  // ---- lines from the run to the cache: position and key, of the newest one where a stage has none; the last one that left
  reg [2:0] position_q = 3'd0;
  reg [10:0] line1_q = 11'd1, line2_q = 11'd1, line3_q = 11'd1, line4_q = 11'd1, line5_q = 11'd1;
  reg [10:0] left_q = 11'd1;  // {position, key, end}
  wire [10:0] line_now = {position_q, key, peek_run_end};
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) begin
      {line1_q, line2_q, line3_q, line4_q, line5_q, left_q} <= {6{11'd1}};
      position_q <= 3'd0;
    end else begin
      if (peek_state_q == ROUND) position_q <= position_q + 3'd1;
      if (issue) line1_q <= line_now;
      if (move) {line2_q, line3_q, line4_q, line5_q} <= {line1_q, line2_q, line3_q, line4_q};
      if (leaves) left_q <= line5_q;
    end
  end
  function follows(input there, input [10:0] older, input [10:0] newer);
    follows = !there ? newer == older
        : older[0] ? newer[10:8] == older[10:8] + 3'd1 : newer[10:8] == older[10:8] && newer[7:1] > older[7:1];
  endfunction

  // ---- the line looked at, of the position looked at
  reg known_q = 1'b0;  // that position has begun
  reg needed_q;
  reg [1:0] times_q = 2'd0;
  wire begins = peek_state_q == ROUND && position_q + 3'd1 == number;
  wire at_work = run && position_q == number;
  wire [9:0] looked = {number, watched};
  wire is_needed = at_work ? needed(watched, appearance, g, point_lines) : needed_q;
  wire [2:0] places = {2'd0, at_work && watched >= key && is_needed} + {2'd0, valid[0] && line1_q[10:1] == looked}
      + {2'd0, valid[1] && line2_q[10:1] == looked} + {2'd0, valid[2] && line3_q[10:1] == looked}
      + {2'd0, valid[3] && line4_q[10:1] == looked} + {2'd0, valid[4] && line5_q[10:1] == looked} + {1'b0, times_q};
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) {known_q, times_q} <= 3'd0;
    else if (begins) {known_q, times_q} <= 3'b100;
    else if (leaves && line5_q[10:1] == looked && times_q != 2'd3) times_q <= times_q + 2'd1;
    if (at_work) needed_q <= is_needed;
  end

  // ---- what a line is, when it is issued
  wire [1:0] x_now = x_axis(key), y_now = y_axis(key), last_now = last_block(key, appearance, point_lines);
  wire [7:0] gx = place(x_now, g), gy = place(y_now, g);
  wire both_now = gx != 8'd0 && !last_now[0];
  wire whole_now = beside || both_now || gx == 8'd0;  // with this line the block of its part is
  wire [8:0] a_now = beside ? {1'b0, gx} : 9'd256 - {1'b0, gx};
  wire [8:0] b_now = of_line ? 9'd1 : far ? {1'b0, gy} : 9'd256 - {1'b0, gy};
  reg fresh_q = 1'b1;  // no line of the position has been issued
  reg [4:0] empty_q;
  reg [8:0] tag1_q, tag2_q, tag3_q, tag4_q, tag5_q;
  reg [2:0] of1_q, of2_q, of3_q;
  reg [1:0] blocks4_q;
  reg [33:0] weights1_q, weights2_q, weights3_q, weights4_q, weights5_q;
  reg both1_q, both2_q, both3_q, both4_q;
  reg [10:0] x1_q, y1_q, x2_q;
  reg [11:0] width1_q, height1_q, length1_q;
  reg [22:0] row2_q, point3_q;
  reg [27:0] from4_q, points4_q, address5_q, beside5_q;
  wire [2:0] of_now = {1'b0, key[6:5]} + (appearance ? 3'd3 : 3'd0);
  wire [27:0] lines3 = {26'd0, point_lines[2*of3_q+:2]} + 28'd1;
  always @(posedge clk_i) begin
    if (peek_state_q == ROUND) fresh_q <= 1'b1;
    else if (issue) fresh_q <= 1'b0;
    if (move) begin
      empty_q <= {empty_q[3:0], fresh_q && peek_tile_q};
      tag1_q <= {peek_run_end, appearance, key[6:5], key[2:1], of_line && whole_now, !far && !beside, of_line};
      {tag2_q, tag3_q, tag4_q, tag5_q} <= {tag1_q, tag2_q, tag3_q, tag4_q};
      {of1_q, of2_q, of3_q} <= {of_now, of1_q, of2_q};
      weights1_q <= {b_now[7:0], both_now ? {1'b0, gx} : 9'd0, b_now[7:0], a_now};
      {weights2_q, weights3_q, weights4_q, weights5_q} <= {weights1_q, weights2_q, weights3_q, weights4_q};
      {both1_q, both2_q, both3_q, both4_q} <= {both_now, both1_q, both2_q, both3_q};
      x1_q <= point(x_now, at) + {10'd0, beside};
      y1_q <= point(y_now, at) + {10'd0, far};
      width1_q <= size({1'b0, key[6]}, res);
      length1_q <= size(x_now, res);
      height1_q <= size(y_now, res);
      x2_q <= x1_q;
      row2_q <= tag1_q[0] ? 23'd0 : look_row_i;
      point3_q <= row2_q + {12'd0, x2_q};
      from4_q <= (tag3_q[0] ? line_first[28*of3_q+:28] : plane_first[28*of3_q+:28]) + {26'd0, tag3_q[4:3]};
      points4_q <= lines3 == 28'd1 ? {5'd0, point3_q} : lines3 == 28'd2 ? {4'd0, point3_q, 1'b0}
          : lines3 == 28'd3 ? {4'd0, point3_q, 1'b0} + {5'd0, point3_q} : {3'd0, point3_q, 2'b00};
      blocks4_q <= point_lines[2*of3_q+:2];
      address5_q <= from4_q + points4_q;
      beside5_q <= from4_q + points4_q + (both4_q ? {26'd0, blocks4_q} + 28'd1 : 28'd0);
    end
  end

  // ---- products of positions: at most (2^24 - 1) times the factor, mul_steps
  reg [6:0] inside_q = 7'd0;  // lines that wait for their answer
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) inside_q <= 7'd0;
    else inside_q <= inside_q + {6'd0, leaves} - {6'd0, pop_i};
  end
  reg waits_q = 1'b0;
  reg [56:0] waited_q;
  always @(posedge clk_i) begin
    waits_q <= rst_n_q && !clear_i && valid[4] && !leaves;
    waited_q <= {line_empty, line0, line1};
  end

  function fits(input [34:0] product, input [11:0] all);
    fits = all >= 12'd1 && all <= 12'd2048 && {1'b0, product} <= {all - 12'd1, 24'd0} - {24'd0, all - 12'd1};
  endfunction
  function inside_grid(input [10:0] p, input [7:0] q, input [11:0] all);
    inside_grid = {1'b0, p} < all && ({1'b0, p} + 12'd1 < all || q == 8'd0);
  endfunction
  always @* begin
    assume (fits(look_products_i[34:0], res[11:0]) && fits(look_products_i[69:35], res[23:12]) && fits(look_products_i[104:70], res[35:24]));
    assume (!pop_i || inside_q != 7'd0);
    if (!rst_n_q) at_reset : assert ({position_q, known_q, times_q, inside_q, waits_q} == 14'd0);
    else begin
      one_after_another : assert (ready == (peek_state_q == IDLE));
      waits_unchanged : assert (!waits_q || (valid[4] && {line_empty, line0, line1} == waited_q));
      room_for_the_answer : assert (peek_inside_q == inside_q && inside_q <= 7'd63 && (!peek_room_q || inside_q <= 7'd62));
      order1 : assert (follows(valid[0], line2_q, line1_q));
      order2 : assert (follows(valid[1], line3_q, line2_q));
      order3 : assert (follows(valid[2], line4_q, line3_q));
      order4 : assert (follows(valid[3], line5_q, line4_q));
      order5 : assert (follows(valid[4], left_q, line5_q));
      goes_on : assert (run ? (fresh_q ? line1_q[0] && line1_q[10:8] + 3'd1 == position_q
                                       : !line1_q[0] && line1_q[10:8] == position_q && line1_q[7:1] < key)
                            : line1_q[0] && line1_q[10:8] == position_q);
      begun : assert (!run || peek_begun_q == !fresh_q);
      needs_what_it_asks : assert (!run || needed(key, appearance, g, point_lines));
      exactly_once : assert (!known_q || places == {2'd0, is_needed});
      not_yet_known : assert (known_q || (times_q == 2'd0 && !at_work && !(valid[0] && line1_q[10:8] == number)
          && !(valid[1] && line2_q[10:8] == number) && !(valid[2] && line3_q[10:8] == number)
          && !(valid[3] && line4_q[10:8] == number) && !(valid[4] && line5_q[10:8] == number)));
      points_inside : assert (!run || (inside_grid(at[10:0], g[7:0], res[11:0]) && inside_grid(at[21:11], g[15:8], res[23:12])
                                       && inside_grid(at[32:22], g[23:16], res[35:24])));
      within_the_sizes : assert (!valid[0] || ({1'b0, x1_q} < (tag1_q[0] ? length1_q : width1_q) && (tag1_q[0] || {1'b0, y1_q} < height1_q)));
      stage1 : assert (!valid[0] || (peek_x1_q == x1_q && peek_tag1_q == tag1_q && peek_of1_q == of1_q && peek_both1_q == both1_q
                       && peek_a1_q == weights1_q[8:0] && peek_beside1_q == weights1_q[25:17] && peek_b1_q[7:0] == weights1_q[16:9]
                       && weights1_q[33:26] == weights1_q[16:9]));
      row_of_the_plane : assert (!valid[0] || tag1_q[0] || (y1 == y1_q && width1 == width1_q));
      stage2 : assert (!valid[1] || (peek_x2_q == x2_q && peek_tag2_q == tag2_q && peek_of2_q == of2_q && peek_both2_q == both2_q
                       && peek_weights2_q == weights2_q && peek_row2_q == row2_q));
      stage3 : assert (!valid[2] || (peek_tag3_q == tag3_q && peek_of3_q == of3_q && peek_both3_q == both3_q
                       && peek_weights3_q == weights3_q && peek_point3_q == point3_q));
      stage4 : assert (!valid[3] || (peek_tag4_q == tag4_q && peek_both4_q == both4_q && peek_weights4_q == weights4_q
                       && peek_first4_q == from4_q && {3'd0, peek_times4_q} == points4_q && peek_lines4_q == blocks4_q));
      own_address_weights_and_tag : assert (!valid[4] || (peek_tag5_q == tag5_q && peek_weights5_q == weights5_q
                                            && line0 == address5_q && line1 == beside5_q));
      tags_are_keys : assert (!valid[0] || {tag1_q[8], tag1_q[6:5], tag1_q[0], tag1_q[4:3]} == {line1_q[0], line1_q[7:5], line1_q[3:2]});
      empties_before_the_first : assert (((peek_empty_q ^ empty_q) & valid) == 5'd0);
    end
  end
endmodule

`default_nettype wire
