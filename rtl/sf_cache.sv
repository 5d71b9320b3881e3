// The field's cache: lines of 16 bytes (8 entries) of the grid's memory, set-associative, LRU. Mirror: src/fx/cache.c
//
// A pair of entries per cycle: those of corners x and x + 1. One line for both is one look-up, else two, first x's. Lines of
// even and odd number lie in two banks, so two neighbours are looked up in one cycle; two lines in one bank take two.
//
//   pairs -> P  line of each entry
//            A  B  C  D    tags of both banks: found, or a way to replace; D asks for the lines that are missing
//            queue          look-ups with the place of their lines, in order
//            H              the head of the queue waits for its missing lines, which come in order, and stores them
//            R  E           the entries, from the banks' memories or the line that has just come
//
// Tags run ahead of the data by up to 2^LOG2_LOOKUPS look-ups, which hides as many cycles of the memory's time. What is found
// and what is not depends on the order of the pairs alone.
// With s_empty_i the cache is emptied before the pair: SETS / 2 cycles, none if it is empty still. A reset and a clear empty it.
// Answers come without back-pressure: whoever asks has room for them.
`default_nettype none
`include "sf_refuse.svh"

module sf_cache #(
    parameter integer CACHE_BYTES = 32768,  // a power of two, 1024 to 65536
    parameter integer CACHE_WAYS = 4,       // 1, 2, 4 or 8
    parameter integer LOG2_LOOKUPS = 7,     // room of the queue
    parameter integer LOG2_LINES = 5        // that are on their way or have come
) (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire [31:0] base_i,
    // pairs of entries in
    input  wire        s_valid_i,
    output wire        s_ready_o,
    input  wire        s_empty_i,
    input  wire [31:0] s_entry0_i,
    input  wire [31:0] s_entry1_i,
    // their contents out, in order
    output wire        m_valid_o,
    output wire [31:0] m_entries_o,       // {of x + 1, of x}
    output wire [127:0] m_line0_o,        // the line of x
    output wire [127:0] m_line1_o,        // and of x + 1
    // events
    output wire [ 1:0] lookups_o,
    output wire [ 1:0] misses_o,
    output wire        filled_o,
    output wire        waits_o,           // the head of the queue, for its line
    output wire        error_o,
    // AXI4
    output wire        m_axi_arvalid_o,
    input  wire        m_axi_arready_i,
    output wire [31:0] m_axi_araddr_o,
    input  wire        m_axi_rvalid_i,
    input  wire [63:0] m_axi_rdata_i,
    input  wire [ 1:0] m_axi_rresp_i
);
  localparam integer LINE_BITS = 28, BANK_LINE = LINE_BITS - 1;
  localparam integer BANK_LINES = CACHE_BYTES / 32;
  localparam integer SETS = BANK_LINES / CACHE_WAYS;
  localparam integer SET_BITS = $clog2(SETS), PLACE = $clog2(BANK_LINES);

  // ---- P: the lines of a pair
  localparam integer LOG2_PAIRS = 2;
  reg [LOG2_PAIRS:0] pairs_q;
  reg room_q;
  wire pair_valid, pair_empty, pair_take;
  wire [30:0] pair0, pair1;
  wire push_pair = s_valid_i && room_q;
  assign s_ready_o = room_q;
  wire [LOG2_PAIRS:0] pairs =
      push_pair == pair_take ? pairs_q : push_pair ? pairs_q + 1'b1 : pairs_q - 1'b1;
  sf_fifo #(
      .WIDTH     (63),
      .LOG2_DEPTH(LOG2_PAIRS)
  ) u_pairs (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (push_pair),
      .data_i ({s_empty_i, s_entry1_i[30:0], s_entry0_i[30:0]}),
      .valid_o(pair_valid),
      .pop_i  (pair_take),
      .data_o ({pair_empty, pair1, pair0})
  );
  reg p_valid_q, p_empty_q, p_same_q, p_apart_q, p_second_q;
  reg [30:0] p0_q, p1_q;
  wire a_ready, p_may;
  wire p_split = !p_same_q && !p_apart_q;  // two lines in one bank
  wire p_move = p_valid_q && p_may && a_ready;
  wire p_leaves = p_move && (!p_split || p_second_q);
  assign pair_take = pair_valid && (!p_valid_q || p_leaves);

  // ---- emptying
  reg emptying_q, blank_q;
  reg [SET_BITS-1:0] empty_set_q;
  wire tags_idle;
  wire begin_empty = p_valid_q && p_empty_q && tags_idle && !emptying_q && !blank_q;
  assign p_may = !p_empty_q && !emptying_q;
  wire empty_end = emptying_q && empty_set_q == '1;

  // ---- A to D
  reg a_valid_q, b_valid_q, c_valid_q, d_valid_q;
  reg [1:0] a_used_q;  // banks
  reg [BANK_LINE-1:0] a_even_q, a_odd_q;
  localparam integer FOR_ENTRIES = 10;  // {has x + 1, has x, banks, places} of a look-up
  reg [FOR_ENTRIES-1:0] a_entries_q, b_entries_q, c_entries_q, d_entries_q;
  wire [1:0] busy, used, miss;
  wire [PLACE-1:0] place_even, place_odd;
  wire [BANK_LINE-1:0] line_even, line_odd;
  wire go, leave;
  wire a_leaves = a_valid_q && busy == 2'b00 && go;
  assign a_ready = !a_valid_q || a_leaves;
  assign tags_idle = !(a_valid_q || b_valid_q || c_valid_q || d_valid_q);

  wire p_x = !(p_split && p_second_q);
  wire p_x1 = !p_split || p_second_q;
  wire bank0 = p0_q[3];
  wire bank1 = p1_q[3];
  wire [1:0] p_used = {(p_x && bank0) || (p_x1 && bank1), (p_x && !bank0) || (p_x1 && !bank1)};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {p_valid_q, p_second_q, a_valid_q, b_valid_q, c_valid_q, d_valid_q} <= 6'd0;
      pairs_q <= '0;
      room_q <= 1'b0;
      {emptying_q, blank_q} <= 2'b10;
      empty_set_q <= '0;
    end else if (clear_i) begin
      {p_valid_q, p_second_q, a_valid_q, b_valid_q, c_valid_q, d_valid_q} <= 6'd0;
      pairs_q <= '0;
      room_q <= 1'b0;
      {emptying_q, blank_q} <= 2'b10;
      empty_set_q <= '0;
    end else begin
      pairs_q <= pairs;
      room_q <= !pairs[LOG2_PAIRS];
      p_valid_q <= pair_take || (p_valid_q && !p_leaves);
      if (p_move) p_second_q <= p_split && !p_second_q;
      a_valid_q <= p_move || (a_valid_q && !a_leaves);
      if (go) {b_valid_q, c_valid_q, d_valid_q} <= {a_leaves, b_valid_q, c_valid_q};
      emptying_q <= begin_empty || (emptying_q && !empty_end);
      blank_q <= empty_end || (blank_q && !p_move);
      if (emptying_q) empty_set_q <= empty_set_q + 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (pair_take) begin
      {p1_q, p0_q} <= {pair1, pair0};
      p_empty_q <= pair_empty;
      p_same_q <= pair0[30:3] == pair1[30:3];
      p_apart_q <= pair0[3] != pair1[3];
    end else if (blank_q || empty_end) begin
      p_empty_q <= 1'b0;
    end
    if (p_move) begin
      a_used_q <= p_used;
      a_even_q <= p_x && !bank0 ? p0_q[30:4] : p1_q[30:4];
      a_odd_q <= p_x && bank0 ? p0_q[30:4] : p1_q[30:4];
      a_entries_q <= {p_x1, p_x, bank1, bank0, p1_q[2:0], p0_q[2:0]};
    end
    if (go) {b_entries_q, c_entries_q, d_entries_q} <= {a_entries_q, b_entries_q, c_entries_q};
  end

  sf_cache_tags #(
      .SETS     (SETS),
      .WAYS     (CACHE_WAYS),
      .LINE_BITS(BANK_LINE)
  ) u_even (
      .clk_i      (clk_i),
      .rst_ni     (rst_ni),
      .clear_i    (clear_i),
      .go_i       (go),
      .enter_i    (a_leaves),
      .used_i     (a_used_q[0]),
      .line_i     (a_even_q),
      .busy_o     (busy[0]),
      .leave_i    (leave),
      .used_o     (used[0]),
      .miss_o     (miss[0]),
      .line_o     (line_even),
      .place_o    (place_even),
      .empty_i    (emptying_q),
      .empty_set_i(empty_set_q)
  );
  sf_cache_tags #(
      .SETS     (SETS),
      .WAYS     (CACHE_WAYS),
      .LINE_BITS(BANK_LINE)
  ) u_odd (
      .clk_i      (clk_i),
      .rst_ni     (rst_ni),
      .clear_i    (clear_i),
      .go_i       (go),
      .enter_i    (a_leaves),
      .used_i     (a_used_q[1]),
      .line_i     (a_odd_q),
      .busy_o     (busy[1]),
      .leave_i    (leave),
      .used_o     (used[1]),
      .miss_o     (miss[1]),
      .line_o     (line_odd),
      .place_o    (place_odd),
      .empty_i    (emptying_q),
      .empty_set_i(empty_set_q)
  );

  // ---- D: missing lines are asked for, the even one first
  reg [1:0] asked_q;
  reg queue_room_q;
  wire [1:0] ask = d_valid_q ? miss & ~asked_q : 2'b00;
  wire fetch_ready, fill_valid, fill_pop;
  wire [127:0] fill;
  wire asks = ask != 2'b00 && queue_room_q;
  assign leave = d_valid_q && queue_room_q && (ask == 2'b00 || (ask != 2'b11 && fetch_ready));
  assign go = !d_valid_q || leave;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) asked_q <= 2'b00;
    else if (clear_i || leave) asked_q <= 2'b00;
    else if (asks && fetch_ready) asked_q[0] <= 1'b1;
  end
  sf_fetch #(
      .LOG2_LINES(LOG2_LINES)
  ) u_fetch (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .base_i         (base_i),
      .ask_i          (asks),
      .ready_o        (fetch_ready),
      .line_i         (ask[0] ? {line_even, 1'b0} : {line_odd, 1'b1}),
      .valid_o        (fill_valid),
      .pop_i          (fill_pop),
      .data_o         (fill),
      .filled_o       (filled_o),
      .error_o        (error_o),
      .m_axi_arvalid_o(m_axi_arvalid_o),
      .m_axi_arready_i(m_axi_arready_i),
      .m_axi_araddr_o (m_axi_araddr_o),
      .m_axi_rvalid_i (m_axi_rvalid_i),
      .m_axi_rdata_i  (m_axi_rdata_i),
      .m_axi_rresp_i  (m_axi_rresp_i)
  );

  // ---- the queue: a block RAM, its output, the head
  localparam integer WORD = FOR_ENTRIES + 4 + 2 * PLACE;
  (* no_rw_check *) reg [WORD-1:0] queue_q[0:(1<<LOG2_LOOKUPS)-1];
  reg [LOG2_LOOKUPS:0] write_q, read_q;
  reg n_valid_q, h_valid_q;
  reg [WORD-1:0] n_q, h_q;
  wire h_leaves;
  wire h_take = !h_valid_q || h_leaves;
  wire n_take = !n_valid_q || h_take;
  wire queued = write_q != read_q;
  wire [LOG2_LOOKUPS:0] waiting = write_q - read_q;
  localparam [LOG2_LOOKUPS:0] NEARLY_FULL = (1 << LOG2_LOOKUPS) - 3;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q <= '0;
      read_q <= '0;
      {n_valid_q, h_valid_q, queue_room_q} <= 3'd0;
    end else if (clear_i) begin
      write_q <= '0;
      read_q <= '0;
      {n_valid_q, h_valid_q, queue_room_q} <= 3'd0;
    end else begin
      if (leave) write_q <= write_q + 1'b1;
      if (n_take && queued) read_q <= read_q + 1'b1;
      if (n_take) n_valid_q <= queued;
      if (h_take) h_valid_q <= n_valid_q;
      queue_room_q <= waiting < NEARLY_FULL;
    end
  end
  always_ff @(posedge clk_i) begin
    if (leave) queue_q[write_q[LOG2_LOOKUPS-1:0]] <= {d_entries_q, used, miss, place_odd, place_even};
    if (n_take) n_q <= queue_q[read_q[LOG2_LOOKUPS-1:0]];
    if (h_take) h_q <= n_q;
  end

  // ---- H: a bank stores its missing line, or is read
  wire [FOR_ENTRIES-1:0] h_entries;
  wire [1:0] h_used, h_miss;
  wire [PLACE-1:0] h_even, h_odd;
  assign {h_entries, h_used, h_miss, h_odd, h_even} = h_q;
  reg stored_q;  // the even line, while the odd one is missing
  wire [1:0] need = h_valid_q ? {h_miss[1], h_miss[0] && !stored_q} : 2'b00;
  wire store_even = need[0] && fill_valid;
  wire store_odd = need == 2'b10 && fill_valid;
  assign fill_pop = store_even || store_odd;
  assign h_leaves = h_valid_q && (need == 2'b00 || (need != 2'b11 && fill_valid));
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) stored_q <= 1'b0;
    else if (clear_i || h_leaves) stored_q <= 1'b0;
    else if (store_even) stored_q <= 1'b1;
  end
  reg [127:0] even_q[0:BANK_LINES-1], odd_q[0:BANK_LINES-1];
  reg [127:0] read_even_q, read_odd_q, fill_q;  // fill_q: what was stored
  always_ff @(posedge clk_i) begin
    if (store_even) even_q[h_even] <= fill;
    else read_even_q <= even_q[h_even];
  end
  always_ff @(posedge clk_i) begin
    if (store_odd) odd_q[h_odd] <= fill;
    else read_odd_q <= odd_q[h_odd];
  end

  // ---- R: the lines as they were read or stored; E: their entries
  reg r_valid_q, e_valid_q, m_valid_q;
  reg [1:0] r_stored_q;
  reg [FOR_ENTRIES-1:0] r_q, e_q;
  reg [127:0] e_even_q, e_odd_q;
  reg [15:0] m0_q, m1_q;
  reg [127:0] m_line0_q, m_line1_q;
  wire e_has0, e_has1, e_bank0, e_bank1;
  wire [2:0] e_place0, e_place1;
  assign {e_has1, e_has0, e_bank1, e_bank0, e_place1, e_place0} = e_q;
  wire [127:0] e_line0 = e_bank0 ? e_odd_q : e_even_q;
  wire [127:0] e_line1 = e_bank1 ? e_odd_q : e_even_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {r_valid_q, e_valid_q, m_valid_q} <= 3'd0;
    else if (clear_i) {r_valid_q, e_valid_q, m_valid_q} <= 3'd0;
    else {r_valid_q, e_valid_q, m_valid_q} <= {h_leaves, r_valid_q, e_valid_q && e_has1};
  end
  always_ff @(posedge clk_i) begin
    r_q <= h_entries;
    r_stored_q <= {store_odd, store_even};
    fill_q <= fill;
    e_q <= r_q;
    e_even_q <= r_stored_q[0] ? fill_q : read_even_q;
    e_odd_q <= r_stored_q[1] ? fill_q : read_odd_q;
    if (e_valid_q && e_has0) m0_q <= e_line0[16*e_place0+:16];
    if (e_valid_q && e_has1) m1_q <= e_line1[16*e_place1+:16];
    if (e_has0) m_line0_q <= e_line0;
    m_line1_q <= e_line1;
  end
  assign m_valid_o = m_valid_q;
  assign m_entries_o = {m1_q, m0_q};
  assign m_line0_o = m_line0_q;
  assign m_line1_o = m_line1_q;

  // ---- events
  reg [1:0] lookups_q, misses_q;
  reg waits_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {lookups_q, misses_q, waits_q} <= 5'd0;
    end else begin
      lookups_q <= leave ? {&used, ^used} : 2'd0;
      misses_q <= leave ? {&miss, ^miss} : 2'd0;
      waits_q <= need != 2'b00 && !fill_valid;
    end
  end
  assign lookups_o = lookups_q;
  assign misses_o = misses_q;
  assign waits_o = waits_q;

  `SF_REFUSE(CACHE_BYTES < 1024 || CACHE_BYTES > 65536 || (CACHE_BYTES & (CACHE_BYTES - 1)) != 0,
             "CACHE_BYTES is not a power of two from 1024 to 65536")
  `SF_REFUSE(CACHE_WAYS != 1 && CACHE_WAYS != 2 && CACHE_WAYS != 4 && CACHE_WAYS != 8, "CACHE_WAYS is not 1, 2, 4 or 8")
  wire unused_ok = &{1'b0, s_entry0_i[31], s_entry1_i[31], h_used};
endmodule

`default_nettype wire
