// What waits for C1 between D1 and D2 on one side and C1 on the other: directions of rays, marks of their first samples, h.
// At most 10 samples are between D1 and C1. Mirror: src/fx/net.c
// h = current of D2 >>> H_SHIFT: 16384 >> 3 fits 12 bits; with a smaller H_SHIFT the scene's weights see to it.
// Radix mode: one h per sample, of the weighted sum of all steps (sum = 2 sum + current), which is shifted by steps, too.
`default_nettype none

module sf_c1_inputs (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    input  wire         radix_i,
    input  wire [  3:0] steps_i,
    // from D1: a sample's inputs have been read, a value of its ray's direction
    input  wire         d1_done_i,
    input  wire         d1_first_i,     // of a new ray
    input  wire         dir_we_i,
    input  wire [  3:0] dir_index_i,    // of the value that is written, or read for C1
    input  wire [ 11:0] dir_i,
    // from D2: currents of a sample, a step per cycle, all of h at once
    output wire         room_o,
    input  wire         begin_i,
    input  wire         valid_i,
    input  wire [  2:0] step_i,
    input  wire         last_i,
    input  wire [239:0] sums_i,
    // to C1
    output wire         valid_o,        // h of a sample is complete
    output wire         first_o,        // of a new ray
    input  wire         done_i,         // the sample
    input  wire         ray_i,          // the ray's direction
    output wire [ 11:0] dir_o,
    input  wire [  2:0] h_step_i,
    input  wire [  3:0] h_index_i,
    output wire [ 11:0] h_o,
    output wire         idle_o
);
  localparam KEPT = 24 - sf_arch_pkg::H_SHIFT;

  reg [11:0] dir_q[0:255];
  reg [15:0] mark_q;
  reg [3:0] mark_write_q, mark_read_q, ray_write_q, ray_read_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {mark_write_q, mark_read_q, ray_write_q, ray_read_q} <= 16'd0;
    else if (clear_i) {mark_write_q, mark_read_q, ray_write_q, ray_read_q} <= 16'd0;
    else begin
      if (d1_done_i) mark_write_q <= mark_write_q + 4'd1;
      if (d1_done_i && d1_first_i) ray_write_q <= ray_write_q + 4'd1;
      if (done_i) mark_read_q <= mark_read_q + 4'd1;
      if (ray_i) ray_read_q <= ray_read_q + 4'd1;
    end
  end
  always_ff @(posedge clk_i) begin
    if (d1_done_i) mark_q[mark_write_q] <= d1_first_i;
    if (dir_we_i) dir_q[{ray_write_q, dir_index_i}] <= dir_i;
  end
  assign first_o = mark_q[mark_read_q];
  assign dir_o = dir_q[{ray_read_q, dir_index_i}];

  reg [1:0] h_taken_q, h_full_q;  // samples of h: promised, complete
  reg h_write_q, h_read_q;
  wire h_complete = valid_i && last_i;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {h_taken_q, h_full_q, h_write_q, h_read_q} <= 6'd0;
    else if (clear_i) {h_taken_q, h_full_q, h_write_q, h_read_q} <= 6'd0;
    else begin
      h_taken_q <= h_taken_q + {1'b0, begin_i} - {1'b0, done_i};
      h_full_q <= h_full_q + {1'b0, h_complete} - {1'b0, done_i};
      if (h_complete) h_write_q <= !h_write_q;
      if (done_i) h_read_q <= !h_read_q;
    end
  end
  // The sums so far, in the other modes 0; of a weighted sum the lowest bits are never needed.
  reg [23*15-1:0] sum_q;
  wire [24*15-1:0] sum;
  wire [KEPT*15-1:0] h_kept;
  wire over = !radix_i || clear_i || h_complete;
  genvar l;
  generate
    for (l = 0; l < 15; l = l + 1) begin : g_h
      assign sum[24*l+:24] = 24'($signed(sums_i[16*l+:16])) + {sum_q[23*l+:23], 1'b0};
      always_ff @(posedge clk_i) begin
        if (over) sum_q[23*l+:23] <= 23'd0;
        else if (valid_i) sum_q[23*l+:23] <= sum[24*l+:23];
      end
      assign h_kept[KEPT*l+:KEPT] = sum[24*l+sf_arch_pkg::H_SHIFT+:KEPT];
    end
  endgenerate
  reg [KEPT*15-1:0] h_q[0:15];  // 15 values by {sample, step}
  reg [3:0] shift_q;            // does not change at work
  always_ff @(posedge clk_i) begin
    shift_q <= radix_i ? steps_i : 4'd0;
    if (valid_i) h_q[{h_write_q, radix_i ? 3'd0 : step_i}] <= h_kept;
  end
  wire [KEPT*15-1:0] h_word = h_q[{h_read_q, h_step_i}];
  wire [511:0] h_wide;  // at places that are a power of two apart
  generate
    for (l = 0; l < 15; l = l + 1) begin : g_wide
      assign h_wide[32*l+:32] = {{(32 - KEPT) {1'b0}}, h_word[KEPT*l+:KEPT]};
    end
  endgenerate
  assign h_wide[511:480] = 32'd0;
  wire signed [KEPT-1:0] h_value = h_wide[{h_index_i, 5'd0}+:KEPT];
  assign h_o = 12'(h_value >>> shift_q);
  assign room_o = !h_taken_q[1];
  assign valid_o = h_full_q != 2'd0;
  assign idle_o = h_taken_q == 2'd0;
endmodule

`default_nettype wire
