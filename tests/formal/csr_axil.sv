// The register block as an AXI4-Lite slave, whatever its master and the rest of the block do: responses wait unchanged
// for their ready; every request is answered exactly once, a write in the third cycle after it was taken, a read in the
// second; a request is taken at once unless the one before it is still open; nothing happens but by an accepted write.
`default_nettype none

module csr_axil (
    input wire        clk_i,
    input wire        awvalid_i,
    input wire [12:0] awaddr_i,
    input wire        wvalid_i,
    input wire [31:0] wdata_i,
    input wire [ 3:0] wstrb_i,
    input wire        bready_i,
    input wire        arvalid_i,
    input wire [12:0] araddr_i,
    input wire        rready_i,
    input wire        active_i,
    input wire        counters_busy_i,
    input wire        error_packet_i,
    input wire        error_value_i,
    input wire [63:0] counter_i
);
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire awready, wready, bvalid, arready, rvalid, we, soft_reset, clear, snapshot;
  wire [1:0] bresp, rresp;
  wire [31:0] rdata;
  sf_csr u_dut (
      .clk_i          (clk_i),
      .rst_ni         (rst_n_q),
      .awvalid_i      (awvalid_i),
      .awready_o      (awready),
      .awaddr_i       (awaddr_i),
      .wvalid_i       (wvalid_i),
      .wready_o       (wready),
      .wdata_i        (wdata_i),
      .wstrb_i        (wstrb_i),
      .bvalid_o       (bvalid),
      .bready_i       (bready_i),
      .bresp_o        (bresp),
      .arvalid_i      (arvalid_i),
      .arready_o      (arready),
      .araddr_i       (araddr_i),
      .rvalid_o       (rvalid),
      .rready_i       (rready_i),
      .rdata_o        (rdata),
      .rresp_o        (rresp),
      .active_i       (active_i),
      .counters_busy_i(counters_busy_i),
      .error_packet_i (error_packet_i),
      .error_value_i  (error_value_i),
      .we_o           (we),
      .soft_reset_o   (soft_reset),
      .clear_o        (clear),
      .snapshot_o     (snapshot),
      .counter_i      (counter_i)
  );

  // Requests taken and not yet answered, and for how many cycles, 4 and more alike.
  reg write_open_q = 1'b0, read_open_q = 1'b0;
  reg [2:0] write_age_q = 3'd0, read_age_q = 3'd0;
  wire peek_taken_q, peek_done_q, peek_read_q;
  reg b_waits_q = 1'b0, r_waits_q = 1'b0;
  reg [1:0] bresp_q, rresp_q;
  reg [31:0] rdata_q;
  wire write_taken = awvalid_i && awready && wvalid_i && wready;
  wire read_taken = arvalid_i && arready;
  always @(posedge clk_i) begin
    if (rst_n_q) begin
      write_open_q <= write_taken || (write_open_q && !(bvalid && bready_i));
      read_open_q <= read_taken || (read_open_q && !(rvalid && rready_i));
      write_age_q <= write_taken ? 3'd1 : write_age_q == 3'd0 || write_age_q == 3'd4 ? write_age_q : write_age_q + 3'd1;
      read_age_q <= read_taken ? 3'd1 : read_age_q == 3'd0 || read_age_q == 3'd4 ? read_age_q : read_age_q + 3'd1;
      b_waits_q <= bvalid && !bready_i;
      r_waits_q <= rvalid && !rready_i;
    end
    bresp_q <= bresp;
    rresp_q <= rresp;
    rdata_q <= rdata;
  end

  always @* begin
    if (rst_n_q) begin
      write_answered_once : assert (bvalid == (write_open_q && write_age_q >= 3'd3));
      read_answered_once : assert (rvalid == (read_open_q && read_age_q >= 3'd2));
      stages : assert (peek_taken_q == (write_open_q && write_age_q == 3'd1) && peek_done_q == (write_open_q && write_age_q == 3'd2)
                       && peek_read_q == (read_open_q && read_age_q == 3'd1));
      young_is_open : assert ((write_open_q || write_age_q == 3'd0 || write_age_q >= 3'd3) && (read_open_q || read_age_q == 3'd0 || read_age_q >= 3'd2));
      ages : assert (write_age_q <= 3'd4 && read_age_q <= 3'd4 && (!write_open_q || write_age_q != 3'd0) && (!read_open_q || read_age_q != 3'd0));
      one_write_at_a_time : assert (!(write_taken && write_open_q));
      one_read_at_a_time : assert (!(read_taken && read_open_q));
      address_with_data : assert (!(awvalid_i && awready) == !(wvalid_i && wready));
      write_taken_at_once : assert (!(awvalid_i && wvalid_i && !write_open_q) || write_taken);
      read_taken_at_once : assert (!(arvalid_i && !read_open_q) || read_taken);
      bresp_waits : assert (!b_waits_q || (bvalid && bresp == bresp_q));
      rdata_waits : assert (!r_waits_q || (rvalid && rdata == rdata_q && rresp == rresp_q));
      response_is_okay_or_slverr : assert (!bvalid || bresp == 2'd0 || bresp == 2'd2);
      commands_by_write_only : assert ((write_open_q && write_age_q == 3'd2) || !(soft_reset || clear || snapshot));
      weights_by_write_only : assert (write_age_q == 3'd3 || !we);
    end
  end
endmodule

`default_nettype wire
