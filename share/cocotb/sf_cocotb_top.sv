// The block under test between buses that cocotbext-axi knows by name. The simulator makes the clock. SF_DUT names the
// block: ports of sf_top.
//
// A cycle of 10 ns: cocotb sees the edge of clk at 0 and reads what the block shows before its own edge at 1. What
// cocotb writes reaches the block at 2. So no simulator's order of events at one time matters.
// Every channel waits at random (sf_cocotb_waits.sv), often of 256 cycles. What is between the waits and the block is named blk_*.
// Address and data that are not on offer show other bits: a block that looks at them late is found out.
`timescale 1ns / 1ns
`ifndef SF_DUT
`define SF_DUT sf_top
`endif

module sf_cocotb_top;
  localparam integer LANES = sf_arch_pkg::LANES;

  reg clk /*verilator public_flat_rw*/ = 1'b0;
  reg rst_n /*verilator public_flat_rw*/ = 1'b0;

  reg [7:0] often /*verilator public_flat_rw*/ = 8'd0;
  reg [31:0] seed /*verilator public_flat_rw*/ = 32'd1;
  reg forget /*verilator public_flat_rw*/ = 1'b0;  // what waits in the queue

  reg s_axil_awvalid /*verilator public_flat_rw*/ = 1'b0;
  reg [12:0] s_axil_awaddr /*verilator public_flat_rw*/ = 13'd0;
  wire s_axil_awready /*verilator public_flat_rd*/;
  reg s_axil_wvalid /*verilator public_flat_rw*/ = 1'b0;
  reg [31:0] s_axil_wdata /*verilator public_flat_rw*/ = 32'd0;
  reg [3:0] s_axil_wstrb /*verilator public_flat_rw*/ = 4'd0;
  wire s_axil_wready /*verilator public_flat_rd*/;
  wire s_axil_bvalid /*verilator public_flat_rd*/;
  wire [1:0] s_axil_bresp /*verilator public_flat_rd*/;
  reg s_axil_bready /*verilator public_flat_rw*/ = 1'b0;
  reg s_axil_arvalid /*verilator public_flat_rw*/ = 1'b0;
  reg [12:0] s_axil_araddr /*verilator public_flat_rw*/ = 13'd0;
  wire s_axil_arready /*verilator public_flat_rd*/;
  wire s_axil_rvalid /*verilator public_flat_rd*/;
  wire [31:0] s_axil_rdata /*verilator public_flat_rd*/;
  wire [1:0] s_axil_rresp /*verilator public_flat_rd*/;
  reg s_axil_rready /*verilator public_flat_rw*/ = 1'b0;

  reg s_axis_tvalid /*verilator public_flat_rw*/ = 1'b0;
  wire s_axis_tready /*verilator public_flat_rd*/;
  reg [63:0] s_axis_tdata /*verilator public_flat_rw*/ = 64'd0;
  reg s_axis_tuser /*verilator public_flat_rw*/ = 1'b0;
  reg s_axis_tlast /*verilator public_flat_rw*/ = 1'b0;

  wire m_axis_tvalid /*verilator public_flat_rd*/;
  reg m_axis_tready /*verilator public_flat_rw*/ = 1'b0;
  wire [63:0] m_axis_tdata /*verilator public_flat_rd*/;
  wire m_axis_tlast /*verilator public_flat_rd*/;
  wire irq /*verilator public_flat_rd*/;

  wire tap_valid;
  wire [2:0] tap_layer, tap_step;
  wire [LANES-1:0] tap_spikes, tap_rows;
  wire [24*LANES-1:0] tap_membrane;

  wire rst_n_q;
  wire s_axil_awvalid_q;
  wire [12:0] s_axil_awaddr_q;
  wire s_axil_wvalid_q;
  wire [31:0] s_axil_wdata_q;
  wire [3:0] s_axil_wstrb_q;
  wire s_axil_bready_q;
  wire s_axil_arvalid_q;
  wire [12:0] s_axil_araddr_q;
  wire s_axil_rready_q;
  wire s_axis_tvalid_q;
  wire [63:0] s_axis_tdata_q;
  wire s_axis_tuser_q;
  wire s_axis_tlast_q;
  wire m_axis_tready_q;
  reg [135:0] held = 136'd0;
  assign {
      rst_n_q, s_axil_awvalid_q, s_axil_awaddr_q, s_axil_wvalid_q, s_axil_wdata_q, s_axil_wstrb_q,
      s_axil_bready_q, s_axil_arvalid_q, s_axil_araddr_q, s_axil_rready_q, s_axis_tvalid_q, s_axis_tdata_q,
      s_axis_tuser_q, s_axis_tlast_q, m_axis_tready_q
  } = held;

  reg dut_clk = 1'b0;
  always begin
    clk = 1'b1;
    #1 dut_clk = 1'b1;
    #1 held = {
      rst_n,
      s_axil_awvalid,
      s_axil_awaddr,
      s_axil_wvalid,
      s_axil_wdata,
      s_axil_wstrb,
      s_axil_bready,
      s_axil_arvalid,
      s_axil_araddr,
      s_axil_rready,
      s_axis_tvalid,
      s_axis_tdata,
      s_axis_tuser,
      s_axis_tlast,
      m_axis_tready
    };
    #3 clk = 1'b0;
    #1 dut_clk = 1'b0;
    #4;
  end

  wire [63:0] noise;
  wire [7:0] wait_now;
  sf_cocotb_noise u_noise (
      .clk_i (dut_clk),
      .rst_ni(rst_n_q),
      .seed_i(seed),
      .bits_o(noise)
  );
  wire queue_valid, queue_ready, blk_s_tuser, blk_s_tlast;
  wire [63:0] blk_s_tdata;
  sf_cocotb_queue u_queue (
      .clk_i  (dut_clk),
      .rst_ni (rst_n_q && !forget),
      .valid_i(s_axis_tvalid_q),
      .ready_o(s_axis_tready),
      .data_i ({s_axis_tlast_q, s_axis_tuser_q, s_axis_tdata_q}),
      .valid_o(queue_valid),
      .ready_i(queue_ready),
      .data_o ({blk_s_tlast, blk_s_tuser, blk_s_tdata})
  );

  wire blk_awvalid, blk_awready, blk_wvalid, blk_wready, blk_bvalid, blk_bready, blk_arvalid, blk_arready;
  wire blk_rvalid, blk_rready, blk_s_tvalid, blk_s_tready, blk_m_tvalid, blk_m_tready;
  genvar i;
  generate
    for (i = 0; i < 8; i = i + 1) begin : g_wait
      assign wait_now[i] = noise[8*i+:8] < often;
    end
  endgenerate
  // Now and then the next result has to come before anybody is ready for it.
  reg shy = 1'b0;
  always @(posedge dut_clk) if (!rst_n_q || (blk_m_tvalid && blk_m_tready)) shy <= wait_now[7];
  sf_cocotb_gate u_aw (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[0]), .shy_i(1'b0),
                     .valid_i(s_axil_awvalid_q), .ready_o(s_axil_awready), .valid_o(blk_awvalid), .ready_i(blk_awready));
  sf_cocotb_gate u_w (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[1]), .shy_i(1'b0),
                     .valid_i(s_axil_wvalid_q), .ready_o(s_axil_wready), .valid_o(blk_wvalid), .ready_i(blk_wready));
  sf_cocotb_gate u_b (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[2]), .shy_i(1'b0),
                     .valid_i(blk_bvalid), .ready_o(blk_bready), .valid_o(s_axil_bvalid), .ready_i(s_axil_bready_q));
  sf_cocotb_gate u_ar (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[3]), .shy_i(1'b0),
                     .valid_i(s_axil_arvalid_q), .ready_o(s_axil_arready), .valid_o(blk_arvalid), .ready_i(blk_arready));
  sf_cocotb_gate u_r (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[4]), .shy_i(1'b0),
                     .valid_i(blk_rvalid), .ready_o(blk_rready), .valid_o(s_axil_rvalid), .ready_i(s_axil_rready_q));
  sf_cocotb_gate u_s (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[5]), .shy_i(1'b0),
                     .valid_i(queue_valid), .ready_o(queue_ready), .valid_o(blk_s_tvalid), .ready_i(blk_s_tready));
  sf_cocotb_gate u_m (.clk_i(dut_clk), .rst_ni(rst_n_q), .wait_i(wait_now[6]), .shy_i(shy),
                     .valid_i(blk_m_tvalid), .ready_o(blk_m_tready), .valid_o(m_axis_tvalid), .ready_i(m_axis_tready_q));

  // Which channel had to wait: the bench says when one never did.
  reg [6:0] waited /*verilator public_flat_rd*/ = 7'd0;
  wire [6:0] offered = {
    blk_m_tvalid, queue_valid, blk_rvalid, s_axil_arvalid_q, blk_bvalid, s_axil_wvalid_q, s_axil_awvalid_q
  };
  wire [6:0] passed = {
    blk_m_tready, blk_s_tvalid, blk_rready, blk_arvalid, blk_bready, blk_wvalid, blk_awvalid
  };
  always @(posedge dut_clk) if (rst_n_q) waited <= waited | (offered & ~passed & wait_now[6:0]);

  `SF_DUT u_dut (
      .clk_i           (dut_clk),
      .rst_ni          (rst_n_q),
      .s_axil_awvalid_i(blk_awvalid),
      .s_axil_awready_o(blk_awready),
      .s_axil_awaddr_i (blk_awvalid ? s_axil_awaddr_q : ~s_axil_awaddr_q),
      .s_axil_wvalid_i (blk_wvalid),
      .s_axil_wready_o (blk_wready),
      .s_axil_wdata_i  (blk_wvalid ? s_axil_wdata_q : ~s_axil_wdata_q),
      .s_axil_wstrb_i  (s_axil_wstrb_q),
      .s_axil_bvalid_o (blk_bvalid),
      .s_axil_bready_i (blk_bready),
      .s_axil_bresp_o  (s_axil_bresp),
      .s_axil_arvalid_i(blk_arvalid),
      .s_axil_arready_o(blk_arready),
      .s_axil_araddr_i (blk_arvalid ? s_axil_araddr_q : ~s_axil_araddr_q),
      .s_axil_rvalid_o (blk_rvalid),
      .s_axil_rready_i (blk_rready),
      .s_axil_rdata_o  (s_axil_rdata),
      .s_axil_rresp_o  (s_axil_rresp),
      .s_axis_tvalid_i (blk_s_tvalid),
      .s_axis_tready_o (blk_s_tready),
      .s_axis_tdata_i  (blk_s_tvalid ? blk_s_tdata : ~blk_s_tdata),
      .s_axis_tuser_i  (blk_s_tuser),
      .s_axis_tlast_i  (blk_s_tlast),
      .m_axis_tvalid_o (blk_m_tvalid),
      .m_axis_tready_i (blk_m_tready),
      .m_axis_tdata_o  (m_axis_tdata),
      .m_axis_tlast_o  (m_axis_tlast),
      .irq_o           (irq),
      .tap_valid_o     (tap_valid),
      .tap_layer_o     (tap_layer),
      .tap_step_o      (tap_step),
      .tap_spikes_o    (tap_spikes),
      .tap_rows_o      (tap_rows),
      .tap_membrane_o  (tap_membrane)
  );

  // A result that waits has to stay as it is.
  reg unstable /*verilator public_flat_rd*/ = 1'b0;
  reg waits = 1'b0, waiting_last;
  reg [63:0] waiting_data;
  always @(posedge dut_clk) begin
    waits <= rst_n_q && blk_m_tvalid && !blk_m_tready;
    waiting_data <= m_axis_tdata;
    waiting_last <= m_axis_tlast;
    if (waits && (!blk_m_tvalid || m_axis_tdata != waiting_data || m_axis_tlast != waiting_last)) unstable <= 1'b1;
  end

  // An answer may not come before it is asked for.
  reg early /*verilator public_flat_rd*/ = 1'b0;
  reg [7:0] aw_open = 8'd0, w_open = 8'd0, ar_open = 8'd0;
  wire b_taken = blk_bvalid && blk_bready;
  always @(posedge dut_clk)
    if (!rst_n_q) begin
      early <= 1'b0;
      {aw_open, w_open, ar_open} <= 24'd0;
    end else begin
      if ((blk_bvalid && (aw_open == 8'd0 || w_open == 8'd0)) || (blk_rvalid && ar_open == 8'd0)) early <= 1'b1;
      aw_open <= aw_open + {7'd0, blk_awvalid && blk_awready} - {7'd0, b_taken};
      w_open <= w_open + {7'd0, blk_wvalid && blk_wready} - {7'd0, b_taken};
      ar_open <= ar_open + {7'd0, blk_arvalid && blk_arready} - {7'd0, blk_rvalid && blk_rready};
    end

  // A tap beat, held until the next one: {layer, step, spikes, rows}, and the membranes in four parts, because Verilator
  // gives 2048 bits at most of a signal. tap_beat changes with each beat.
  localparam integer PART = 6 * LANES;
  reg tap_beat /*verilator public_flat_rd*/ = 1'b0;
  reg [5+2*LANES:0] tap /*verilator public_flat_rd*/;
  reg [PART-1:0] tap_membrane_0 /*verilator public_flat_rd*/, tap_membrane_1 /*verilator public_flat_rd*/;
  reg [PART-1:0] tap_membrane_2 /*verilator public_flat_rd*/, tap_membrane_3 /*verilator public_flat_rd*/;
  always @(posedge dut_clk)
    if (tap_valid) begin
      tap <= {tap_layer, tap_step, tap_spikes, tap_rows};
      {tap_membrane_3, tap_membrane_2, tap_membrane_1, tap_membrane_0} <= tap_membrane;
      tap_beat <= !tap_beat;
    end
endmodule
