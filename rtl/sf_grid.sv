// Grid features of positions, two per level. Mirror: src/fx/grid.c (fx_grid_features)
//
// One pair of entries per cycle, those of corners x and x + 1: four pairs per level, levels in order. Their contents come
// in the order of the pairs after any time; up to 2^LOG2_DEPTH levels are on their way or wait at the output. Room
// for the contents is reserved before the first pair of a level, so they need no back-pressure. Whoever answers drops
// what is on its way at a clear.
`default_nettype none

module sf_grid #(
    parameter integer LOG2_DEPTH = 5
) (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        cfg_we_i,
    input  wire [ 6:0] cfg_addr_i,      // {level, parameter}, as sf_grid_cell
    input  wire [31:0] cfg_data_i,
    input  wire [ 3:0] last_level_i,
    input  wire        s_valid_i,
    output wire        s_ready_o,
    input  wire        s_tile_i,        // of a new tile
    input  wire [71:0] s_pos_i,         // {z, y, x}, Q0.24
    output wire        pair_valid_o,
    input  wire        pair_ready_i,
    output wire        pair_tile_o,     // the first of a new tile
    output wire [31:0] pair_entry0_o,
    output wire [31:0] pair_entry1_o,
    input  wire        entries_valid_i,
    input  wire [31:0] entries_i,       // of x + 1 and of x: {feature 1, feature 0}
    output wire        m_valid_o,
    input  wire        m_ready_i,
    output wire [23:0] m_features_o,    // {feature 1, feature 0}, 12 bits each
    output wire        m_last_o         // of the sample
);
  localparam integer COUNT = LOG2_DEPTH + 1;

  // Cells, one level at a time.
  wire cell_valid, cell_ready, cell_dense, cell_tile, cell_last;
  wire [15:0] cell_x;
  wire [31:0] cell_y0, cell_y1, cell_z0, cell_z1, cell_mask, cell_offset;
  wire [23:0] cell_place;
  wire [4:0] cell_shift;
  sf_grid_cell u_cell (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .cfg_we_i    (cfg_we_i),
      .cfg_addr_i  (cfg_addr_i),
      .cfg_data_i  (cfg_data_i),
      .last_level_i(last_level_i),
      .s_valid_i   (s_valid_i),
      .s_ready_o   (s_ready_o),
      .s_pos_i     (s_pos_i),
      .s_tile_i    (s_tile_i),
      .valid_o     (cell_valid),
      .ready_i     (cell_ready),
      .dense_o     (cell_dense),
      .x_o         (cell_x),
      .y0_o        (cell_y0),
      .y1_o        (cell_y1),
      .z0_o        (cell_z0),
      .z1_o        (cell_z1),
      .mask_o      (cell_mask),
      .offset_o    (cell_offset),
      .place_o     (cell_place),
      .shift_o     (cell_shift),
      .tile_o      (cell_tile),
      .last_o      (cell_last)
  );

  // A level at work, pair by pair: y with z, then the indices with x and x + 1, then the entries.
  reg [COUNT-1:0] reserved_q;  // levels between their first pair and the output
  reg room_q;
  reg work_q, row_valid_q, index_valid_q, entry_valid_q;
  reg [1:0] pair_q;
  reg dense_q, row_dense_q, tile_q, row_tile_q, index_tile_q, entry_tile_q;
  reg [15:0] x0_q;
  reg [16:0] x1_q;
  reg [15:0] row_x0_q;
  reg [16:0] row_x1_q;
  reg [31:0] y0_q, y1_q, z0_q, z1_q, mask_q, offset_q;
  reg [31:0] row_q, row_mask_q, row_offset_q, index0_q, index1_q, index_offset_q, entry0_q, entry1_q;
  wire entry_ready = !entry_valid_q || pair_ready_i;
  wire index_ready = !index_valid_q || entry_ready;
  wire row_ready = !row_valid_q || index_ready;
  wire work_end = work_q && row_ready && pair_q == 2'd3;
  wire load = cell_valid && cell_ready;
  wire leaves = m_valid_o && m_ready_i;
  wire [COUNT-1:0] reserved = load == leaves ? reserved_q : load ? reserved_q + 1'b1 : reserved_q - 1'b1;
  assign cell_ready = (!work_q || work_end) && room_q;
  wire [31:0] pair_y = pair_q[0] ? y1_q : y0_q;
  wire [31:0] pair_z = pair_q[1] ? z1_q : z0_q;
  wire [31:0] row_x0 = {16'd0, row_x0_q};
  wire [31:0] row_x1 = {15'd0, row_x1_q};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {work_q, row_valid_q, index_valid_q, entry_valid_q} <= 4'd0;
      reserved_q <= '0;
    end else if (clear_i) begin
      {work_q, row_valid_q, index_valid_q, entry_valid_q} <= 4'd0;
      reserved_q <= '0;
    end else begin
      if (load) work_q <= 1'b1;
      else if (work_end) work_q <= 1'b0;
      if (row_ready) row_valid_q <= work_q;
      if (index_ready) index_valid_q <= row_valid_q;
      if (entry_ready) entry_valid_q <= index_valid_q;
      reserved_q <= reserved;
    end
  end

  // No cell comes in the first cycle after a reset or a clear, in which this may still be of before.
  always_ff @(posedge clk_i) room_q <= !reserved[LOG2_DEPTH];

  always_ff @(posedge clk_i) begin
    if (load) begin
      pair_q <= 2'd0;
      dense_q <= cell_dense;
      tile_q <= cell_tile;
      x0_q <= cell_x;
      x1_q <= {1'b0, cell_x} + 17'd1;
      {y0_q, y1_q} <= {cell_y0, cell_y1};
      {z0_q, z1_q} <= {cell_z0, cell_z1};
      {mask_q, offset_q} <= {cell_mask, cell_offset};
    end else if (work_q && row_ready) begin
      pair_q <= pair_q + 2'd1;
      tile_q <= 1'b0;
    end
    if (row_ready) begin
      row_q <= dense_q ? pair_y + pair_z : pair_y ^ pair_z;
      {row_x0_q, row_x1_q} <= {x0_q, x1_q};
      {row_dense_q, row_tile_q, row_mask_q, row_offset_q} <= {dense_q, tile_q, mask_q, offset_q};
    end
    if (index_ready) begin
      index0_q <= row_dense_q ? row_q + row_x0 : (row_q ^ row_x0) & row_mask_q;
      index1_q <= row_dense_q ? row_q + row_x1 : (row_q ^ row_x1) & row_mask_q;
      {index_tile_q, index_offset_q} <= {row_tile_q, row_offset_q};
    end
    if (entry_ready) begin
      entry0_q <= index0_q + index_offset_q;
      entry1_q <= index1_q + index_offset_q;
      entry_tile_q <= index_tile_q;
    end
  end
  assign pair_valid_o = entry_valid_q;
  assign pair_tile_o = entry_tile_q;
  assign pair_entry0_o = entry0_q;
  assign pair_entry1_o = entry1_q;

  // Entries to features.
  wire [23:0] waiting_place, features;
  wire [4:0] waiting_shift;
  wire waiting_last, waiting_valid, pop, features_valid, features_last;
  sf_fifo #(
      .WIDTH     (30),
      .LOG2_DEPTH(LOG2_DEPTH)
  ) u_waiting (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (load),
      .data_i ({cell_place, cell_shift, cell_last}),
      .valid_o(waiting_valid),
      .pop_i  (pop),
      .data_o ({waiting_place, waiting_shift, waiting_last})
  );
  sf_trilinear u_trilinear (
      .clk_i     (clk_i),
      .rst_ni    (rst_ni),
      .clear_i   (clear_i),
      .valid_i   (entries_valid_i),
      .entries_i (entries_i),
      .place_i   (waiting_place),
      .shift_i   (waiting_shift),
      .last_i    (waiting_last),
      .pop_o     (pop),
      .valid_o   (features_valid),
      .features_o(features),
      .last_o    (features_last)
  );
  sf_fifo #(
      .WIDTH     (25),
      .LOG2_DEPTH(LOG2_DEPTH)
  ) u_features (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (features_valid),
      .data_i ({features, features_last}),
      .valid_o(m_valid_o),
      .pop_i  (m_valid_o && m_ready_i),
      .data_o ({m_features_o, m_last_o})
  );
  wire unused_ok = &{1'b0, waiting_valid};
endmodule

`default_nettype wire
