// What waits for C1 between D1 and D2 on one side and C1 on the other: directions of rays, marks of their first samples, h.
// At most 10 samples are between D1 and C1. Mirror: src/fx/net.c
// h = current of D2 >>> H_SHIFT: 16384 >> 3 fits 12 bits; with a smaller H_SHIFT the scene's weights see to it.
// Radix mode: one h per sample, of the weighted sum of all steps (sum = 2 sum + current). Its mean, the sum over 2^steps - 1,
// comes from one multiplier, a value per cycle. Mirror: src/fx/integrate.c (fx_weighed_h)
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
  localparam [3:0] LAST = 4'd14;  // of 15 values

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
  wire sums_complete = valid_i && last_i;
  wire h_complete;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {h_taken_q, h_full_q, h_write_q, h_read_q} <= 6'd0;
    else if (clear_i) {h_taken_q, h_full_q, h_write_q, h_read_q} <= 6'd0;
    else begin
      h_taken_q <= h_taken_q + {1'b0, begin_i} - {1'b0, done_i};
      h_full_q <= h_full_q + {1'b0, h_complete} - {1'b0, done_i};
      if (sums_complete) h_write_q <= !h_write_q;
      if (done_i) h_read_q <= !h_read_q;
    end
  end
  // The sums so far, in the other modes 0.
  reg [23*15-1:0] sum_q;
  wire [24*15-1:0] sum;
  wire over = !radix_i || clear_i || sums_complete;
  genvar l;
  generate
    for (l = 0; l < 15; l = l + 1) begin : g_h
      assign sum[24*l+:24] = 24'($signed(sums_i[16*l+:16])) + {sum_q[23*l+:23], 1'b0};
      always_ff @(posedge clk_i) begin
        if (over) sum_q[23*l+:23] <= 23'd0;
        else if (valid_i) sum_q[23*l+:23] <= sum[24*l+:23];
      end
    end
  endgenerate
  reg [24*15-1:0] h_q[0:15];  // 15 sums by {sample, step}
  always_ff @(posedge clk_i) if (valid_i) h_q[{h_write_q, radix_i ? 3'd0 : step_i}] <= sum;

  // ---- the means of complete sums, sample by sample: 0: a sum is chosen; 1, 2: the product; 3: it is rounded and stored
  reg [1:0] waiting_q;
  reg mean_read_q;
  reg [3:0] at_q;
  wire works = waiting_q != 2'd0;
  wire last_value = works && at_q == LAST;
  reg [2:0] works_q, last_q;
  reg [4:0] place1_q, place2_q, place3_q;  // {sample, value}
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {waiting_q, mean_read_q, at_q, works_q, last_q} <= 13'd0;
    else if (clear_i) {waiting_q, mean_read_q, at_q, works_q, last_q} <= 13'd0;
    else begin
      waiting_q <= waiting_q + {1'b0, radix_i && sums_complete} - {1'b0, last_value};
      if (works) at_q <= last_value ? 4'd0 : at_q + 4'd1;
      if (last_value) mean_read_q <= !mean_read_q;
      works_q <= {works_q[1:0], works};
      last_q <= {last_q[1:0], last_value};
    end
  end
  assign h_complete = radix_i ? last_q[2] : sums_complete;

  wire [24*15-1:0] word = radix_i ? h_q[{mean_read_q, 3'd0}] : h_q[{h_read_q, h_step_i}];
  wire [3:0] index = radix_i ? at_q : h_index_i;
  wire [511:0] wide;  // at places that are a power of two apart
  generate
    for (l = 0; l < 15; l = l + 1) begin : g_wide
      assign wide[32*l+:32] = {8'd0, word[24*l+:24]};
    end
  endgenerate
  assign wide[511:480] = 32'd0;
  wire signed [23:0] value = wide[{index, 5'd0}+:24];
  reg signed [17:0] factor_q;  // 2^(15 + steps) / (2^steps - 1), rounded; does not change at work
  reg [3:0] shift_q;
  reg signed [23:0] value1_q;
  reg signed [35:0] low2_q;
  reg signed [24:0] high2_q;
  reg signed [26:0] mean3_q;
  wire signed [41:0] product = {high2_q, 17'd0} + 42'(low2_q) + 42'sd16384;
  always_ff @(posedge clk_i) begin
    case (steps_i)
      4'd1: factor_q <= 18'sd65536;
      4'd2: factor_q <= 18'sd43691;
      4'd3: factor_q <= 18'sd37449;
      4'd4: factor_q <= 18'sd34953;
      4'd5: factor_q <= 18'sd33825;
      4'd6: factor_q <= 18'sd33288;
      4'd7: factor_q <= 18'sd33026;
      default: factor_q <= 18'sd32897;
    endcase
    shift_q <= steps_i;
    value1_q <= value;
    low2_q <= $signed({1'b0, value1_q[16:0]}) * factor_q;
    high2_q <= 25'($signed(value1_q[23:17]) * factor_q);
    mean3_q <= 27'(product >>> 15);
    place1_q <= {mean_read_q, at_q};
    {place3_q, place2_q} <= {place2_q, place1_q};
  end
  reg [11:0] mean_q[0:31];  // h by {sample, value}
  always_ff @(posedge clk_i) if (works_q[2]) mean_q[place3_q] <= 12'((mean3_q >>> sf_arch_pkg::H_SHIFT) >>> shift_q);

  assign h_o = radix_i ? mean_q[{h_read_q, h_index_i}] : value[sf_arch_pkg::H_SHIFT+:12];
  assign room_o = !h_taken_q[1];
  assign valid_o = h_full_q != 2'd0;
  assign idle_o = h_taken_q == 2'd0;
endmodule

`default_nettype wire
