// What the commands of the host do, each a frame's payload: registers (AXI4-Lite), words of the field's memory, samples of rays,
// pixels. Mirror: sim/board/link.c, sim/board/board.c
//
//   command     payload                              answer; its first word is always a status: 0, 1 size, 2 no answer
//   1 HELLO     a word                               the same word, LINK, bytes of the memory, Hz, words of a payload
//   2 WRITE     { count 31:16, register 15:0, count words }...   31:16 refused, 15:0 written; the first that was refused
//   3 READ      register, count                      31:16 refused; the registers from there on
//   4 MEMORY    first word of eight bytes, words     -
//   5 STREAM    31:16 patience, 1024 cycles; 15:0 pixels to wait for; beats of eight words
//               31:16 pixels, 15:0 beats taken; 31 patience was at its end, 0 interrupt; pixels of twelve words
//
// A beat is sf_ray_top's, with tuser in bit 254 and tlast in bit 255.
// start_i with a command that is known begins it; done_o comes in its last cycle. Command and payload stay until then.
`default_nettype none

module sf_link_commands #(
    parameter integer CLOCK_HZ = 50000000,
    parameter integer MEMORY_BYTES = 131072
) (
    input  wire          clk_i,
    input  wire          rst_ni,
    input  wire [   7:0] command_i,
    input  wire [  15:0] payload_i,         // words
    output wire          known_o,
    output wire          greeting_o,        // it is HELLO
    input  wire          start_i,
    output wire          done_o,
    output wire [   8:0] address_o,         // of a word of the payload, from 1 on
    input  wire [  31:0] word_i,            // two cycles later
    // words of the answer
    output wire          answer_we_o,
    output wire [   8:0] answer_at_o,
    output wire [  31:0] answer_data_o,
    output wire [  15:0] answer_words_o,
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
    input  wire          irq_i
);
  localparam [7:0] HELLO = 1, WRITE = 2, READ = 3, MEMORY = 4, STREAM = 5;
  localparam [31:0] LINK = 32'h5346_0001;  // "SF", the version of this protocol
  localparam [31:0] OK = 0, SIZE = 1, SILENT = 2;
  localparam integer PAYLOAD = 508;  // words, of a frame in either direction
  localparam integer PIXELS = 42;  // of the queue; an answer has room for as many
  localparam integer MEMORY_WORDS = MEMORY_BYTES / 8;

  localparam [4:0] S_IDLE = 0, S_FETCH = 1, S_HELLO = 2, S_SEGMENT = 3, S_WRITE = 4, S_WRITING = 5, S_READ_FROM = 6,
      S_READ_COUNT = 7, S_READ = 8, S_READING = 9, S_MEMORY = 10, S_MEMORY_LOW = 11, S_MEMORY_HIGH = 12, S_STREAM = 13,
      S_ROOM = 14, S_BEAT = 15, S_PIXELS = 16, S_COUNT = 17, S_EXTRA = 18, S_PIXEL = 19, S_COPY = 20, S_STATUS = 21;
  reg [4:0] state_q, after_q;  // after_q: what follows a word of the frame
  reg [1:0] wait_q;
  reg [8:0] at_q;              // word of the payload
  reg [15:0] words_q;          // of the payload: left
  reg [15:0] answer_words_q;   // of the answer
  reg [31:0] status_q, extra_q;
  reg [15:0] count_q, done_q, refused_q;
  reg [12:0] register_q, patience_q;  // patience_q: cycles until a register is given up
  assign known_o = command_i >= HELLO && command_i <= STREAM && payload_i != 16'd0 && payload_i <= PAYLOAD[15:0];
  assign greeting_o = command_i == HELLO;
  assign done_o = state_q == S_STATUS;
  assign address_o = at_q;

  // the answer
  reg answer_we_q;
  reg [8:0] answer_at_q;
  reg [31:0] answer_data_q;
  assign answer_we_o = answer_we_q;
  assign answer_at_o = answer_at_q;
  assign answer_data_o = answer_data_q;
  assign answer_words_o = answer_words_q;

  // registers
  reg awvalid_q, wvalid_q, arvalid_q;
  reg [31:0] value_q;
  assign m_axil_awvalid_o = awvalid_q;
  assign m_axil_awaddr_o = register_q;
  assign m_axil_wvalid_o = wvalid_q;
  assign m_axil_wdata_o = value_q;
  assign m_axil_bready_o = state_q == S_WRITING;
  assign m_axil_arvalid_o = arvalid_q;
  assign m_axil_araddr_o = register_q;
  assign m_axil_rready_o = state_q == S_READING;

  // the memory
  reg [31:0] index_q;
  reg memory_we_q;
  assign memory_we_o = memory_we_q;
  assign memory_address_o = index_q[14:0];
  assign memory_data_o = {answer_data_q, value_q};

  // samples of rays
  reg beat_valid_q;
  reg [255:0] beat_q;
  reg [2:0] beat_word_q;
  assign m_axis_tvalid_o = beat_valid_q;
  assign m_axis_tdata_o = {2'd0, beat_q[253:0]};
  assign m_axis_tuser_o = beat_q[254];
  assign m_axis_tlast_o = beat_q[255];

  // pixels
  reg [3:0] copied_q;
  wire [5:0] pixels;
  wire [31:0] pixel_word;
  wire full;
  wire copy = state_q == S_COPY && wait_q == 2'd0;
  wire copied = copy && copied_q == 4'd11;
  sf_link_pixels #(
      .PIXELS(PIXELS)
  ) u_pixels (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .forget_i       (state_q == S_HELLO),
      .s_axis_tvalid_i(s_axis_tvalid_i),
      .s_axis_tready_o(s_axis_tready_o),
      .s_axis_tdata_i (s_axis_tdata_i),
      .pixels_o       (pixels),
      .full_o         (full),
      .word_o         (pixel_word),
      .next_i         (copy),
      .last_i         (copied)
  );

  // how long a stream may stand still
  reg [15:0] limit_q;
  reg [25:0] still_q;
  reg [5:0] seen_q;
  wire tired = still_q[25:10] == limit_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {state_q, after_q} <= {S_IDLE, S_IDLE};
      {awvalid_q, wvalid_q, arvalid_q, memory_we_q, beat_valid_q, answer_we_q} <= 6'd0;
      wait_q <= '0;
    end else begin
      {memory_we_q, answer_we_q} <= 2'd0;
      if (wait_q != 2'd0) wait_q <= wait_q - 1'b1;
      if (m_axis_tready_i) beat_valid_q <= 1'b0;
      if (m_axil_awready_i) awvalid_q <= 1'b0;
      if (m_axil_wready_i) wvalid_q <= 1'b0;
      if (m_axil_arready_i) arvalid_q <= 1'b0;
      patience_q <= patience_q - 1'b1;
      still_q <= still_q + 1'b1;
      seen_q <= pixels;
      if (seen_q != pixels || (beat_valid_q && m_axis_tready_i)) still_q <= '0;
      case (state_q)
        S_IDLE: begin
          at_q <= 9'd1;
          words_q <= payload_i;
          if (start_i) begin
            status_q <= OK;
            {count_q, done_q, refused_q, extra_q} <= '0;
            answer_at_q <= '0;
            wait_q <= 2'd3;
            answer_words_q <= 16'd1;
            state_q <= S_FETCH;
            case (command_i)
              HELLO: after_q <= S_HELLO;
              WRITE: after_q <= S_SEGMENT;
              READ: after_q <= S_READ_FROM;
              MEMORY: after_q <= S_MEMORY;
              default: after_q <= S_STREAM;
            endcase
          end
        end
        // the next word of the payload
        S_FETCH:
        if (wait_q <= 2'd1) begin
          state_q <= after_q;
          at_q <= at_q + 1'b1;
          words_q <= words_q - 1'b1;
        end

        S_HELLO: begin
          beat_valid_q <= 1'b0;
          done_q <= done_q + 1'b1;
          answer_we_q <= 1'b1;
          answer_at_q <= answer_at_q + 1'b1;
          answer_words_q <= 16'd6;
          case (done_q[2:0])
            3'd0: answer_data_q <= word_i;
            3'd1: answer_data_q <= LINK;
            3'd2: answer_data_q <= MEMORY_BYTES;
            3'd3: answer_data_q <= CLOCK_HZ;
            default: answer_data_q <= PAYLOAD;
          endcase
          if (done_q == 16'd4) state_q <= S_STATUS;
        end

        S_SEGMENT: begin
          register_q <= word_i[12:0];
          count_q <= word_i[31:16];
          after_q <= S_WRITE;
          wait_q <= 2'd2;
          state_q <= S_FETCH;
          if (word_i[31:16] == 16'd0 || word_i[31:16] > words_q || word_i[15:13] != '0) begin
            status_q <= SIZE;
            state_q <= S_COUNT;
          end
        end
        S_WRITE: begin
          value_q <= word_i;
          {awvalid_q, wvalid_q} <= 2'b11;
          count_q <= count_q - 1'b1;
          patience_q <= '1;
          state_q <= S_WRITING;
        end
        S_WRITING: begin
          if (m_axil_bvalid_i) begin
            done_q <= done_q + 1'b1;
            if (m_axil_bresp_i != 2'd0) begin
              refused_q <= refused_q + 1'b1;
              if (refused_q == '0) extra_q <= {19'd0, register_q};
            end
            wait_q <= 2'd2;
            after_q <= count_q == '0 ? S_SEGMENT : S_WRITE;
            state_q <= words_q == '0 ? S_COUNT : S_FETCH;
          end else if (patience_q == '0) begin
            status_q <= SILENT;
            state_q <= S_COUNT;
          end
        end

        S_READ_FROM: begin
          register_q <= word_i[12:0];
          wait_q <= 2'd2;
          after_q <= S_READ_COUNT;
          state_q <= S_FETCH;
          if (words_q != 16'd1) begin
            status_q <= SIZE;
            state_q <= S_STATUS;
          end
        end
        S_READ_COUNT: begin
          count_q <= word_i[15:0];
          answer_at_q <= 9'd1;
          answer_words_q <= 16'd2 + word_i[15:0];
          state_q <= S_READ;
          if (word_i == '0 || word_i > PAYLOAD - 2) begin
            status_q <= SIZE;
            answer_words_q <= 16'd1;
            state_q <= S_STATUS;
          end
        end
        S_READ: begin
          arvalid_q <= 1'b1;
          count_q <= count_q - 1'b1;
          patience_q <= '1;
          state_q <= S_READING;
        end
        S_READING: begin
          if (m_axil_rvalid_i) begin
            if (m_axil_rresp_i != 2'd0) refused_q <= refused_q + 1'b1;
            answer_we_q <= 1'b1;
            answer_at_q <= answer_at_q + 1'b1;
            answer_data_q <= m_axil_rdata_i;
            register_q <= register_q + 13'd4;
            state_q <= count_q == '0 ? S_COUNT : S_READ;
          end else if (patience_q == '0) begin
            status_q <= SILENT;
            answer_words_q <= 16'd1;
            state_q <= S_STATUS;
          end
        end

        S_MEMORY: begin
          index_q <= word_i - 1'b1;
          wait_q <= 2'd2;
          after_q <= S_MEMORY_LOW;
          state_q <= S_FETCH;
          if (words_q == '0 || words_q[0] || word_i >= MEMORY_WORDS || word_i + {17'd0, words_q[15:1]} > MEMORY_WORDS) begin
            status_q <= SIZE;
            state_q <= S_STATUS;
          end
        end
        S_MEMORY_LOW: begin
          value_q <= word_i;
          wait_q <= 2'd2;
          after_q <= S_MEMORY_HIGH;
          state_q <= S_FETCH;
        end
        S_MEMORY_HIGH: begin
          answer_data_q <= word_i;
          index_q <= index_q + 1'b1;
          memory_we_q <= 1'b1;
          wait_q <= 2'd2;
          after_q <= S_MEMORY_LOW;
          state_q <= words_q == '0 ? S_STATUS : S_FETCH;
        end

        S_STREAM: begin
          limit_q <= word_i[31:16];
          count_q <= word_i[15:0];
          still_q <= '0;
          beat_word_q <= '0;
          state_q <= words_q == '0 ? S_PIXELS : S_ROOM;
          if (words_q[2:0] != '0 || word_i[15:0] > PIXELS[15:0]) begin
            status_q <= SIZE;
            state_q <= S_STATUS;
          end
        end
        S_ROOM: begin
          after_q <= S_BEAT;
          wait_q <= 2'd2;
          if (!beat_valid_q) state_q <= S_FETCH;
          else if (tired || full) state_q <= S_PIXELS;
        end
        S_BEAT: begin
          beat_word_q <= beat_word_q + 1'b1;
          wait_q <= 2'd2;
          state_q <= S_FETCH;
          if (beat_word_q == 3'd7) begin
            beat_valid_q <= 1'b1;
            done_q <= done_q + 1'b1;
            state_q <= words_q == '0 ? S_PIXELS : S_ROOM;
          end
        end
        S_PIXELS:  // as many as are asked for, or all that there is patience for
        if ({10'd0, pixels} >= count_q || tired) begin
          extra_q <= {{10'd0, pixels} < count_q || (words_q != '0 && !full), 30'd0, irq_i};
          count_q <= {10'd0, pixels};
          refused_q <= {10'd0, pixels};  // in the answer's upper half
          state_q <= S_COUNT;
        end

        // what was done, for commands that say it
        S_COUNT: begin
          answer_we_q <= 1'b1;
          answer_at_q <= 9'd1;
          answer_data_q <= {refused_q, done_q};
          state_q <= command_i == READ ? S_STATUS : S_EXTRA;
        end
        S_EXTRA: begin
          answer_we_q <= 1'b1;
          answer_at_q <= 9'd2;
          answer_data_q <= extra_q;
          answer_words_q <= 16'd3;
          state_q <= command_i == STREAM && status_q == OK ? S_PIXEL : S_STATUS;
        end
        S_PIXEL: begin
          copied_q <= '0;
          wait_q <= 2'd2;
          count_q <= count_q - 1'b1;
          state_q <= count_q == '0 ? S_STATUS : S_COPY;
        end
        S_COPY:
        if (copy) begin
          answer_we_q <= 1'b1;
          answer_at_q <= answer_at_q + 1'b1;
          answer_data_q <= pixel_word;
          answer_words_q <= answer_words_q + 1'b1;
          copied_q <= copied_q + 1'b1;
          wait_q <= 2'd2;
          if (copied) state_q <= S_PIXEL;
        end

        S_STATUS: begin
          answer_we_q <= 1'b1;
          answer_at_q <= '0;
          answer_data_q <= status_q;
          state_q <= S_IDLE;
        end
        default: state_q <= S_IDLE;
      endcase
    end
  end
  // Words come in the order of a beat's bytes.
  always_ff @(posedge clk_i) if (state_q == S_BEAT) beat_q <= {word_i, beat_q[255:32]};

  wire unused_ok = &{1'b0, index_q[31:15]};
endmodule

`default_nettype wire
