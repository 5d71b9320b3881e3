// The registers of sf_top over AXI4-Lite, for a first look at the block in any simulator: identification, contents after
// reset, a write read back, a refused write, a refused start that raises the interrupt, and its end.
`default_nettype none

module sf_registers_tb;
  reg clk = 1'b0, rst_n = 1'b0;
  always #5 clk = !clk;

  reg awvalid = 1'b0, wvalid = 1'b0, bready = 1'b0, arvalid = 1'b0, rready = 1'b0;
  reg [12:0] awaddr = 13'd0, araddr = 13'd0;
  reg [31:0] wdata = 32'd0;
  wire awready, wready, bvalid, arready, rvalid, irq;
  wire [1:0] bresp, rresp;
  wire [31:0] rdata;

  sf_top #(
      .TAP(0)
  ) dut (
      .clk_i           (clk),
      .rst_ni          (rst_n),
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
      .s_axis_tvalid_i (1'b0),
      .s_axis_tready_o (),
      .s_axis_tdata_i  (64'd0),
      .s_axis_tuser_i  (1'b0),
      .s_axis_tlast_i  (1'b0),
      .m_axis_tvalid_o (),
      .m_axis_tready_i (1'b1),
      .m_axis_tdata_o  (),
      .m_axis_tlast_o  (),
      .irq_o           (irq),
      .tap_valid_o     (),
      .tap_layer_o     (),
      .tap_step_o      (),
      .tap_spikes_o    (),
      .tap_rows_o      (),
      .tap_membrane_o  ()
  );

  integer checks = 0, failures = 0;

  // Pins change behind the falling edge, so that no simulator sees a race with the rising one.
  task write_register;
    input [12:0] offset;
    input [31:0] value;
    input [1:0] answer;
    begin
      @(negedge clk);
      awaddr = offset;
      wdata = value;
      awvalid = 1'b1;
      wvalid = 1'b1;
      bready = 1'b1;
      #1;
      while (!(awready && wready)) @(negedge clk);
      @(negedge clk);
      awvalid = 1'b0;
      wvalid = 1'b0;
      while (!bvalid) @(negedge clk);
      expect_equal(offset, {30'd0, bresp}, {30'd0, answer});
      @(negedge clk);
      bready = 1'b0;
    end
  endtask

  task read_register;
    input [12:0] offset;
    input [31:0] value;
    begin
      @(negedge clk);
      araddr = offset;
      arvalid = 1'b1;
      rready = 1'b1;
      #1;
      while (!arready) @(negedge clk);
      @(negedge clk);
      arvalid = 1'b0;
      while (!rvalid) @(negedge clk);
      expect_equal(offset, rdata, value);
      @(negedge clk);
      rready = 1'b0;
    end
  endtask

  task expect_equal;
    input [12:0] offset;
    input [31:0] got;
    input [31:0] expected;
    begin
      checks = checks + 1;
      if (got !== expected) begin
        failures = failures + 1;
        $display("register %h: %h, expected %h", offset, got, expected);
      end
    end
  endtask

  initial begin
    repeat (4) @(negedge clk);
    rst_n = 1'b1;
    read_register(sf_csr_pkg::ID, sf_csr_pkg::ID_RESET);
    read_register(sf_csr_pkg::VERSION, sf_csr_pkg::VERSION_RESET);
    read_register(sf_csr_pkg::CONFIG, sf_csr_pkg::CONFIG_RESET);
    read_register(sf_csr_pkg::ERROR, 32'd0);
    read_register(sf_csr_pkg::IRQ_PENDING, 32'd0);
    write_register(sf_csr_pkg::C2_THETA, 32'd1234567, 2'd0);
    read_register(sf_csr_pkg::C2_THETA, 32'd1234567);
    write_register(sf_csr_pkg::ID, 32'd1, 2'd2);
    read_register(sf_csr_pkg::ERROR, 32'd1 << sf_csr_pkg::ERROR_ADDRESS);
    write_register(sf_csr_pkg::ERROR, 32'hffffffff, 2'd0);
    read_register(sf_csr_pkg::ERROR, 32'd0);
    // A weight is stored and the address counts up.
    write_register(sf_csr_pkg::WEIGHT_ADDRESS, 32'd3 << sf_csr_pkg::WEIGHT_ADDRESS_LAYER, 2'd0);
    write_register(sf_csr_pkg::WEIGHT_DATA, 32'h01020304, 2'd0);
    read_register(sf_csr_pkg::WEIGHT_ADDRESS, (32'd3 << sf_csr_pkg::WEIGHT_ADDRESS_LAYER) | 32'd1);
    // An empty programming is refused.
    write_register(sf_csr_pkg::IRQ_PENDING, 32'hffffffff, 2'd0);
    write_register(sf_csr_pkg::IRQ_ENABLE, 32'd1 << sf_csr_pkg::IRQ_ENABLE_ERROR, 2'd0);
    expect_equal(13'd0, {31'd0, irq}, 32'd0);
    write_register(sf_csr_pkg::STEPS, 32'd0, 2'd0);
    write_register(sf_csr_pkg::CTRL, 32'd1 << sf_csr_pkg::CTRL_START, 2'd2);
    @(negedge clk);
    expect_equal(13'd0, {31'd0, irq}, 32'd1);
    write_register(sf_csr_pkg::ERROR, 32'hffffffff, 2'd0);
    write_register(sf_csr_pkg::IRQ_PENDING, 32'hffffffff, 2'd0);
    @(negedge clk);
    expect_equal(13'd0, {31'd0, irq}, 32'd0);
    $display("%0d checks, %0d failures", checks, failures);
    if (failures != 0) $fatal;
    $finish;
  end
  initial begin
    #100000 $display("no answer after 10000 cycles");
    $fatal;
  end
endmodule

`default_nettype wire
