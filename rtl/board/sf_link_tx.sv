// Bytes of a frame, as sf_link_rx describes it. The payload's words are read from a memory while they are sent.
// Mirror: sim/board/frame.c
`default_nettype none

module sf_link_tx (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        start_i,    // with the header, while it is not busy
    input  wire [31:0] header_i,
    output wire        busy_o,
    output wire [ 8:0] address_o,  // of the payload's words, from 0 on
    input  wire [31:0] word_i,     // a cycle later
    output wire        valid_o,
    input  wire        ready_i,
    output wire [ 7:0] data_o
);
  localparam [7:0] END = 8'hc0, ESC = 8'hdb, ESC_END = 8'hdc, ESC_ESC = 8'hdd;
  localparam [2:0] IDLE = 0, BEGIN = 1, LOAD = 2, BYTE = 3, WAIT = 4, CLOSE = 5;
  reg [2:0] state_q;
  reg [31:0] word_q;
  reg [1:0] byte_q;
  reg [15:0] words_q;  // of the payload, not yet sent
  reg [8:0] address_q;
  reg head_q, crc_q, escaped_q, settle_q;

  wire [7:0] plain = word_q[7:0];
  wire special = plain == END || plain == ESC;
  wire ends = state_q == BEGIN || state_q == CLOSE;
  assign valid_o = ends || state_q == BYTE;
  assign data_o = ends ? END : !special ? plain : !escaped_q ? ESC : plain == END ? ESC_END : ESC_ESC;
  wire sent = valid_o && ready_i;
  wire byte_sent = state_q == BYTE && sent && (!special || escaped_q);

  wire crc_busy;
  wire [31:0] crc;
  sf_link_crc u_crc (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(start_i),
      .valid_i(byte_sent && !crc_q),
      .data_i (plain),
      .busy_o (crc_busy),
      .crc_o  (crc)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      byte_q <= '0;
      words_q <= '0;
      address_q <= '0;
      {head_q, crc_q, escaped_q, settle_q} <= 4'd0;
    end else begin
      case (state_q)
        IDLE:
        if (start_i) begin
          state_q <= BEGIN;
          words_q <= header_i[31:16];
          address_q <= '0;
          {head_q, crc_q, escaped_q} <= 3'b100;
        end
        BEGIN: if (sent) state_q <= LOAD;
        LOAD:
        if (!crc_busy) begin
          state_q <= BYTE;
          byte_q <= '0;
          crc_q <= !head_q && words_q == '0;
          head_q <= 1'b0;
          if (!head_q && words_q != '0) begin
            words_q <= words_q - 1'b1;
            address_q <= address_q + 1'b1;
          end
        end
        BYTE:
        if (sent) begin
          escaped_q <= special && !escaped_q;
          if (byte_sent) begin
            byte_q <= byte_q + 1'b1;
            settle_q <= 1'b1;
            if (byte_q == 2'd3) state_q <= crc_q ? CLOSE : WAIT;
          end
        end
        WAIT: begin  // the CRC takes the last byte, and the memory the address
          settle_q <= 1'b0;
          if (!settle_q && !crc_busy) state_q <= LOAD;
        end
        default: if (sent) state_q <= IDLE;
      endcase
    end
  end
  always_ff @(posedge clk_i) begin
    if (state_q == IDLE) word_q <= header_i;
    else if (state_q == LOAD && !head_q) word_q <= words_q == '0 ? ~crc : word_i;
    else if (byte_sent) word_q <= {8'd0, word_q[31:8]};
  end
  assign busy_o = state_q != IDLE;
  assign address_o = address_q;
endmodule

`default_nettype wire
