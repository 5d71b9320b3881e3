// TensoRF's field: samples of rays to their weights and, where they have one, to packets of the decoder.
// Mirror: src/fx/tensorf.c; src/fx/rays_tensorf.c
//
// Programming, as sf_encoder's:
//   cfg_addr_i   cfg_data_i                                                             in fx_scene
//   0x100        0: this field is not used, 1: it is                              [ 0]  backbone
//   0x101        grid points per axis x, 0x102 y, 0x103 z, 1..2048                [11:0] tensorf.res
//   0x104        0 softplus, 1 ReLU                                               [ 0]  tensorf.activation
//   0x105        a sample of at most this weight is not decoded                   [19:0] tensorf.weight_stop
//   0x106        features of the appearance, 1..32                                [ 5:0] tensorf.features
//   0x107        octaves of the features' sines, 0x108 of the direction's, 0..4   [ 2:0] tensorf.feature_freqs, view_freqs
//   0x109        LSB of directions and sines 2^-frac, 0..11                       [ 3:0] tensorf.encoding_frac
//   0x110 + 2 k  mul of scale k: density_in, sigma_out, feature_in, phase_in      [15:0] tensorf
//   0x111 + 2 k  its shift, 0..40                                                 [ 5:0]
//   0x118        bias of density_in                                               [23:0]
//   0x120 + 4 i  first line of the plane of array i: pairs of the density, then of the appearance; in lines of 16 bytes
//   0x121 + 4 i  first line of its line                                           [27:0]
//   0x122 + 4 i  lines of a point: ceil(components / 16), 1..4                    [ 2:0]
//   0x800 + 8 r  row r of the basis matrix in 8 words of four features: 64 pair + component
`default_nettype none

module sf_planes (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        enable_i,
    input  wire        cfg_we_i,
    input  wire [11:0] cfg_addr_i,
    input  wire [31:0] cfg_data_i,
    output wire        used_o,            // the scene's field
    output wire        bad_o,             // programming out of range
    input  wire [19:0] trans_stop_i,
    input  wire [10:0] max_samples_i,
    // samples: as sf_ray_track
    input  wire        s_valid_i,
    output wire        s_ready_o,
    input  wire        s_first_i,
    input  wire        s_last_i,
    input  wire        s_empty_i,
    input  wire        s_tile_i,
    input  wire [71:0] s_pos_i,
    input  wire [47:0] s_dir_i,
    input  wire [24:0] s_delta_i,
    input  wire [43:0] s_distance_i,
    output wire        error_order_o,
    // lines of the cache, one or two at a time
    output wire        line_valid_o,
    input  wire        line_ready_i,
    output wire        line_empty_o,
    output wire [27:0] line0_o,
    output wire [27:0] line1_o,
    input  wire        entries_valid_i,
    input  wire [127:0] entries0_i,
    input  wire [127:0] entries1_i,
    // packets of the decoder
    output wire        m_axis_tvalid_o,
    input  wire        m_axis_tready_i,
    output wire [63:0] m_axis_tdata_o,
    output wire        m_axis_tuser_o,
    output wire        m_axis_tlast_o,
    // to the compositor: as sf_light
    output wire        valid_o,
    input  wire        take_i,
    output wire        first_o,
    output wire        last_o,
    output wire        empty_o,
    output wire        decoded_o,
    output wire [20:0] weight_o,
    output wire [43:0] distance_o,
    output wire        idle_o
);
  // ---- programming
  reg used_q, relu_q;
  reg [11:0] res_q[0:2];
  reg [19:0] weight_stop_q;
  reg [5:0] features_q;
  reg [2:0] feature_freqs_q, view_freqs_q;
  reg [3:0] frac_q;
  reg [15:0] mul_q[0:3];
  reg [5:0] shift_q[0:3];
  reg [23:0] bias_q;
  reg [27:0] plane_first_q[0:5], line_first_q[0:5];
  reg [1:0] point_lines_q[0:5];
  wire low = cfg_we_i && cfg_addr_i[11:6] == 6'd4;  // 0x100..0x13f
  wire [5:0] word = cfg_addr_i[5:0];
  wire scale = word[5:3] == 3'd2;
  wire array = word[5] && word[4:2] < 3'd6;
  wire at_least_1 = cfg_data_i != 32'd0;
  // Sizes that do not fit are kept as ones that sf_ray_csr refuses at start.
  reg [7:0] ok_q, scales_ok_q;
  reg [5:0] lines_ok_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      used_q <= 1'b0;
      ok_q <= 8'd0;
      scales_ok_q <= 8'd0;
      lines_ok_q <= 6'd0;
    end else begin
      if (low && word == 6'h00) used_q <= cfg_data_i[0];
      if (low && word == 6'h01) ok_q[0] <= at_least_1 && cfg_data_i <= 32'd2048;
      if (low && word == 6'h02) ok_q[1] <= at_least_1 && cfg_data_i <= 32'd2048;
      if (low && word == 6'h03) ok_q[2] <= at_least_1 && cfg_data_i <= 32'd2048;
      if (low && word == 6'h05) ok_q[3] <= cfg_data_i < 32'd1048576;
      if (low && word == 6'h06) ok_q[4] <= at_least_1 && cfg_data_i <= 32'd32;
      if (low && word == 6'h07) ok_q[5] <= cfg_data_i <= 32'd4;
      if (low && word == 6'h08) ok_q[6] <= cfg_data_i <= 32'd4;
      if (low && word == 6'h09) ok_q[7] <= cfg_data_i <= 32'd11;
      if (low && scale) scales_ok_q[word[2:0]] <= cfg_data_i <= (word[0] ? 32'd40 : 32'd65535);
      if (low && array && word[1:0] == 2'd2) lines_ok_q[word[4:2]] <= at_least_1 && cfg_data_i <= 32'd4;
    end
  end
  always_ff @(posedge clk_i) begin
    if (low && word == 6'h01) res_q[0] <= cfg_data_i[11:0];
    if (low && word == 6'h02) res_q[1] <= cfg_data_i[11:0];
    if (low && word == 6'h03) res_q[2] <= cfg_data_i[11:0];
    if (low && word == 6'h04) relu_q <= cfg_data_i[0];
    if (low && word == 6'h05) weight_stop_q <= cfg_data_i[19:0];
    if (low && word == 6'h06) features_q <= cfg_data_i[5:0];
    if (low && word == 6'h07) feature_freqs_q <= cfg_data_i[2:0];
    if (low && word == 6'h08) view_freqs_q <= cfg_data_i[2:0];
    if (low && word == 6'h09) frac_q <= cfg_data_i[3:0];
    if (low && scale && !word[0]) mul_q[word[2:1]] <= cfg_data_i[15:0];
    if (low && scale && word[0]) shift_q[word[2:1]] <= cfg_data_i[5:0];
    if (low && word == 6'h18) bias_q <= cfg_data_i[23:0];
    if (low && array && word[1:0] == 2'd0) plane_first_q[word[4:2]] <= cfg_data_i[27:0];
    if (low && array && word[1:0] == 2'd1) line_first_q[word[4:2]] <= cfg_data_i[27:0];
    if (low && array && word[1:0] == 2'd2) point_lines_q[word[4:2]] <= 2'(cfg_data_i[2:0] - 3'd1);
  end
  assign used_o = used_q;
  assign bad_o = used_q && !(&ok_q && &scales_ok_q && &lines_ok_q);

  // ---- rays
  wire read_valid, read_ready, read_appearance, read_tile, light_idle, sigma_valid;
  wire [71:0] read_pos;
  wire [47:0] read_dir;
  wire [27:0] sigma;
  sf_light u_light (
      .clk_i            (clk_i),
      .rst_ni           (rst_ni),
      .clear_i          (clear_i),
      .enable_i         (enable_i),
      .trans_stop_i     (trans_stop_i),
      .max_samples_i    (max_samples_i),
      .weight_stop_i    (weight_stop_q),
      .valid_i          (s_valid_i),
      .ready_o          (s_ready_o),
      .first_i          (s_first_i),
      .last_i           (s_last_i),
      .empty_i          (s_empty_i),
      .tile_i           (s_tile_i),
      .pos_i            (s_pos_i),
      .dir_i            (s_dir_i),
      .delta_i          (s_delta_i),
      .distance_i       (s_distance_i),
      .error_order_o    (error_order_o),
      .read_valid_o     (read_valid),
      .read_ready_i     (read_ready),
      .read_appearance_o(read_appearance),
      .read_tile_o      (read_tile),
      .read_pos_o       (read_pos),
      .read_dir_o       (read_dir),
      .sigma_valid_i    (sigma_valid),
      .sigma_i          (sigma),
      .valid_o          (valid_o),
      .take_i           (take_i),
      .first_o          (first_o),
      .last_o           (last_o),
      .empty_o          (empty_o),
      .decoded_o        (decoded_o),
      .weight_o         (weight_o),
      .distance_o       (distance_o),
      .idle_o           (light_idle)
  );

  // ---- planes and lines. Some appearances have room behind them: their blocks wait in sf_basis.
  localparam [2:0] APPEARANCES = 3'd5;
  wire reads_ready, sums_ready, sums_valid;
  reg [2:0] appearances_q;
  wire room = !read_appearance || appearances_q != APPEARANCES;
  assign read_ready = reads_ready && room;
  wire begins = read_valid && read_ready && read_appearance;
  wire leaves = sums_valid && sums_ready;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) appearances_q <= 3'd0;
    else if (clear_i) appearances_q <= 3'd0;
    else if (begins != leaves) appearances_q <= begins ? appearances_q + 3'd1 : appearances_q - 3'd1;
  end

  wire [16:0] weight0, weight1;
  wire of_line, first, last, appearance, read_end, mix_valid, mix_appearance, mix_end;
  wire [1:0] block, pair, mix_block, mix_pair;
  wire [495:0] products;
  sf_planes_reads u_reads (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .res_i         ({res_q[2], res_q[1], res_q[0]}),
      .plane_first_i ({plane_first_q[5], plane_first_q[4], plane_first_q[3], plane_first_q[2], plane_first_q[1], plane_first_q[0]}),
      .line_first_i  ({line_first_q[5], line_first_q[4], line_first_q[3], line_first_q[2], line_first_q[1], line_first_q[0]}),
      .point_lines_i ({point_lines_q[5], point_lines_q[4], point_lines_q[3], point_lines_q[2], point_lines_q[1], point_lines_q[0]}),
      .s_valid_i     (read_valid && room),
      .s_ready_o     (reads_ready),
      .s_appearance_i(read_appearance),
      .s_tile_i      (read_tile),
      .s_pos_i       (read_pos),
      .line_valid_o  (line_valid_o),
      .line_ready_i  (line_ready_i),
      .line_empty_o  (line_empty_o),
      .line0_o       (line0_o),
      .line1_o       (line1_o),
      .pop_i         (entries_valid_i),
      .weight0_o     (weight0),
      .weight1_o     (weight1),
      .of_line_o     (of_line),
      .first_o       (first),
      .last_o        (last),
      .block_o       (block),
      .pair_o        (pair),
      .appearance_o  (appearance),
      .end_o         (read_end)
  );
  sf_planes_mix u_mix (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .valid_i     (entries_valid_i),
      .entries0_i  (entries0_i),
      .entries1_i  (entries1_i),
      .weight0_i   (weight0),
      .weight1_i   (weight1),
      .of_line_i   (of_line),
      .first_i     (first),
      .last_i      (last),
      .block_i     (block),
      .pair_i      (pair),
      .appearance_i(appearance),
      .end_i       (read_end),
      .valid_o     (mix_valid),
      .products_o  (products),
      .block_o     (mix_block),
      .pair_o      (mix_pair),
      .appearance_o(mix_appearance),
      .end_o       (mix_end)
  );

  // ---- density: 16 products to 4 sums, to one, to the sum of the sample
  reg signed [32:0] quarter_q[0:3];
  reg signed [34:0] block_q;
  reg signed [38:0] sum_q;
  reg [1:0] density_q, density_end_q;  // a block in quarter_q and in block_q
  reg fresh_q;                         // sum_q is of a sample that has ended
  reg [16:0] sum_end_q;                // on its way through sf_activation
  integer i;
  always_ff @(posedge clk_i) begin
    for (i = 0; i < 4; i = i + 1) begin
      quarter_q[i] <= 33'($signed(products[124*i+:31])) + 33'($signed(products[124*i+31+:31]))
          + 33'($signed(products[124*i+62+:31])) + 33'($signed(products[124*i+93+:31]));
    end
    block_q <= 35'(quarter_q[0]) + 35'(quarter_q[1]) + 35'(quarter_q[2]) + 35'(quarter_q[3]);
    density_end_q <= {density_end_q[0], mix_end};
    if (density_q[1]) sum_q <= (fresh_q ? 39'sd0 : sum_q) + 39'(block_q);
  end
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      density_q <= 2'b00;
      fresh_q <= 1'b1;
      sum_end_q <= 17'd0;
    end else if (clear_i) begin
      density_q <= 2'b00;
      fresh_q <= 1'b1;
      sum_end_q <= 17'd0;
    end else begin
      density_q <= {density_q[0], mix_valid && !mix_appearance};
      if (density_q[1]) fresh_q <= density_end_q[1];
      sum_end_q <= {sum_end_q[15:0], density_q[1] && density_end_q[1]};
    end
  end
  sf_activation u_activation (
      .clk_i      (clk_i),
      .sum_i      (sum_q),
      .relu_i     (relu_q),
      .in_mul_i   (mul_q[0]),
      .in_shift_i (shift_q[0]),
      .in_bias_i  (bias_q),
      .out_mul_i  (mul_q[1]),
      .out_shift_i(shift_q[1]),
      .sigma_o    (sigma)
  );
  assign sigma_valid = sum_end_q[16];

  // ---- appearance
  wire [991:0] sums;
  sf_basis u_basis (
      .clk_i     (clk_i),
      .rst_ni    (rst_ni),
      .clear_i   (clear_i),
      .cfg_we_i  (cfg_we_i && cfg_addr_i[11]),
      .cfg_addr_i(cfg_addr_i[10:0]),
      .cfg_data_i(cfg_data_i),
      .valid_i   (mix_valid && mix_appearance),
      .products_i(products),
      .block_i   (mix_block),
      .pair_i    (mix_pair),
      .end_i     (mix_end),
      .valid_o   (sums_valid),
      .ready_i   (sums_ready),
      .sums_o    (sums)
  );
  wire [47:0] read_phase;
  sf_dir_phase u_dir_phase (
      .clk_i  (clk_i),
      .dir_i  (read_dir),
      .phase_o(read_phase)
  );
  wire dir_valid;
  wire [47:0] dir, turn;
  sf_fifo #(
      .WIDTH     (96),
      .LOG2_DEPTH(3)
  ) u_dirs (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (begins),
      .data_i ({read_phase, read_dir}),
      .valid_o(dir_valid),
      .pop_i  (leaves),
      .data_o ({turn, dir})
  );
  sf_waves u_waves (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .features_i     (features_q),
      .feature_freqs_i(feature_freqs_q),
      .view_freqs_i   (view_freqs_q),
      .frac_i         (frac_q),
      .feature_mul_i  (mul_q[2]),
      .feature_shift_i(shift_q[2]),
      .phase_mul_i    (mul_q[3]),
      .phase_shift_i  (shift_q[3]),
      .valid_i        (sums_valid),
      .ready_o        (sums_ready),
      .sums_i         (sums),
      .dir_i          (dir),
      .turn_i         (turn),
      .m_axis_tvalid_o(m_axis_tvalid_o),
      .m_axis_tready_i(m_axis_tready_i),
      .m_axis_tdata_o (m_axis_tdata_o),
      .m_axis_tuser_o (m_axis_tuser_o),
      .m_axis_tlast_o (m_axis_tlast_o)
  );
  assign idle_o = light_idle;
  wire unused_ok = &{1'b0, dir_valid};
endmodule

`default_nettype wire
