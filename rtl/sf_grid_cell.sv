// Walks a position through the levels: per level the cell, the place in it, and what the indices of its corners are made
// of. Mirror: src/fx/grid.c (find_cell, entry_index)
//
// Index of corner (i, j, k) = x + i, y[j], z[k] combined by + in a dense level, by ^ and a mask in a hashed one:
//   dense    y[j] = stride * (y + stride * z) + j * stride     z[k] = k * stride^2
//   hashed   y[j] = (y + j) * 2654435761                       z[k] = (z + k) * 805459861
// One 24 x 32 multiplier does the five products of a level in seven slots; its product is registered. The eight corners
// of the level before keep the memory port busy meanwhile.
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
    output wire        dense_o,
    output wire [15:0] x_o,
    output wire [31:0] y0_o,
    output wire [31:0] y1_o,
    output wire [31:0] z0_o,
    output wire [31:0] z1_o,
    output wire [31:0] mask_o,
    output wire [31:0] offset_o,
    output wire [23:0] place_o,       // {z, y, x} in 1/256 of the cell
    output wire [ 4:0] shift_o,
    output wire        last_o
);
  localparam [31:0] PRIME_Y = 32'd2654435761, PRIME_Z = 32'd805459861;
  localparam [2:0] SLOT_END = 3'd6;

  reg [30:0] scale_q[0:15];
  reg [9:0] stride_q[0:15];
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

  reg active_q;
  reg [3:0] level_q;
  reg [2:0] slot_q;
  reg [23:0] pos_x_q, pos_y_q, pos_z_q;
  wire [31:0] scale = {1'b0, scale_q[level_q]};
  wire [9:0] stride = stride_q[level_q];
  wire dense = stride != 10'd0;

  reg [15:0] x_q, y_q, z_q;
  reg [7:0] place_x_q, place_y_q, place_z_q;
  reg [31:0] first_q, second_q;  // dense: y + stride * z, stride^2; hashed: z, y times their primes
  wire [23:0] row = first_q[23:0];

  reg [23:0] left;
  reg [31:0] right;
  always_comb begin
    case (slot_q)
      3'd0: {left, right} = {pos_z_q, scale};
      3'd1: {left, right} = {pos_y_q, scale};
      3'd2: {left, right} = {pos_x_q, scale};
      3'd3: {left, right} = {8'd0, z_q, dense ? {22'd0, stride} : PRIME_Z};
      3'd4: {left, right} = dense ? {14'd0, stride, 22'd0, stride} : {8'd0, y_q, PRIME_Y};
      default: {left, right} = {row, 22'd0, stride};
    endcase
  end

  // Rounded to 1/256 of a cell, half up, and half a cell on.
  reg [55:0] product_q;
  wire [23:0] at = product_q[55:32] + {23'd0, product_q[31]} + 24'd128;

  wire done = active_q && slot_q == SLOT_END;
  wire taken = done && ready_i;
  wire end_of_sample = level_q == last_level_i;
  assign s_ready_o = !active_q || (taken && end_of_sample);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) active_q <= 1'b0;
    else if (clear_i) active_q <= 1'b0;
    else if (s_ready_o) active_q <= s_valid_i;
  end

  always_ff @(posedge clk_i) begin
    product_q <= 56'(left) * 56'(right);
    if (s_ready_o) begin
      {pos_z_q, pos_y_q, pos_x_q} <= s_pos_i;
      level_q <= 4'd0;
      slot_q <= 3'd0;
    end else if (taken) begin
      level_q <= level_q + 4'd1;
      slot_q <= 3'd0;
    end else if (!done) begin
      slot_q <= slot_q + 3'd1;
    end
    case (slot_q)
      3'd1: {z_q, place_z_q} <= at;
      3'd2: {y_q, place_y_q} <= at;
      3'd3: {x_q, place_x_q} <= at;
      3'd4: first_q <= product_q[31:0] + (dense ? {16'd0, y_q} : 32'd0);
      3'd5: second_q <= product_q[31:0];
      default: ;
    endcase
  end

  assign valid_o = done;
  assign dense_o = dense;
  assign x_o = x_q;
  assign y0_o = dense ? product_q[31:0] : second_q;
  assign y1_o = y0_o + (dense ? {22'd0, stride} : PRIME_Y);
  assign z0_o = dense ? 32'd0 : first_q;
  assign z1_o = dense ? second_q : first_q + PRIME_Z;
  assign mask_o = (32'd1 << log2_size_q[level_q]) - 32'd1;
  assign offset_o = offset_q[level_q];
  assign place_o = {place_z_q, place_y_q, place_x_q};
  assign shift_o = shift_q[level_q];
  assign last_o = end_of_sample;
endmodule

`default_nettype wire
