// One bank of the cache's tags: which lines are there, and the order of their use. Mirror: src/fx/cache.c (look_up)
//
// A set is a list of its ways, the one used last in front: {valid, way, tag}. A line that is found moves to the front; one
// that is not found takes the way at the end of the list. Ways that hold nothing are at the end.
// Four stages that move with go_i: A reads the list, B has it at the memory's output, C compares, D moves and writes it. A
// look-up whose set is still in one of B, C and D has to wait (busy_o).
`default_nettype none

module sf_cache_tags #(
    parameter integer SETS = 256,       // a power of two, at least 2
    parameter integer WAYS = 4,
    parameter integer LINE_BITS = 27,   // of a line's number
    parameter integer SET_BITS = $clog2(SETS),
    parameter integer PLACE_BITS = $clog2(SETS * WAYS)
) (
    input  wire                  clk_i,
    input  wire                  rst_ni,
    input  wire                  clear_i,
    input  wire                  go_i,
    input  wire                  enter_i,      // A leaves, with a look-up if used_i
    input  wire                  used_i,
    input  wire [ LINE_BITS-1:0] line_i,
    output wire                  busy_o,
    // at D
    input  wire                  leave_i,
    output wire                  used_o,
    output wire                  miss_o,
    output wire [ LINE_BITS-1:0] line_o,
    output wire [PLACE_BITS-1:0] place_o,      // {way, set}
    // a set without lines; nothing is in B, C and D
    input  wire                  empty_i,
    input  wire [  SET_BITS-1:0] empty_set_i
);
  localparam integer TAG_BITS = LINE_BITS - SET_BITS;
  localparam integer WAY_BITS = WAYS > 1 ? $clog2(WAYS) : 1;
  localparam integer ITEM = 1 + WAY_BITS + TAG_BITS;

  reg b_used_q, c_used_q, d_used_q, d_miss_q;
  reg [LINE_BITS-1:0] b_line_q, c_line_q, d_line_q;
  wire [SET_BITS-1:0] set = line_i[SET_BITS-1:0];
  wire [SET_BITS-1:0] d_set = d_line_q[SET_BITS-1:0];
  assign busy_o = used_i && ((b_used_q && b_line_q[SET_BITS-1:0] == set) || (c_used_q && c_line_q[SET_BITS-1:0] == set)
      || (d_used_q && d_set == set));

  // ---- lists
  (* no_rw_check *) reg [WAYS*ITEM-1:0] list_q[0:SETS-1];
  reg [WAYS*ITEM-1:0] b_list_q, c_list_q, d_list_q;
  wire [WAYS*ITEM-1:0] d_list, none;
  wire write = empty_i || (leave_i && d_used_q);
  wire [SET_BITS-1:0] write_set = empty_i ? empty_set_i : d_set;
  always_ff @(posedge clk_i) begin
    if (write) list_q[write_set] <= empty_i ? none : d_list;
    if (go_i) b_list_q <= list_q[set];
  end

  // ---- C: where in the list
  wire [WAYS-1:0] c_found;
  reg [WAYS-1:0] d_found_q;
  genvar w;
  generate
    for (w = 0; w < WAYS; w = w + 1) begin : g_find
      assign c_found[w] = c_list_q[ITEM*w+ITEM-1] && c_list_q[ITEM*w+:TAG_BITS] == c_line_q[LINE_BITS-1:SET_BITS];
    end
  endgenerate

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {b_used_q, c_used_q, d_used_q} <= 3'd0;
    else if (clear_i) {b_used_q, c_used_q, d_used_q} <= 3'd0;
    else if (go_i) {b_used_q, c_used_q, d_used_q} <= {enter_i && used_i, b_used_q, c_used_q};
  end
  always_ff @(posedge clk_i) begin
    if (go_i) begin
      b_line_q <= line_i;
      c_line_q <= b_line_q;
      c_list_q <= b_list_q;
      d_line_q <= c_line_q;
      d_list_q <= c_list_q;
      d_found_q <= c_found;
      d_miss_q <= c_used_q && c_found == '0;
    end
  end

  // ---- D: to the front; what was in front of it goes one place back
  generate
    for (w = 0; w < WAYS; w = w + 1) begin : g_move
      assign none[ITEM*w+:ITEM] = {1'b0, WAY_BITS'(w), {TAG_BITS{1'b0}}};
      if (w > 0) begin : g_behind
        wire back = d_found_q[w-1:0] == '0;
        assign d_list[ITEM*w+:ITEM] = back ? d_list_q[ITEM*(w-1)+:ITEM] : d_list_q[ITEM*w+:ITEM];
      end
    end
  endgenerate
  wire [WAY_BITS-1:0] oldest = d_list_q[ITEM*(WAYS-1)+TAG_BITS+:WAY_BITS];
  reg [WAY_BITS-1:0] d_way;
  always_comb begin
    d_way = d_miss_q ? oldest : '0;
    for (int i = 0; i < WAYS; i++) if (d_found_q[i]) d_way = d_way | d_list_q[ITEM*i+TAG_BITS+:WAY_BITS];
  end
  assign d_list[ITEM-1:0] = {1'b1, d_way, d_line_q[LINE_BITS-1:SET_BITS]};

  wire [WAY_BITS+SET_BITS-1:0] d_place = {d_way, d_set};
  assign place_o = d_place[PLACE_BITS-1:0];
  assign line_o = d_line_q;
  assign used_o = d_used_q;
  assign miss_o = d_miss_q;
  wire unused_ok = &{1'b0, d_place};
endmodule

`default_nettype wire
