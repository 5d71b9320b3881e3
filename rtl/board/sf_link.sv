// The host's way in: frames over a serial line become accesses to registers (AXI4-Lite), words of the field's memory, samples of
// rays and pixels. Mirror: sim/board/link.c
//
// The host sends a command and waits for its answer, which has the same number and the command + 128. Numbers go up by one. A
// number that comes once more gets the same answer once more and does nothing, so a host that heard no answer asks again. A
// frame that was damaged, or is not the next, does nothing: its answer is the command 0xee with, in place of a number, why.
// HELLO alone is always obeyed: its number begins the count. It drops samples and pixels that an earlier host left.
// Frames and their numbers are here, the commands in sf_link_commands.
`default_nettype none

module sf_link #(
    parameter integer CLOCK_HZ = 50000000,
    parameter integer BAUD = 3000000,
    parameter integer MEMORY_BYTES = 131072
) (
    input  wire          clk_i,
    input  wire          rst_ni,
    input  wire          rx_i,
    output wire          tx_o,
    // AXI4-Lite master
    output wire          m_axil_awvalid_o,
    input  wire          m_axil_awready_i,
    output wire [  12:0] m_axil_awaddr_o,
    output wire          m_axil_wvalid_o,
    input  wire          m_axil_wready_i,
    output wire [  31:0] m_axil_wdata_o,
    input  wire          m_axil_bvalid_i,
    output wire          m_axil_bready_o,
    input  wire [   1:0] m_axil_bresp_i,
    output wire          m_axil_arvalid_o,
    input  wire          m_axil_arready_i,
    output wire [  12:0] m_axil_araddr_o,
    input  wire          m_axil_rvalid_i,
    output wire          m_axil_rready_o,
    input  wire [  31:0] m_axil_rdata_i,
    input  wire [   1:0] m_axil_rresp_i,
    // the field's memory
    output wire          memory_we_o,
    output wire [  14:0] memory_address_o,
    output wire [  63:0] memory_data_o,
    // samples of rays, pixels
    output wire          m_axis_tvalid_o,
    input  wire          m_axis_tready_i,
    output wire [ 255:0] m_axis_tdata_o,
    output wire          m_axis_tuser_o,
    output wire          m_axis_tlast_o,
    input  wire          s_axis_tvalid_i,
    output wire          s_axis_tready_o,
    input  wire [ 383:0] s_axis_tdata_i,
    input  wire          irq_i,
    // for lamps
    output wire          busy_o,
    output wire          damaged_o
);
  localparam [7:0] REFUSAL = 8'hee;
  localparam [7:0] WRONG_GREETING = 5, WRONG_ORDER = 6, WRONG_COMMAND = 7;

  // ---- bytes and frames
  wire byte_valid, byte_broken, frame, release_frame, send, sending, tx_valid, tx_ready;
  wire [7:0] byte_data, tx_data;
  wire [2:0] wrong;
  wire [31:0] header, word, answer_header;
  wire [8:0] address;
  reg [31:0] answer_word_q;
  wire [8:0] answer_address;
  sf_uart_rx #(
      .CLOCK_HZ(CLOCK_HZ),
      .BAUD    (BAUD)
  ) u_uart_rx (
      .clk_i   (clk_i),
      .rst_ni  (rst_ni),
      .rx_i    (rx_i),
      .valid_o (byte_valid),
      .data_o  (byte_data),
      .broken_o(byte_broken)
  );
  sf_link_rx u_rx (
      .clk_i    (clk_i),
      .rst_ni   (rst_ni),
      .valid_i  (byte_valid),
      .data_i   (byte_data),
      .broken_i (byte_broken),
      .frame_o  (frame),
      .wrong_o  (wrong),
      .header_o (header),
      .release_i(release_frame),
      .address_i(address),
      .word_o   (word)
  );
  sf_link_tx u_tx (
      .clk_i    (clk_i),
      .rst_ni   (rst_ni),
      .start_i  (send),
      .header_i (answer_header),
      .busy_o   (sending),
      .address_o(answer_address),
      .word_i   (answer_word_q),
      .valid_o  (tx_valid),
      .ready_i  (tx_ready),
      .data_o   (tx_data)
  );
  sf_uart_tx #(
      .CLOCK_HZ(CLOCK_HZ),
      .BAUD    (BAUD)
  ) u_uart_tx (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .valid_i(tx_valid),
      .ready_o(tx_ready),
      .data_i (tx_data),
      .tx_o   (tx_o)
  );

  // ---- the answer
  wire answer_we;
  wire [8:0] answer_at;
  wire [31:0] answer_data;
  wire [15:0] answer_words;
  (* no_rw_check *) reg [31:0] answer_mem_q[0:511];
  always_ff @(posedge clk_i) begin
    if (answer_we) answer_mem_q[answer_at] <= answer_data;
    answer_word_q <= answer_mem_q[answer_address];
  end

  // ---- the frame at work
  localparam [2:0] S_IDLE = 0, S_JUDGE = 1, S_WORK = 2, S_SEND = 3, S_SENDING = 4, S_REFUSE = 5;
  reg [2:0] state_q;
  reg [1:0] wait_q;
  reg greeted_q, kept_q;  // kept_q: there is an answer that can be given again
  reg [7:0] number_q, command_q, refusal_q;
  wire known, greeting, done;
  wire [7:0] number = header[7:0];
  wire again = greeted_q && kept_q && number == number_q && !greeting;
  wire in_order = greeting || (greeted_q && number == number_q + 8'd1);
  wire sound = wrong == 3'd0 && known;
  wire start = state_q == S_JUDGE && sound && !again && in_order;
  assign release_frame = (state_q == S_SENDING || state_q == S_REFUSE) && !sending && wait_q == 2'd0;
  assign send = (state_q == S_SEND || state_q == S_REFUSE) && wait_q == 2'd3;
  assign answer_header = state_q == S_REFUSE ? {16'd0, REFUSAL, refusal_q} : {answer_words, 8'h80 | command_q, number_q};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= S_IDLE;
      {greeted_q, kept_q} <= 2'd0;
      {number_q, command_q, refusal_q} <= '0;
      wait_q <= '0;
    end else begin
      if (wait_q != 2'd0) wait_q <= wait_q - 1'b1;
      case (state_q)
        S_IDLE: if (frame) state_q <= S_JUDGE;
        S_JUDGE: begin
          wait_q <= 2'd3;
          refusal_q <= wrong != 3'd0 ? {5'd0, wrong} : !known ? WRONG_COMMAND : !greeted_q ? WRONG_GREETING : WRONG_ORDER;
          state_q <= start ? S_WORK : sound && again ? S_SEND : S_REFUSE;
          if (start) begin
            number_q <= number;
            command_q <= header[15:8];
            kept_q <= 1'b0;
            if (greeting) greeted_q <= 1'b1;
          end
        end
        S_WORK:
        if (done) begin
          kept_q <= 1'b1;
          wait_q <= 2'd3;
          state_q <= S_SEND;
        end
        S_SEND:
        if (send) begin
          wait_q <= 2'd2;
          state_q <= S_SENDING;
        end
        S_SENDING: if (release_frame) state_q <= S_IDLE;
        S_REFUSE: if (release_frame) state_q <= S_IDLE;
        default: state_q <= S_IDLE;
      endcase
    end
  end

  sf_link_commands #(
      .CLOCK_HZ    (CLOCK_HZ),
      .MEMORY_BYTES(MEMORY_BYTES)
  ) u_commands (
      .clk_i           (clk_i),
      .rst_ni          (rst_ni),
      .command_i       (header[15:8]),
      .payload_i       (header[31:16]),
      .known_o         (known),
      .greeting_o      (greeting),
      .start_i         (start),
      .done_o          (done),
      .address_o       (address),
      .word_i          (word),
      .answer_we_o     (answer_we),
      .answer_at_o     (answer_at),
      .answer_data_o   (answer_data),
      .answer_words_o  (answer_words),
      .m_axil_awvalid_o(m_axil_awvalid_o),
      .m_axil_awready_i(m_axil_awready_i),
      .m_axil_awaddr_o (m_axil_awaddr_o),
      .m_axil_wvalid_o (m_axil_wvalid_o),
      .m_axil_wready_i (m_axil_wready_i),
      .m_axil_wdata_o  (m_axil_wdata_o),
      .m_axil_bvalid_i (m_axil_bvalid_i),
      .m_axil_bready_o (m_axil_bready_o),
      .m_axil_bresp_i  (m_axil_bresp_i),
      .m_axil_arvalid_o(m_axil_arvalid_o),
      .m_axil_arready_i(m_axil_arready_i),
      .m_axil_araddr_o (m_axil_araddr_o),
      .m_axil_rvalid_i (m_axil_rvalid_i),
      .m_axil_rready_o (m_axil_rready_o),
      .m_axil_rdata_i  (m_axil_rdata_i),
      .m_axil_rresp_i  (m_axil_rresp_i),
      .memory_we_o     (memory_we_o),
      .memory_address_o(memory_address_o),
      .memory_data_o   (memory_data_o),
      .m_axis_tvalid_o (m_axis_tvalid_o),
      .m_axis_tready_i (m_axis_tready_i),
      .m_axis_tdata_o  (m_axis_tdata_o),
      .m_axis_tuser_o  (m_axis_tuser_o),
      .m_axis_tlast_o  (m_axis_tlast_o),
      .s_axis_tvalid_i (s_axis_tvalid_i),
      .s_axis_tready_o (s_axis_tready_o),
      .s_axis_tdata_i  (s_axis_tdata_i),
      .irq_i           (irq_i)
  );

  assign busy_o = state_q != S_IDLE;
  assign damaged_o = state_q == S_REFUSE;
endmodule

`default_nettype wire
