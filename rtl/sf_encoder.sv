// Sample positions and directions to the packets that sf_stream_in takes: grid features of every sample, and before
// those of a ray's first sample the spherical harmonics of its direction. Mirror: sim/stream.c (sf_dut_packet) over
// src/fx/grid.c and src/fx/sh.c.
//
// Programming, while nothing is on its way; kept by reset and clear:
//   cfg_addr_i   cfg_data_i                                                           in fx_scene
//   8 l + 0      scale of level l = 0..15, Q16.16                          [30:0]    grid.scale_q16[l]
//   8 l + 1      points per axis of a dense level; 0: hashed               [ 9:0]    grid.stride[l]
//   8 l + 2      log2 of the entries of a hashed level                     [ 4:0]    grid.log2_size[l]
//   8 l + 3      first entry                                               [31:0]    grid.offset[l]
//   8 l + 4      shift of its features, 0..31                              [ 4:0]    grid.shift[l]
//   0x80         number of levels, 1..16                                              grid.levels
//   0x81         number of direction features, 0..16                                  C1.n_in - (D2.n_out - 1)
//   0x82         frac, 0..11: their LSB is 2^-frac                                    -log2(dir_scale)
//
// Memory port: an entry is two signed bytes (feature 0 in bits 7:0), the table begins at base_i; see sf_cache. Four rays can
// be on their way when the samples are the first of theirs: one at the output, one in sf_sh, one waiting for it, and one at
// the input. A sample is taken every second cycle at most; a level alone takes four.
`default_nettype none

module sf_encoder #(
    parameter integer CACHE_BYTES = sf_arch_pkg::CACHE_BYTES,  // as sf_cache's
    parameter integer CACHE_WAYS = sf_arch_pkg::CACHE_WAYS,
    parameter integer LOG2_DEPTH = 5  // of the levels on their way to or from the memory
) (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        cfg_we_i,
    input  wire [ 7:0] cfg_addr_i,
    input  wire [31:0] cfg_data_i,
    input  wire        s_valid_i,
    output wire        s_ready_o,
    input  wire        s_first_i,         // of a new ray: s_dir_i is its direction
    input  wire        s_tile_i,          // of a new tile: the cache is emptied before it
    input  wire [71:0] s_pos_i,           // {z, y, x}, Q0.24
    input  wire [47:0] s_dir_i,           // {z, y, x}, signed Q1.14
    // the grid's memory, AXI4
    input  wire [31:0] base_i,            // of the table, a multiple of 16
    output wire        m_axi_arvalid_o,
    input  wire        m_axi_arready_i,
    output wire [31:0] m_axi_araddr_o,
    input  wire        m_axi_rvalid_i,
    input  wire [63:0] m_axi_rdata_i,
    input  wire [ 1:0] m_axi_rresp_i,
    // lines of another field, in place of the grid's pairs
    input  wire        planes_i,
    input  wire        line_valid_i,
    output wire        line_ready_o,
    input  wire        line_empty_i,      // the cache is emptied before it
    input  wire [27:0] line0_i,
    input  wire [27:0] line1_i,
    output wire        line_valid_o,
    output wire [127:0] line0_o,
    output wire [127:0] line1_o,
    input  wire        line_room_i,       // who takes them waits for a line, not for room behind it
    // events of the field
    output wire [ 1:0] lookups_o,
    output wire [ 1:0] misses_o,
    output wire        filled_o,
    output wire        waits_o,           // a look-up waits for its line, and the packet's end for it
    output wire        error_o,
    output wire        m_axis_tvalid_o,
    input  wire        m_axis_tready_i,
    output wire [63:0] m_axis_tdata_o,
    output wire        m_axis_tuser_o,
    output wire        m_axis_tlast_o
);
  reg [3:0] last_level_q, frac_q;
  reg [4:0] n_dir_q;
  always_ff @(posedge clk_i) begin
    if (cfg_we_i && cfg_addr_i == 8'h80) last_level_q <= cfg_data_i[3:0] - 4'd1;
    if (cfg_we_i && cfg_addr_i == 8'h81) n_dir_q <= cfg_data_i[4] ? 5'd16 : cfg_data_i[4:0];
    if (cfg_we_i && cfg_addr_i == 8'h82) frac_q <= cfg_data_i[3:0];
  end

  // A sample waits in a register at the input, so that who hands it over need not know who is ready behind it.
  reg held_q, first_q, tile_q;
  reg [71:0] pos_q;
  reg [47:0] unit_q;
  wire accept;
  assign s_ready_o = !held_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) held_q <= 1'b0;
    else if (clear_i) held_q <= 1'b0;
    else held_q <= held_q ? !accept : s_valid_i;
  end
  always_ff @(posedge clk_i) begin
    if (!held_q) {first_q, tile_q, pos_q, unit_q} <= {s_first_i, s_tile_i, s_pos_i, s_dir_i};
  end

  // It goes to the grid, its direction to the register before sf_sh.
  wire grid_ready, sh_ready, tag_valid, tag_first, packet_end;
  reg dir_valid_q;
  reg [47:0] dir_q;
  wire directed = first_q && n_dir_q != 5'd0;
  wire dir_ready = !dir_valid_q || sh_ready;
  assign accept = held_q && grid_ready && (!directed || dir_ready);
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) dir_valid_q <= 1'b0;
    else if (clear_i) dir_valid_q <= 1'b0;
    else if (dir_ready) dir_valid_q <= accept && directed;
  end
  always_ff @(posedge clk_i) if (dir_ready) dir_q <= unit_q;

  // The first of a ray are told apart behind the grid. At most 2^LOG2_DEPTH samples have levels on their way,
  // three more are in sf_grid_cell and one in the packet.
  sf_fifo #(
      .WIDTH     (1),
      .LOG2_DEPTH(LOG2_DEPTH + 1)
  ) u_tags (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (accept),
      .data_i (first_q),
      .valid_o(tag_valid),
      .pop_i  (packet_end),
      .data_o (tag_first)
  );

  wire features_ready, features_valid, features_last;
  wire [23:0] features;
  wire pair_valid, pair_ready, pair_tile, entries_valid, waits;
  wire [31:0] pair_entry0, pair_entry1, entries;
  assign line_ready_o = pair_ready && planes_i;
  assign line_valid_o = entries_valid && planes_i;
  sf_grid #(
      .LOG2_DEPTH(LOG2_DEPTH)
  ) u_grid (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .cfg_we_i       (cfg_we_i && !cfg_addr_i[7]),
      .cfg_addr_i     (cfg_addr_i[6:0]),
      .cfg_data_i     (cfg_data_i),
      .last_level_i   (last_level_q),
      .s_valid_i      (accept),
      .s_ready_o      (grid_ready),
      .s_tile_i       (tile_q),
      .s_pos_i        (pos_q),
      .pair_valid_o   (pair_valid),
      .pair_ready_i   (pair_ready && !planes_i),
      .pair_tile_o    (pair_tile),
      .pair_entry0_o  (pair_entry0),
      .pair_entry1_o  (pair_entry1),
      .entries_valid_i(entries_valid && !planes_i),
      .entries_i      (entries),
      .m_valid_o      (features_valid),
      .m_ready_i      (features_ready),
      .m_features_o   (features),
      .m_last_o       (features_last)
  );
  sf_cache #(
      .CACHE_BYTES(CACHE_BYTES),
      .CACHE_WAYS (CACHE_WAYS)
  ) u_cache (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .base_i         (base_i),
      .s_valid_i      (planes_i ? line_valid_i : pair_valid),
      .s_ready_o      (pair_ready),
      .s_empty_i      (planes_i ? line_empty_i : pair_tile),
      .s_entry0_i     (planes_i ? {1'b0, line0_i, 3'd0} : pair_entry0),
      .s_entry1_i     (planes_i ? {1'b0, line1_i, 3'd0} : pair_entry1),
      .m_valid_o      (entries_valid),
      .m_entries_o    (entries),
      .m_line0_o      (line0_o),
      .m_line1_o      (line1_o),
      .lookups_o      (lookups_o),
      .misses_o       (misses_o),
      .filled_o       (filled_o),
      .waits_o        (waits),
      .error_o        (error_o),
      .m_axi_arvalid_o(m_axi_arvalid_o),
      .m_axi_arready_i(m_axi_arready_i),
      .m_axi_araddr_o (m_axi_araddr_o),
      .m_axi_rvalid_i (m_axi_rvalid_i),
      .m_axi_rdata_i  (m_axi_rdata_i),
      .m_axi_rresp_i  (m_axi_rresp_i)
  );
  assign waits_o = waits && (planes_i ? line_room_i : features_ready && !features_valid && m_axis_tready_i);

  wire value_valid, value_ready, value_last;
  wire signed [11:0] value;
  sf_sh u_sh (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .n_i    (n_dir_q),
      .frac_i (frac_q),
      .valid_i(dir_valid_q),
      .ready_o(sh_ready),
      .unit_i (dir_q),
      .valid_o(value_valid),
      .ready_i(value_ready),
      .dir_o  (value),
      .last_o (value_last)
  );

  // Beats of four values: harmonics come one by one, features in pairs; unused places are 0.
  reg full_q, user_q, last_q, begun_q, dir_done_q;
  reg [1:0] at_q;  // place of the next value
  reg signed [11:0] place_q[0:3];
  wire room = !full_q || m_axis_tready_i;
  wire in_dir = tag_first && n_dir_q != 5'd0 && !dir_done_q;
  assign value_ready = tag_valid && in_dir && room;
  assign features_ready = tag_valid && !in_dir && room;
  wire take_value = value_ready && value_valid;
  wire take_pair = features_ready && features_valid;
  wire dir_end = take_value && value_last;
  assign packet_end = take_pair && features_last;
  wire beat_end = dir_end || packet_end || (take_value && at_q == 2'd3) || (take_pair && at_q[1]);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {full_q, begun_q, dir_done_q} <= 3'd0;
      at_q <= 2'd0;
    end else if (clear_i) begin
      {full_q, begun_q, dir_done_q} <= 3'd0;
      at_q <= 2'd0;
    end else begin
      if (room) full_q <= beat_end;
      if (beat_end) at_q <= 2'd0;
      else if (take_value) at_q <= at_q + 2'd1;
      else if (take_pair) at_q <= at_q + 2'd2;
      if (packet_end) {begun_q, dir_done_q} <= 2'b00;
      else if (beat_end) {begun_q, dir_done_q} <= {1'b1, dir_done_q || dir_end};
    end
  end

  integer i;
  always_ff @(posedge clk_i) begin
    for (i = 0; i < 4; i = i + 1) begin
      if (take_value ? at_q == 2'(i) : take_pair && at_q[1] == i[1]) begin
        place_q[i] <= in_dir ? value : i[0] ? features[23:12] : features[11:0];
      end else if ((take_value || take_pair) && at_q == 2'd0) begin
        place_q[i] <= 12'sd0;
      end
    end
    if (take_value || take_pair) begin
      user_q <= tag_first && !begun_q;
      last_q <= packet_end;
    end
  end

  assign m_axis_tvalid_o = full_q;
  assign m_axis_tdata_o = {16'(place_q[3]), 16'(place_q[2]), 16'(place_q[1]), 16'(place_q[0])};
  assign m_axis_tuser_o = user_q;
  assign m_axis_tlast_o = last_q;
endmodule

`default_nettype wire
