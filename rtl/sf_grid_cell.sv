// Walks a position through the levels: per level the cell, the place in it, and what the indices of its corners are made
// of. Mirror: src/fx/grid.c (find_cell, entry_index)
//
// Index of corner (i, j, k) = x + i, y[j], z[k] combined by + in a dense level, by ^ and a mask in a hashed one. In both
// y[j] = (y + j) * across and z[k] = (z + k) * up:
//   dense    across = stride        up = stride^2
//   hashed   across = 2654435761    up = 805459861
//
// A level begins every four cycles, which is what the four pairs of corners of one before it take. In its slots 0 to 5 the
// position is scaled, axis by axis: z, y, x; in slots 4 to 9 the cell is multiplied, in passes of 16 x 16 bits, while the
// next levels are in their slots 0 to 3; from slot 11 on it waits at the output. Of the multipliers one is for the cell; it
// also squares a stride when that is programmed.
`default_nettype none

module sf_grid_cell (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        cfg_we_i,
    input  wire [ 6:0] cfg_addr_i,    // {level, parameter}: scale, stride, log2_size, offset, shift
    input  wire [31:0] cfg_data_i,
    input  wire [ 3:0] last_level_i,
    input  wire        s_valid_i,
    output wire        s_ready_o,
    input  wire [71:0] s_pos_i,       // {z, y, x}, Q0.24
    input  wire        s_tile_i,
    output wire        valid_o,
    input  wire        ready_i,
    output reg         dense_o,
    output reg  [15:0] x_o,
    output reg  [31:0] y0_o,
    output reg  [31:0] y1_o,
    output reg  [31:0] z0_o,
    output reg  [31:0] z1_o,
    output reg  [31:0] mask_o,
    output reg  [31:0] offset_o,
    output reg  [23:0] place_o,       // {z, y, x} in 1/256 of the cell
    output reg  [ 4:0] shift_o,
    output reg         tile_o,        // first level of a sample that came with s_tile_i
    output reg         last_o
);
  localparam [31:0] PRIME_Y = 32'd2654435761, PRIME_Z = 32'd805459861;
  localparam [1:0] SLOT_OUT = 2'd2, SLOT_END = 2'd3;

  reg [30:0] scale_q[0:15];
  reg [9:0] stride_q[0:15];
  reg [19:0] square_q[0:15];
  reg [4:0] log2_size_q[0:15];
  reg [31:0] offset_q[0:15];
  reg [4:0] shift_q[0:15];
  always_ff @(posedge clk_i) begin
    if (cfg_we_i) begin
      case (cfg_addr_i[2:0])
        3'd0: scale_q[cfg_addr_i[6:3]] <= cfg_data_i[30:0];
        3'd1: stride_q[cfg_addr_i[6:3]] <= cfg_data_i[9:0];
        3'd2: log2_size_q[cfg_addr_i[6:3]] <= cfg_data_i[4:0];
        3'd3: offset_q[cfg_addr_i[6:3]] <= cfg_data_i;
        3'd4: shift_q[cfg_addr_i[6:3]] <= cfg_data_i[4:0];
        default: ;
      endcase
    end
  end

  // A level in slots 0 to 3, the one before it, whose cell is multiplied, and the one before that.
  reg active_q, before_q, late_q, valid_q;
  reg [3:0] level_q, before_level_q, late_level_q;
  reg before_last_q, late_last_q, tile_q, before_tile_q, late_tile_q;
  reg [1:0] slot_q;
  reg [23:0] pos_x_q, pos_y_q, pos_z_q;
  wire out = late_q && slot_q == SLOT_OUT;
  wire step = !(out && valid_q);
  wire slots_end = slot_q == SLOT_END;
  wire end_of_sample = level_q == last_level_i;
  wire idle = !active_q && !before_q && !late_q;
  wire next_sample = idle || (slots_end && (!active_q || end_of_sample));
  assign s_ready_o = next_sample;
  assign valid_o = valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {active_q, before_q, late_q, valid_q} <= 4'd0;
    else if (clear_i) {active_q, before_q, late_q, valid_q} <= 4'd0;
    else begin
      if (next_sample) active_q <= s_valid_i;
      if (slots_end) {before_q, late_q} <= {active_q, before_q};
      if (out && step) valid_q <= 1'b1;
      else if (ready_i) valid_q <= 1'b0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (next_sample) {tile_q, pos_z_q, pos_y_q, pos_x_q} <= {s_tile_i, s_pos_i};
    else if (slots_end) tile_q <= 1'b0;
    if (next_sample) level_q <= 4'd0;
    else if (slots_end) level_q <= level_q + 4'd1;
    if (idle) slot_q <= 2'd0;
    else if (step) slot_q <= slot_q + 2'd1;
    if (slots_end) begin
      {before_level_q, before_last_q, before_tile_q} <= {level_q, end_of_sample, tile_q};
      {late_level_q, late_last_q, late_tile_q} <= {before_level_q, before_last_q, before_tile_q};
    end
  end

  // ---- position * scale: rounded to 1/256 of a cell, half up, and half a cell on
  reg [23:0] pos_q;
  reg [30:0] scale_now_q;
  reg [33:0] low_q;   // lower 18 bits of the position by the lower half of the scale
  reg [32:0] high_q;  // by the upper half
  reg [36:0] rest_q;  // upper 6 bits of the position
  reg [39:0] pass_q;
  reg [24:0] lower_q;
  wire [39:0] sum = pass_q + {15'd0, lower_q};
  wire [23:0] at = sum[39:16];
  reg [15:0] x_q, y_q, z_q;
  reg [7:0] place_x_q, place_y_q, place_z_q;
  reg [15:0] late_x_q;
  reg [23:0] late_place_q;
  always_ff @(posedge clk_i) begin
    if (step) begin
      pos_q <= slot_q[1] ? pos_x_q : slot_q[0] ? pos_y_q : pos_z_q;
      scale_now_q <= scale_q[level_q];
      low_q <= 34'(pos_q[17:0]) * 34'(scale_now_q[15:0]);
      high_q <= 33'(pos_q[17:0]) * 33'(scale_now_q[30:16]);
      rest_q <= 37'(pos_q[23:18]) * 37'(scale_now_q);
      pass_q <= {7'd0, high_q} + {1'b0, rest_q, 2'd0};
      lower_q <= {7'd0, low_q[33:16]} + 25'h0808000;
      case (slot_q)
        2'd3: begin
          {z_q, place_z_q} <= at;
          {late_x_q, late_place_q} <= {x_q, place_z_q, place_y_q, place_x_q};
        end
        2'd0: {y_q, place_y_q} <= at;
        2'd1: {x_q, place_x_q} <= at;
        default: ;
      endcase
    end
  end

  // ---- cell * across or up, modulo 2^32, in two passes; without a level at work, the square of a stride
  wire [9:0] stride = stride_q[before_level_q];
  wire [19:0] square = square_q[before_level_q];
  wire dense = stride != 10'd0;
  wire [31:0] across = dense ? {22'd0, stride} : PRIME_Y;
  wire [31:0] up = dense ? {12'd0, square} : PRIME_Z;
  reg [15:0] cell_q, factor_q;
  reg [31:0] product_q, y_sum_q, z_sum_q;
  reg [1:0] square_on_way_q;
  reg [3:0] square_level_q, squared_level_q;
  wire squares = cfg_we_i && cfg_addr_i[2:0] == 3'd1;
  always_ff @(posedge clk_i) begin
    if (squares) {cell_q, factor_q} <= {2{6'd0, cfg_data_i[9:0]}};
    else if (step) begin
      case (slot_q)
        2'd0: {cell_q, factor_q} <= {z_q, up[15:0]};
        2'd1: {cell_q, factor_q} <= {z_q, up[31:16]};
        2'd2: {cell_q, factor_q} <= {y_q, across[15:0]};
        default: {cell_q, factor_q} <= {y_q, across[31:16]};
      endcase
    end
    if (step) begin
      product_q <= 32'(cell_q) * 32'(factor_q);
      case (slot_q)
        2'd2: z_sum_q <= product_q;
        2'd3: z_sum_q <= z_sum_q + {product_q[15:0], 16'd0};
        2'd0: y_sum_q <= product_q;
        default: y_sum_q <= y_sum_q + {product_q[15:0], 16'd0};
      endcase
    end
    square_on_way_q <= {square_on_way_q[0], squares};
    square_level_q <= cfg_addr_i[6:3];
    squared_level_q <= square_level_q;
    if (square_on_way_q[1]) square_q[squared_level_q] <= product_q[19:0];
  end

  // ---- at the output
  wire [9:0] late_stride = stride_q[late_level_q];
  wire late_dense = late_stride != 10'd0;
  always_ff @(posedge clk_i) begin
    if (out && step) begin
      dense_o <= late_dense;
      x_o <= late_x_q;
      y0_o <= y_sum_q;
      y1_o <= y_sum_q + (late_dense ? {22'd0, late_stride} : PRIME_Y);
      z0_o <= z_sum_q;
      z1_o <= z_sum_q + (late_dense ? {12'd0, square_q[late_level_q]} : PRIME_Z);
      mask_o <= ~(32'hffffffff << log2_size_q[late_level_q]);
      offset_o <= offset_q[late_level_q];
      place_o <= late_place_q;
      shift_o <= shift_q[late_level_q];
      tile_o <= late_tile_q;
      last_o <= late_last_q;
    end
  end
  wire unused_ok = &{1'b0, sum[15:0], low_q[15:0]};
endmodule

`default_nettype wire
