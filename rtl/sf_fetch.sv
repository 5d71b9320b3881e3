// Lines of 16 bytes from a memory behind an AXI4 read port: asked for one by one, they come in the order of the requests.
// Bursts of two beats of 64 bits, one ID. Room for a line is reserved before it is asked for, so the read channel never
// has to wait; it is free again two cycles after the line was popped. The line on offer and ready_o stand in registers.
// After a clear the memory still answers what was asked of it, and a request on offer stays, as AXI demands. Those lines are
// dropped, and nothing is asked before the last of them has come.
`default_nettype none

module sf_fetch #(
    parameter integer LOG2_LINES = 5  // that are on their way or wait here
) (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    input  wire [ 31:0] base_i,             // of line 0, a multiple of 16
    input  wire         ask_i,
    output wire         ready_o,
    input  wire [ 27:0] line_i,
    output wire         valid_o,
    input  wire         pop_i,
    output wire [127:0] data_o,
    output wire         filled_o,           // a line has come
    output wire         error_o,            // an answer other than OKAY, for a line that is not dropped
    // AXI4
    output wire         m_axi_arvalid_o,
    input  wire         m_axi_arready_i,
    output wire [ 31:0] m_axi_araddr_o,
    input  wire         m_axi_rvalid_i,
    input  wire [ 63:0] m_axi_rdata_i,
    input  wire [  1:0] m_axi_rresp_i
);
  reg ask_q, second_q, pop_q, ready_q;
  reg [27:0] address_q;
  reg [63:0] first_half_q;
  reg [LOG2_LINES:0] reserved_q, owed_q, stale_q;
  wire draining = stale_q != '0;
  assign ready_o = ready_q;
  wire take = ask_i && ready_q && !clear_i;
  wire end_of_line = m_axi_rvalid_i && second_q;
  wire push = end_of_line && !draining;
  wire [LOG2_LINES:0] owed = owed_q + {{LOG2_LINES{1'b0}}, take} - {{LOG2_LINES{1'b0}}, end_of_line};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {ask_q, second_q, pop_q, ready_q} <= 4'd0;
      reserved_q <= '0;
      owed_q <= '0;
      stale_q <= '0;
    end else begin
      ask_q <= take || (ask_q && !m_axi_arready_i);
      ready_q <= !take && !(ask_q && !m_axi_arready_i) && !reserved_q[LOG2_LINES] && !draining && !clear_i;
      if (m_axi_rvalid_i) second_q <= !second_q;
      owed_q <= owed;
      pop_q <= pop_i && !clear_i;
      if (clear_i) begin
        reserved_q <= '0;
        stale_q <= owed;
      end else begin
        reserved_q <= reserved_q + {{LOG2_LINES{1'b0}}, take} - {{LOG2_LINES{1'b0}}, pop_q};
        if (draining && end_of_line) stale_q <= stale_q - 1'b1;
      end
    end
  end
  always_ff @(posedge clk_i) begin
    if (take) address_q <= base_i[31:4] + line_i;
    if (m_axi_rvalid_i) first_half_q <= m_axi_rdata_i;
  end

  wire line_valid;
  wire [127:0] line;
  reg valid_q;
  reg [127:0] data_q;
  wire line_take = line_valid && (!valid_q || pop_i);
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid_q <= 1'b0;
    else valid_q <= !clear_i && (line_take || (valid_q && !pop_i));
  end
  always_ff @(posedge clk_i) if (line_take) data_q <= line;
  assign valid_o = valid_q;
  assign data_o = data_q;
  sf_fifo #(
      .WIDTH     (128),
      .LOG2_DEPTH(LOG2_LINES)
  ) u_lines (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (push),
      .data_i ({m_axi_rdata_i, first_half_q}),
      .valid_o(line_valid),
      .pop_i  (line_take),
      .data_o (line)
  );
  assign filled_o = push;
  assign error_o = m_axi_rvalid_i && m_axi_rresp_i != 2'd0 && !draining && !clear_i;
  assign m_axi_arvalid_o = ask_q;
  assign m_axi_araddr_o = {address_q, 4'd0};
  wire unused_ok = &{1'b0, base_i[3:0]};
endmodule

`default_nettype wire
