// What every board has: sf_ray_top, the link to the host and the field's memory, on one clock. A board's own top adds pins, clock
// and reset (ulx3s/ulx3s.sv).
`default_nettype none

module sf_board #(
    parameter integer CLOCK_HZ = 50000000,
    parameter integer BAUD = 3000000,
    parameter integer BANKS = 4,     // of 32 KiB of the field's memory
    parameter integer MACS = 32,     // these as sf_ray_top's
    parameter integer NEURONS = 4
) (
    input  wire       clk_i,
    input  wire       rst_ni,
    input  wire       rx_i,
    output wire       tx_o,
    output wire [3:0] lamps_o  // interrupt, damaged frame, command at work, sample or pixel waiting
);
  wire awvalid, awready, wvalid, wready, bvalid, bready, arvalid, arready, rvalid, rready;
  wire [12:0] awaddr, araddr;
  wire [31:0] wdata, rdata;
  wire [1:0] bresp, rresp;
  wire memory_we;
  wire [14:0] memory_address;
  wire [63:0] memory_data;
  wire ray_valid, ray_ready, ray_user, ray_last, pixel_valid, pixel_ready, irq, busy, damaged;
  wire [255:0] ray;
  wire [383:0] pixel;
  wire line_arvalid, line_arready, line_rvalid, line_rready, line_rlast;
  wire [31:0] line_araddr;
  wire [7:0] line_arlen;
  wire [2:0] line_arsize, line_arprot;
  wire [1:0] line_arburst, line_rresp;
  wire [63:0] line_rdata;

  sf_link #(
      .CLOCK_HZ    (CLOCK_HZ),
      .BAUD        (BAUD),
      .MEMORY_BYTES(32768 * BANKS)
  ) u_link (
      .clk_i           (clk_i),
      .rst_ni          (rst_ni),
      .rx_i            (rx_i),
      .tx_o            (tx_o),
      .m_axil_awvalid_o(awvalid),
      .m_axil_awready_i(awready),
      .m_axil_awaddr_o (awaddr),
      .m_axil_wvalid_o (wvalid),
      .m_axil_wready_i (wready),
      .m_axil_wdata_o  (wdata),
      .m_axil_bvalid_i (bvalid),
      .m_axil_bready_o (bready),
      .m_axil_bresp_i  (bresp),
      .m_axil_arvalid_o(arvalid),
      .m_axil_arready_i(arready),
      .m_axil_araddr_o (araddr),
      .m_axil_rvalid_i (rvalid),
      .m_axil_rready_o (rready),
      .m_axil_rdata_i  (rdata),
      .m_axil_rresp_i  (rresp),
      .memory_we_o     (memory_we),
      .memory_address_o(memory_address),
      .memory_data_o   (memory_data),
      .m_axis_tvalid_o (ray_valid),
      .m_axis_tready_i (ray_ready),
      .m_axis_tdata_o  (ray),
      .m_axis_tuser_o  (ray_user),
      .m_axis_tlast_o  (ray_last),
      .s_axis_tvalid_i (pixel_valid),
      .s_axis_tready_o (pixel_ready),
      .s_axis_tdata_i  (pixel),
      .irq_i           (irq),
      .busy_o          (busy),
      .damaged_o       (damaged)
  );
  sf_board_memory #(
      .BANKS(BANKS)
  ) u_memory (
      .clk_i     (clk_i),
      .rst_ni    (rst_ni),
      .we_i      (memory_we),
      .waddress_i(memory_address),
      .wdata_i   (memory_data),
      .arvalid_i (line_arvalid),
      .arready_o (line_arready),
      .araddr_i  (line_araddr),
      .rvalid_o  (line_rvalid),
      .rdata_o   (line_rdata),
      .rresp_o   (line_rresp),
      .rlast_o   (line_rlast)
  );
  sf_ray_top #(
      .TAP    (0),
      .MACS   (MACS),
      .NEURONS(NEURONS),
      .PLANES (0)
  ) u_rays (
      .clk_i           (clk_i),
      .rst_ni          (rst_ni),
      .s_axil_awvalid_i(awvalid),
      .s_axil_awready_o(awready),
      .s_axil_awaddr_i (awaddr),
      .s_axil_wvalid_i (wvalid),
      .s_axil_wready_o (wready),
      .s_axil_wdata_i  (wdata),
      .s_axil_wstrb_i  (4'hf),
      .s_axil_bvalid_o (bvalid),
      .s_axil_bready_i (bready),
      .s_axil_bresp_o  (bresp),
      .s_axil_arvalid_i(arvalid),
      .s_axil_arready_o(arready),
      .s_axil_araddr_i (araddr),
      .s_axil_rvalid_o (rvalid),
      .s_axil_rready_i (rready),
      .s_axil_rdata_o  (rdata),
      .s_axil_rresp_o  (rresp),
      .s_axis_tvalid_i (ray_valid),
      .s_axis_tready_o (ray_ready),
      .s_axis_tdata_i  (ray),
      .s_axis_tuser_i  (ray_user),
      .s_axis_tlast_i  (ray_last),
      .m_axis_tvalid_o (pixel_valid),
      .m_axis_tready_i (pixel_ready),
      .m_axis_tdata_o  (pixel),
      .m_axi_arvalid_o (line_arvalid),
      .m_axi_arready_i (line_arready),
      .m_axi_araddr_o  (line_araddr),
      .m_axi_arlen_o   (line_arlen),
      .m_axi_arsize_o  (line_arsize),
      .m_axi_arburst_o (line_arburst),
      .m_axi_arprot_o  (line_arprot),
      .m_axi_rvalid_i  (line_rvalid),
      .m_axi_rready_o  (line_rready),
      .m_axi_rdata_i   (line_rdata),
      .m_axi_rresp_i   (line_rresp),
      .m_axi_rlast_i   (line_rlast),
      .irq_o           (irq)
  );
  assign lamps_o = {irq, damaged, busy, ray_valid || pixel_valid};
  // The block asks for whole lines and has always room for them.
  wire unused_ok = &{1'b0, line_arlen, line_arsize, line_arburst, line_arprot, line_rready};
endmodule

`default_nettype wire
