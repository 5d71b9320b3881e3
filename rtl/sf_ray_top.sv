// Rays in, pixels out: sf_field, sf_top and sf_composite in a row. The registers are those of sf_top and, in a window
// that it leaves free, those of the rays (csr.def). The hash grid lies in an external memory.
//
// s_axis: one beat per sample of a ray, in the order of the ray; tuser on its first, tlast on its last.
//   31:0 x, 63:32 y, 95:64 z    Q0.24
//   127:96 delta                Q1.24 box edges
//   191:128 distance            lattice steps from the camera, U28.16
//   239:192 direction x, y, z   signed Q1.14, read on the first sample
//   240 empty                   with tuser and tlast: a ray without a sample; its pixel is the background
//   241 new tile                with tuser: the field's cache is emptied before this ray
// m_axis: one beat per ray, in the order of the rays: fx_pixel as it lies in memory (little-endian).
// m_axi: an AXI4 read master for the grid's table, two signed bytes per entry from FIELD_BASE on. A burst is a line of the
// cache: 16 bytes, aligned, so none crosses 4 KiB. One ID; answers in order, any number of cycles later; rready is always
// high. A soft reset drops the answers that the memory owes; rst_ni must reset the memory's port too.
`default_nettype none
`include "sf_refuse.svh"

module sf_ray_top #(
`ifdef SF_NO_TAP
    parameter TAP = 0,
`else
    parameter TAP = 1,
`endif
    parameter LANES = sf_arch_pkg::LANES,  // these as sf_top's
    parameter MACS = LANES < sf_arch_pkg::MACS ? LANES : sf_arch_pkg::MACS,
    parameter NEURONS = sf_arch_pkg::NEURONS,
    parameter STEPS_AT_ONCE = sf_arch_pkg::STEPS_AT_ONCE,
    parameter CACHE_BYTES = sf_arch_pkg::CACHE_BYTES,  // these as sf_cache's
    parameter CACHE_WAYS = sf_arch_pkg::CACHE_WAYS,
    parameter GRID = 1,                    // the hash grid's field
    parameter PLANES = 1                   // TensoRF's; one of them at least
) (
    input  wire          clk_i,
    input  wire          rst_ni,
    // AXI4-Lite, 8 KiB
    input  wire          s_axil_awvalid_i,
    output wire          s_axil_awready_o,
    input  wire [  12:0] s_axil_awaddr_i,
    input  wire          s_axil_wvalid_i,
    output wire          s_axil_wready_o,
    input  wire [  31:0] s_axil_wdata_i,
    input  wire [   3:0] s_axil_wstrb_i,
    output wire          s_axil_bvalid_o,
    input  wire          s_axil_bready_i,
    output wire [   1:0] s_axil_bresp_o,
    input  wire          s_axil_arvalid_i,
    output wire          s_axil_arready_o,
    input  wire [  12:0] s_axil_araddr_i,
    output wire          s_axil_rvalid_o,
    input  wire          s_axil_rready_i,
    output wire [  31:0] s_axil_rdata_o,
    output wire [   1:0] s_axil_rresp_o,
    // samples of rays
    input  wire          s_axis_tvalid_i,
    output wire          s_axis_tready_o,
    input  wire [ 255:0] s_axis_tdata_i,
    input  wire          s_axis_tuser_i,
    input  wire          s_axis_tlast_i,
    // pixels
    output wire          m_axis_tvalid_o,
    input  wire          m_axis_tready_i,
    output wire [ 383:0] m_axis_tdata_o,
    // the grid's memory
    output wire          m_axi_arvalid_o,
    input  wire          m_axi_arready_i,
    output wire [  31:0] m_axi_araddr_o,
    output wire [   7:0] m_axi_arlen_o,
    output wire [   2:0] m_axi_arsize_o,
    output wire [   1:0] m_axi_arburst_o,
    output wire [   2:0] m_axi_arprot_o,
    input  wire          m_axi_rvalid_i,
    output wire          m_axi_rready_o,
    input  wire [  63:0] m_axi_rdata_i,
    input  wire [   1:0] m_axi_rresp_i,
    input  wire          m_axi_rlast_i,
    output wire          irq_o
`ifndef SF_NO_TAP
    // tap of sf_top
    ,
    output wire          tap_valid_o,
    output wire [   2:0] tap_layer_o,
    output wire [   2:0] tap_step_o,
    output wire [   sf_arch_pkg::LANES-1:0] tap_spikes_o,
    output wire [   sf_arch_pkg::LANES-1:0] tap_rows_o,
    output wire [24*sf_arch_pkg::LANES-1:0] tap_membrane_o
`endif
);
  // ---- registers: 0x400..0x7ff are the rays'
  wire net_awready, net_wready, net_bvalid, net_arready, net_rvalid, net_irq;
  wire [1:0] net_bresp, net_rresp;
  wire [31:0] net_rdata;
  wire ray_wready, ray_bvalid, ray_arready, ray_rvalid, ray_irq;
  wire [1:0] ray_bresp;
  wire [31:0] ray_rdata;
  reg net_writes_q, net_reads_q;
  reg [1:0] reset_q;
  wire write_ray = s_axil_awaddr_i[12:10] == 3'd1;
  wire read_ray = s_axil_araddr_i[12:10] == 3'd1;
  wire write_now = s_axil_awvalid_i && s_axil_wvalid_i && !net_writes_q && !net_bvalid && !ray_bvalid;
  wire read_now = s_axil_arvalid_i && !net_reads_q && !net_rvalid && !ray_rvalid;
  assign s_axil_awready_o = write_ray ? ray_wready : net_awready;
  assign s_axil_wready_o = write_ray ? ray_wready : net_wready;
  assign s_axil_bvalid_o = net_bvalid || ray_bvalid;
  assign s_axil_bresp_o = ray_bvalid ? ray_bresp : net_bresp;
  assign s_axil_arready_o = read_ray ? ray_arready : net_arready;
  assign s_axil_rvalid_o = net_rvalid || ray_rvalid;
  assign s_axil_rdata_o = ray_rvalid ? ray_rdata : net_rdata;
  assign s_axil_rresp_o = ray_rvalid ? 2'd0 : net_rresp;
  assign irq_o = net_irq || ray_irq;
  // sf_csr answers some cycles after it has taken a request, and resets two cycles after it has taken the command.
  wire soft_reset = reset_q[1];
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {net_writes_q, net_reads_q, reset_q} <= 4'd0;
    else begin
      net_writes_q <= net_awready || (net_writes_q && !net_bvalid);
      net_reads_q <= net_arready || (net_reads_q && !net_rvalid);
      reset_q <= {reset_q[0], net_awready && {s_axil_awaddr_i[12:2], 2'b00} == sf_csr_pkg::CTRL
          && s_axil_wstrb_i == 4'hf && s_axil_wdata_i[sf_csr_pkg::CTRL_SOFT_RESET]};
    end
  end

  wire cfg_we, running, error_order, active;
  wire [11:0] cfg_addr;
  wire [31:0] cfg_data;
  wire [19:0] trans_stop;
  wire [10:0] max_samples;
  wire [50:0] background;
  wire [31:0] base;
  wire [1:0] lookups, misses;
  wire filled, waits, error_memory, bad_field;
  sf_ray_csr #(
      .CACHE_BYTES(CACHE_BYTES),
      .CACHE_WAYS (CACHE_WAYS),
      .GRID       (GRID),
      .PLANES     (PLANES)
  ) u_csr (
      .clk_i        (clk_i),
      .rst_ni       (rst_ni),
      .wvalid_i     (write_now && write_ray),
      .wready_o     (ray_wready),
      .waddr_i      (s_axil_awaddr_i),
      .wdata_i      (s_axil_wdata_i),
      .wstrb_i      (s_axil_wstrb_i),
      .bvalid_o     (ray_bvalid),
      .bready_i     (s_axil_bready_i),
      .bresp_o      (ray_bresp),
      .arvalid_i    (read_now && read_ray),
      .arready_o    (ray_arready),
      .araddr_i     (s_axil_araddr_i),
      .rvalid_o     (ray_rvalid),
      .rready_i     (s_axil_rready_i),
      .rdata_o      (ray_rdata),
      .irq_o        (ray_irq),
      .cfg_we_o     (cfg_we),
      .cfg_addr_o   (cfg_addr),
      .cfg_data_o   (cfg_data),
      .trans_stop_o (trans_stop),
      .max_samples_o(max_samples),
      .background_o (background),
      .base_o       (base),
      .running_o    (running),
      .soft_reset_i (soft_reset),
      .active_i     (active),
      .error_order_i(error_order),
      .bad_field_i  (bad_field),
      .error_memory_i(error_memory),
      .lookups_i    (lookups),
      .misses_i     (misses),
      .filled_i     (filled),
      .waits_i      (waits)
  );

  // ---- from samples to packets
  wire planes;  // the scene's field is that of TensoRF
  wire feature_valid, feature_ready, feature_user, feature_last;
  wire [63:0] feature_data;
  wire item_valid, item_take, item_first, item_last, item_empty, item_decoded;
  wire [24:0] delta;
  wire [20:0] weight;
  wire [43:0] distance;
  wire stop, field_idle, composite_idle;
  sf_field #(
      .CACHE_BYTES(CACHE_BYTES),
      .CACHE_WAYS (CACHE_WAYS),
      .GRID       (GRID),
      .PLANES     (PLANES)
  ) u_field (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (soft_reset),
      .enable_i       (running),
      .cfg_we_i       (cfg_we),
      .cfg_addr_i     (cfg_addr),
      .cfg_data_i     (cfg_data),
      .trans_stop_i   (trans_stop),
      .max_samples_i  (max_samples),
      .base_i         (base),
      .planes_o       (planes),
      .bad_o          (bad_field),
      .s_valid_i      (s_axis_tvalid_i),
      .s_ready_o      (s_axis_tready_o),
      .s_data_i       (s_axis_tdata_i[241:0]),
      .s_first_i      (s_axis_tuser_i),
      .s_last_i       (s_axis_tlast_i),
      .error_order_o  (error_order),
      .m_axi_arvalid_o(m_axi_arvalid_o),
      .m_axi_arready_i(m_axi_arready_i),
      .m_axi_araddr_o (m_axi_araddr_o),
      .m_axi_rvalid_i (m_axi_rvalid_i),
      .m_axi_rdata_i  (m_axi_rdata_i),
      .m_axi_rresp_i  (m_axi_rresp_i),
      .error_memory_o (error_memory),
      .lookups_o      (lookups),
      .misses_o       (misses),
      .filled_o       (filled),
      .waits_o        (waits),
      .m_axis_tvalid_o(feature_valid),
      .m_axis_tready_i(feature_ready),
      .m_axis_tdata_o (feature_data),
      .m_axis_tuser_o (feature_user),
      .m_axis_tlast_o (feature_last),
      .valid_o        (item_valid),
      .take_i         (item_take),
      .first_o        (item_first),
      .last_o         (item_last),
      .empty_o        (item_empty),
      .decoded_o      (item_decoded),
      .delta_o        (delta),
      .weight_o       (weight),
      .distance_o     (distance),
      .stop_i         (stop),
      .idle_o         (field_idle)
  );

  // Two beats of eight bytes, incrementing; data, unprivileged, secure
  assign m_axi_arlen_o = 8'd1;
  assign m_axi_arsize_o = 3'd3;
  assign m_axi_arburst_o = 2'd1;
  assign m_axi_arprot_o = 3'd0;
  assign m_axi_rready_o = 1'b1;

  wire result_valid, result_ready, result_last;
  wire [63:0] result;
  sf_top #(
      .TAP          (TAP),
      .LANES        (LANES),
      .MACS         (MACS),
      .NEURONS      (NEURONS),
      .STEPS_AT_ONCE(STEPS_AT_ONCE)
  ) u_nets (
      .clk_i           (clk_i),
      .rst_ni          (rst_ni),
      .s_axil_awvalid_i(write_now && !write_ray),
      .s_axil_awready_o(net_awready),
      .s_axil_awaddr_i (s_axil_awaddr_i),
      .s_axil_wvalid_i (write_now && !write_ray),
      .s_axil_wready_o (net_wready),
      .s_axil_wdata_i  (s_axil_wdata_i),
      .s_axil_wstrb_i  (s_axil_wstrb_i),
      .s_axil_bvalid_o (net_bvalid),
      .s_axil_bready_i (s_axil_bready_i),
      .s_axil_bresp_o  (net_bresp),
      .s_axil_arvalid_i(read_now && !read_ray),
      .s_axil_arready_o(net_arready),
      .s_axil_araddr_i (s_axil_araddr_i),
      .s_axil_rvalid_o (net_rvalid),
      .s_axil_rready_i (s_axil_rready_i),
      .s_axil_rdata_o  (net_rdata),
      .s_axil_rresp_o  (net_rresp),
      .s_axis_tvalid_i (feature_valid),
      .s_axis_tready_o (feature_ready),
      .s_axis_tdata_i  (feature_data),
      .s_axis_tuser_i  (feature_user),
      .s_axis_tlast_i  (feature_last),
      .m_axis_tvalid_o (result_valid),
      .m_axis_tready_i (result_ready),
      .m_axis_tdata_o  (result),
      .m_axis_tlast_o  (result_last),
      .irq_o           (net_irq)
`ifndef SF_NO_TAP
      ,
      .tap_valid_o     (tap_valid_o),
      .tap_layer_o     (tap_layer_o),
      .tap_step_o      (tap_step_o),
      .tap_spikes_o    (tap_spikes_o),
      .tap_rows_o      (tap_rows_o),
      .tap_membrane_o  (tap_membrane_o)
`endif
  );

  // ---- results: the first beat waits here for the second
  reg [63:0] first_beat_q;
  wire composite_ready;
  wire composite_valid = item_valid && (!item_decoded || (result_valid && result_last));
  assign item_take = composite_valid && composite_ready;
  assign result_ready = !result_last || (item_take && item_decoded);
  always_ff @(posedge clk_i) if (result_valid && !result_last) first_beat_q <= result;

  wire [119:0] colour;
  wire [63:0] depth;
  wire [20:0] weight_sum, transmittance;
  wire [10:0] samples;
  sf_composite u_composite (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (soft_reset),
      .trans_stop_i   (trans_stop),
      .max_samples_i  (max_samples),
      .background_i   (background),
      .valid_i        (composite_valid),
      .ready_o        (composite_ready),
      .first_i        (item_first),
      .last_i         (item_last),
      .empty_i        (item_empty),
      .sigma_i        (first_beat_q[27:0]),
      .colour_i       ({result[51:32], result[19:0], first_beat_q[51:32]}),
      .delta_i        (delta),
      .distance_i     (distance),
      .weighed_i      (planes),
      .weight_i       (weight),
      .decoded_i      (item_decoded),
      .stop_o         (stop),
      .idle_o         (composite_idle),
      .valid_o        (m_axis_tvalid_o),
      .ready_i        (m_axis_tready_i),
      .colour_o       (colour),
      .depth_o        (depth),
      .weight_sum_o   (weight_sum),
      .transmittance_o(transmittance),
      .samples_o      (samples)
  );
  assign m_axis_tdata_o = {53'd0, samples, 11'd0, transmittance, 11'd0, weight_sum, depth, 24'd0, colour[119:80], 24'd0,
                           colour[79:40], 24'd0, colour[39:0]};
  assign active = !field_idle || !composite_idle;
  `SF_REFUSE(GRID == 0 && PLANES == 0, "neither GRID nor PLANES: a build has one field at least")
  // See sf_top: marching and compositing are written for these widths.
  initial begin
    if (sf_arch_pkg::POS_FRAC != 24 || sf_arch_pkg::DELTA_FRAC != 24 || sf_arch_pkg::TRANS_FRAC != 20)
      $error("arch.def has other widths than this RTL is written for");
  end
  wire unused_ok = &{1'b0, m_axi_rlast_i, s_axis_tdata_i[255:242], first_beat_q[63:52], first_beat_q[31:28]};
endmodule

`default_nettype wire
