// Walks a position through the levels: per level the cell, the place in it, and what the indices of its corners are made
// of. Mirror: src/fx/grid.c (find_cell, entry_index)
//
// Index of corner (i, j, k) = x + i, y[j], z[k] combined by + in a dense level, by ^ and a mask in a hashed one. In both
// y[j] = (y + j) * across and z[k] = (z + k) * up:
//   dense    across = stride        up = stride^2
//   hashed   across = 2654435761    up = 805459861
//
// A level begins every eight cycles, which is what the eight corners of one before it take. In its slots 0 to 5 the
// position is scaled, axis by axis in two passes of 24 x 16 bits; in slots 5 to 8 the cell is multiplied, in passes of
// 16 x 16 bits, while the next level is in its slots 0 to 7; from slot 12 on it waits at the output. Three multipliers of
// the device in all; the last of them squares a stride when it is programmed.
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
    output reg         last_o
);
  localparam [31:0] PRIME_Y = 32'd2654435761, PRIME_Z = 32'd805459861;
  localparam [2:0] SLOT_Z = 3'd5, SLOT_OUT = 3'd3, SLOT_END = 3'd7;

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

  // A level in slots 0 to 7, and the one before it, whose cell is multiplied.
  reg active_q, before_q, valid_q;
  reg [3:0] level_q, before_level_q;
  reg before_last_q;
  reg [2:0] slot_q;
  reg [23:0] pos_x_q, pos_y_q, pos_z_q;
  wire out = before_q && slot_q == SLOT_OUT;
  wire step = !(out && valid_q);
  wire end_of_sample = level_q == last_level_i;
  wire idle = !active_q && !before_q;
  wire next_sample = idle || (slot_q == SLOT_END && (!active_q || end_of_sample));
  assign s_ready_o = next_sample;
  assign valid_o = valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {active_q, before_q, valid_q} <= 3'd0;
    else if (clear_i) {active_q, before_q, valid_q} <= 3'd0;
    else begin
      if (next_sample) active_q <= s_valid_i;
      if (slot_q == SLOT_Z - 3'd1) before_q <= active_q;
      if (out && step) valid_q <= 1'b1;
      else if (ready_i) valid_q <= 1'b0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (next_sample) {pos_z_q, pos_y_q, pos_x_q} <= s_pos_i;
    if (next_sample) level_q <= 4'd0;
    else if (slot_q == SLOT_END) level_q <= level_q + 4'd1;
    if (idle) slot_q <= 3'd0;
    else if (step) slot_q <= slot_q + 3'd1;
    if (slot_q == SLOT_Z - 3'd1) begin
      before_level_q <= level_q;
      before_last_q <= end_of_sample;
    end
  end

  // ---- position * scale, the lower half of the scale first: rounded to 1/256 of a cell, half up, and half a cell on
  reg [23:0] pos_q;
  reg [15:0] half_q;
  reg [33:0] low_q;
  reg [21:0] high_q;
  reg [39:0] pass_q;
  reg [24:0] lower_q;
  wire [30:0] scale = scale_q[level_q];
  wire [39:0] sum = pass_q + {15'd0, lower_q};
  wire [23:0] at = sum[39:16];
  reg [15:0] x_q, y_q, z_q;
  reg [7:0] place_x_q, place_y_q, place_z_q;
  always_ff @(posedge clk_i) begin
    if (step) begin
      pos_q <= slot_q[2] ? pos_x_q : slot_q[1] ? pos_y_q : pos_z_q;
      half_q <= slot_q[0] ? {1'b0, scale[30:16]} : scale[15:0];
      low_q <= 34'(pos_q[17:0]) * 34'(half_q);
      high_q <= 22'(pos_q[23:18]) * 22'(half_q);
      pass_q <= {high_q, 18'd0} + {6'd0, low_q};
      lower_q <= {1'b0, pass_q[39:16]} + 25'h0808000;
      case (slot_q)
        3'd4: {z_q, place_z_q} <= at;
        3'd6: {y_q, place_y_q} <= at;
        3'd0: {x_q, place_x_q} <= at;
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
        3'd5: {cell_q, factor_q} <= {z_q, up[15:0]};
        3'd6: {cell_q, factor_q} <= {z_q, up[31:16]};
        3'd7: {cell_q, factor_q} <= {y_q, across[15:0]};
        default: {cell_q, factor_q} <= {y_q, across[31:16]};
      endcase
    end
    if (step) begin
      product_q <= 32'(cell_q) * 32'(factor_q);
      case (slot_q)
        3'd7: z_sum_q <= product_q;
        3'd0: z_sum_q <= z_sum_q + {product_q[15:0], 16'd0};
        3'd1: y_sum_q <= product_q;
        3'd2: y_sum_q <= y_sum_q + {product_q[15:0], 16'd0};
        default: ;
      endcase
    end
    square_on_way_q <= {square_on_way_q[0], squares};
    square_level_q <= cfg_addr_i[6:3];
    squared_level_q <= square_level_q;
    if (square_on_way_q[1]) square_q[squared_level_q] <= product_q[19:0];
  end

  // ---- at the output
  always_ff @(posedge clk_i) begin
    if (out && step) begin
      dense_o <= dense;
      x_o <= x_q;
      y0_o <= y_sum_q;
      y1_o <= y_sum_q + across;
      z0_o <= z_sum_q;
      z1_o <= z_sum_q + up;
      mask_o <= ~(32'hffffffff << log2_size_q[before_level_q]);
      offset_o <= offset_q[before_level_q];
      place_o <= {place_z_q, place_y_q, place_x_q};
      shift_o <= shift_q[before_level_q];
      last_o <= before_last_q;
    end
  end
  wire unused_ok = &{1'b0, sum[15:0]};
endmodule

`default_nettype wire
