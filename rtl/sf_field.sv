// The field of a scene, a hash grid or planes: from samples of rays to packets for the nets. Beside the nets wait what the
// compositor needs of each sample, and where its ray ends.
`default_nettype none

module sf_field #(
    parameter CACHE_BYTES = sf_arch_pkg::CACHE_BYTES,
    parameter CACHE_WAYS = sf_arch_pkg::CACHE_WAYS,
    parameter GRID = 1,
    parameter PLANES = 1
) (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    input  wire         enable_i,
    // programming
    input  wire         cfg_we_i,
    input  wire [ 11:0] cfg_addr_i,
    input  wire [ 31:0] cfg_data_i,
    input  wire [ 19:0] trans_stop_i,
    input  wire [ 10:0] max_samples_i,
    input  wire [ 31:0] base_i,             // of the table in memory
    output wire         planes_o,           // the scene's field is that of TensoRF
    output wire         bad_o,              // it is not in this build, or its sizes are out of range
    // samples: a beat of sf_ray_top's s_axis
    input  wire         s_valid_i,
    output wire         s_ready_o,
    input  wire [241:0] s_data_i,
    input  wire         s_first_i,
    input  wire         s_last_i,
    output wire         error_order_o,
    // memory
    output wire         m_axi_arvalid_o,
    input  wire         m_axi_arready_i,
    output wire [ 31:0] m_axi_araddr_o,
    input  wire         m_axi_rvalid_i,
    input  wire [ 63:0] m_axi_rdata_i,
    input  wire [  1:0] m_axi_rresp_i,
    output wire         error_memory_o,
    // events of the cache
    output wire [  1:0] lookups_o,
    output wire [  1:0] misses_o,
    output wire         filled_o,
    output wire         waits_o,
    // packets to the nets
    output wire         m_axis_tvalid_o,
    input  wire         m_axis_tready_i,
    output wire [ 63:0] m_axis_tdata_o,
    output wire         m_axis_tuser_o,
    output wire         m_axis_tlast_o,
    // samples to the compositor
    output wire         valid_o,
    input  wire         take_i,
    output wire         first_o,
    output wire         last_o,
    output wire         empty_o,
    output wire         decoded_o,          // a result of the nets belongs to it
    output wire [ 24:0] delta_o,            // of a hash grid's
    output wire [ 20:0] weight_o,           // of planes'
    output wire [ 43:0] distance_o,
    input  wire         stop_i,             // the ray ends
    output wire         idle_o
);
  wire planes, bad_planes, track_idle, planes_idle;
  wire track_ready, planes_ready, track_order, planes_order;
  wire sample_valid, sample_first, sample_last, sample_empty;
  wire [43:0] distance;
  wire feature_valid, feature_user, feature_last;
  wire [63:0] feature_data;
  wire line_valid, line_ready, line_empty, line_comes;
  wire [27:0] line0, line1;
  wire [127:0] line_entries0, line_entries1;
  wire wave_valid, wave_user, wave_last;
  wire [63:0] wave_data;
  wire item_valid, item_first, item_last, item_empty, item_decoded;
  wire [43:0] item_distance;

  // ---- the hash grid; without it there is its cache
  generate
    if (GRID != 0) begin : g_grid
      wire encode_valid, encode_ready, encode_first, encode_tile;
      wire [71:0] encode_pos;
      wire [47:0] encode_dir;
      sf_ray_track u_track (
          .clk_i         (clk_i),
          .rst_ni        (rst_ni),
          .clear_i       (clear_i),
          .enable_i      (enable_i),
          .valid_i       (s_valid_i && !planes),
          .ready_o       (track_ready),
          .first_i       (s_first_i),
          .last_i        (s_last_i),
          .empty_i       (s_data_i[240]),
          .tile_i        (s_data_i[241]),
          .pos_i         ({s_data_i[87:64], s_data_i[55:32], s_data_i[23:0]}),
          .dir_i         (s_data_i[239:192]),
          .delta_i       (s_data_i[120:96]),
          .distance_i    (s_data_i[171:128]),
          .error_order_o (track_order),
          .encode_valid_o(encode_valid),
          .encode_ready_i(encode_ready),
          .encode_first_o(encode_first),
          .encode_tile_o (encode_tile),
          .encode_pos_o  (encode_pos),
          .encode_dir_o  (encode_dir),
          .valid_o       (sample_valid),
          .take_i        (take_i && !planes),
          .first_o       (sample_first),
          .last_o        (sample_last),
          .empty_o       (sample_empty),
          .delta_o       (delta_o),
          .distance_o    (distance),
          .stop_i        (stop_i),
          .idle_o        (track_idle)
      );
      sf_encoder #(
          .CACHE_BYTES(CACHE_BYTES),
          .CACHE_WAYS (CACHE_WAYS)
      ) u_encoder (
          .clk_i          (clk_i),
          .rst_ni         (rst_ni),
          .clear_i        (clear_i),
          .cfg_we_i       (cfg_we_i && cfg_addr_i[11:8] == 4'd0),
          .cfg_addr_i     (cfg_addr_i[7:0]),
          .cfg_data_i     (cfg_data_i),
          .s_valid_i      (encode_valid),
          .s_ready_o      (encode_ready),
          .s_first_i      (encode_first),
          .s_tile_i       (encode_tile),
          .s_pos_i        (encode_pos),
          .s_dir_i        (encode_dir),
          .base_i         (base_i),
          .m_axi_arvalid_o(m_axi_arvalid_o),
          .m_axi_arready_i(m_axi_arready_i),
          .m_axi_araddr_o (m_axi_araddr_o),
          .m_axi_rvalid_i (m_axi_rvalid_i),
          .m_axi_rdata_i  (m_axi_rdata_i),
          .m_axi_rresp_i  (m_axi_rresp_i),
          .planes_i       (planes),
          .line_valid_i   (line_valid),
          .line_ready_o   (line_ready),
          .line_empty_i   (line_empty),
          .line0_i        (line0),
          .line1_i        (line1),
          .line_valid_o   (line_comes),
          .line0_o        (line_entries0),
          .line1_o        (line_entries1),
          .line_room_i    (m_axis_tready_i && !wave_valid),
          .lookups_o      (lookups_o),
          .misses_o       (misses_o),
          .filled_o       (filled_o),
          .waits_o        (waits_o),
          .error_o        (error_memory_o),
          .m_axis_tvalid_o(feature_valid),
          .m_axis_tready_i(m_axis_tready_i && !planes),
          .m_axis_tdata_o (feature_data),
          .m_axis_tuser_o (feature_user),
          .m_axis_tlast_o (feature_last)
      );
    end else begin : g_no_grid
      wire cache_ready, waits_line;
      wire [31:0] unused_entries;
      assign {track_ready, track_order, sample_valid, sample_first, sample_last, sample_empty, delta_o, distance} = 75'd0;
      assign track_idle = 1'b1;
      assign {feature_valid, feature_data, feature_user, feature_last} = 67'd0;
      assign line_ready = cache_ready;
      assign waits_o = waits_line && m_axis_tready_i && !wave_valid;
      sf_cache #(
          .CACHE_BYTES(CACHE_BYTES),
          .CACHE_WAYS (CACHE_WAYS)
      ) u_cache (
          .clk_i          (clk_i),
          .rst_ni         (rst_ni),
          .clear_i        (clear_i),
          .base_i         (base_i),
          .s_valid_i      (line_valid),
          .s_ready_o      (cache_ready),
          .s_empty_i      (line_empty),
          .s_entry0_i     ({1'b0, line0, 3'd0}),
          .s_entry1_i     ({1'b0, line1, 3'd0}),
          .m_valid_o      (line_comes),
          .m_entries_o    (unused_entries),
          .m_line0_o      (line_entries0),
          .m_line1_o      (line_entries1),
          .lookups_o      (lookups_o),
          .misses_o       (misses_o),
          .filled_o       (filled_o),
          .waits_o        (waits_line),
          .error_o        (error_memory_o),
          .m_axi_arvalid_o(m_axi_arvalid_o),
          .m_axi_arready_i(m_axi_arready_i),
          .m_axi_araddr_o (m_axi_araddr_o),
          .m_axi_rvalid_i (m_axi_rvalid_i),
          .m_axi_rdata_i  (m_axi_rdata_i),
          .m_axi_rresp_i  (m_axi_rresp_i)
      );
      wire unused_ok = &{1'b0, unused_entries, stop_i};
    end
  endgenerate

  // ---- planes
  generate
    if (PLANES != 0) begin : g_planes
      sf_planes u_planes (
          .clk_i          (clk_i),
          .rst_ni         (rst_ni),
          .clear_i        (clear_i),
          .enable_i       (enable_i),
          .cfg_we_i       (cfg_we_i),
          .cfg_addr_i     (cfg_addr_i),
          .cfg_data_i     (cfg_data_i),
          .used_o         (planes),
          .bad_o          (bad_planes),
          .trans_stop_i   (trans_stop_i),
          .max_samples_i  (max_samples_i),
          .s_valid_i      (s_valid_i && planes),
          .s_ready_o      (planes_ready),
          .s_first_i      (s_first_i),
          .s_last_i       (s_last_i),
          .s_empty_i      (s_data_i[240]),
          .s_tile_i       (s_data_i[241]),
          .s_pos_i        ({s_data_i[87:64], s_data_i[55:32], s_data_i[23:0]}),
          .s_dir_i        (s_data_i[239:192]),
          .s_delta_i      (s_data_i[120:96]),
          .s_distance_i   (s_data_i[171:128]),
          .error_order_o  (planes_order),
          .line_valid_o   (line_valid),
          .line_ready_i   (line_ready),
          .line_empty_o   (line_empty),
          .line0_o        (line0),
          .line1_o        (line1),
          .entries_valid_i(line_comes),
          .entries0_i     (line_entries0),
          .entries1_i     (line_entries1),
          .m_axis_tvalid_o(wave_valid),
          .m_axis_tready_i(m_axis_tready_i && planes),
          .m_axis_tdata_o (wave_data),
          .m_axis_tuser_o (wave_user),
          .m_axis_tlast_o (wave_last),
          .valid_o        (item_valid),
          .take_i         (take_i && planes),
          .first_o        (item_first),
          .last_o         (item_last),
          .empty_o        (item_empty),
          .decoded_o      (item_decoded),
          .weight_o       (weight_o),
          .distance_o     (item_distance),
          .idle_o         (planes_idle)
      );
    end else begin : g_no_planes
      reg asked_q;  // for what is not there
      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) asked_q <= 1'b0;
        else if (cfg_we_i && cfg_addr_i == 12'h100) asked_q <= cfg_data_i[0];
      end
      assign bad_planes = asked_q;
      assign {planes, planes_ready, planes_order, planes_idle} = 4'b0001;
      assign {line_valid, line_empty, line0, line1} = 58'd0;
      assign {wave_valid, wave_data, wave_user, wave_last} = 67'd0;
      assign {item_valid, item_first, item_last, item_empty, item_decoded, weight_o, item_distance} = 70'd0;
      wire unused_ok = &{1'b0, line_ready, line_comes, line_entries0, line_entries1, trans_stop_i, max_samples_i};
    end
  endgenerate

  // ---- the one of the two that the scene has
  assign planes_o = planes;
  assign bad_o = bad_planes || (GRID == 0 && !planes);
  assign s_ready_o = planes ? planes_ready : track_ready;
  assign error_order_o = planes ? planes_order : track_order;
  assign m_axis_tvalid_o = planes ? wave_valid : feature_valid;
  assign m_axis_tdata_o = planes ? wave_data : feature_data;
  assign m_axis_tuser_o = planes ? wave_user : feature_user;
  assign m_axis_tlast_o = planes ? wave_last : feature_last;
  assign valid_o = planes ? item_valid : sample_valid;
  assign first_o = planes ? item_first : sample_first;
  assign last_o = planes ? item_last : sample_last;
  assign empty_o = planes ? item_empty : sample_empty;
  assign decoded_o = planes ? item_decoded : !sample_empty;
  assign distance_o = planes ? item_distance : distance;
  assign idle_o = track_idle && planes_idle;
  wire unused_ok = &{1'b0, s_data_i[191:172], s_data_i[127:121], s_data_i[95:88], s_data_i[63:56], s_data_i[31:24]};
endmodule

`default_nettype wire
