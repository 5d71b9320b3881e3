// Frames from bytes. A frame lies between two END bytes; END and ESC within it are written as two bytes. Four bytes of header,
// words of payload, CRC-32 of all of it, little-endian. Mirror: sim/board/frame.c
//
//   header   7:0 number, 15:8 command, 31:16 words of payload
//
// A frame is handed on when it is whole: nothing of a damaged one is ever seen behind this module. What is wrong with it is
// told instead. Until it is released, further bytes are dropped, and with them the frame that they are of.
`default_nettype none

module sf_link_rx (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        valid_i,
    input  wire [ 7:0] data_i,
    input  wire        broken_i,
    output wire        frame_o,    // a frame, or what was wrong with one, until it is released
    output wire [ 2:0] wrong_o,    // 0: nothing
    output wire [31:0] header_o,
    input  wire        release_i,
    input  wire [ 8:0] address_i,  // of the payload's words, from 1 on
    output wire [31:0] word_o      // two cycles later
);
  localparam [7:0] END = 8'hc0, ESC = 8'hdb, ESC_END = 8'hdc, ESC_ESC = 8'hdd;
  localparam [2:0] WRONG_BYTE = 3'd1, WRONG_LONG = 3'd2, WRONG_LENGTH = 3'd3, WRONG_CRC = 3'd4;
  localparam [31:0] RESIDUE = 32'hdebb20e3;  // of a frame with its CRC

  reg frame_q, skip_q, escaped_q, broken_q, long_q, store_q;
  reg [2:0] wrong_q;
  reg [31:0] header_q, word_q, read_q, out_q;
  reg [9:0] words_q;  // whole ones
  reg [1:0] bytes_q;  // of the next one
  (* no_rw_check *) reg [31:0] frame_mem_q[0:511];

  wire is_end = data_i == END;
  wire is_escape = data_i == ESC;
  wire is_data = valid_i && !frame_q && !skip_q && !is_end && !is_escape;
  wire bad_escape = escaped_q ? data_i != ESC_END && data_i != ESC_ESC : 1'b0;
  wire [7:0] plain = !escaped_q ? data_i : data_i == ESC_END ? END : ESC;
  wire empty = words_q == '0 && bytes_q == '0 && !broken_q && !escaped_q;
  wire finish = valid_i && is_end && !frame_q && !skip_q && !empty;
  wire fresh = release_i || (valid_i && is_end && !frame_q);

  wire [31:0] crc;
  wire crc_busy;
  sf_link_crc u_crc (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(fresh),
      .valid_i(is_data),
      .data_i (plain),
      .busy_o (crc_busy),
      .crc_o  (crc)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {frame_q, skip_q, escaped_q, broken_q, long_q, store_q} <= 6'b010000;
      wrong_q <= '0;
      words_q <= '0;
      bytes_q <= '0;
    end else begin
      store_q <= is_data && bytes_q == 2'd3 && !words_q[9];
      if (store_q) words_q <= words_q + 1'b1;
      if (valid_i && (frame_q || skip_q)) skip_q <= !is_end;
      if (valid_i && !frame_q && !skip_q && !is_end) begin
        escaped_q <= is_escape && !escaped_q;
        if (broken_i || bad_escape || (is_escape && escaped_q)) broken_q <= 1'b1;
      end
      if (is_data) begin
        bytes_q <= bytes_q + 1'b1;
        if (words_q[9]) long_q <= 1'b1;
      end
      if (finish) begin
        frame_q <= 1'b1;
        wrong_q <= broken_q || escaped_q ? WRONG_BYTE : long_q ? WRONG_LONG
            : bytes_q != 2'd0 || {6'd0, words_q} != header_q[31:16] + 16'd2 ? WRONG_LENGTH
            : crc != RESIDUE ? WRONG_CRC : 3'd0;
      end
      if (release_i) frame_q <= 1'b0;
      if (fresh) begin
        {escaped_q, broken_q, long_q} <= 3'b000;
        words_q <= '0;
        bytes_q <= '0;
      end
    end
  end
  always_ff @(posedge clk_i) begin
    if (is_data) word_q <= {plain, word_q[31:8]};
    if (store_q) frame_mem_q[words_q[8:0]] <= word_q;
    if (store_q && words_q == '0) header_q <= word_q;
    read_q <= frame_mem_q[address_i];
    out_q <= read_q;
  end
  assign frame_o = frame_q;
  assign wrong_o = wrong_q;
  assign header_o = header_q;
  assign word_o = out_q;
  wire unused_ok = &{1'b0, crc_busy};
endmodule

`default_nettype wire
