// What makes the block wait, and wait for: random waits on every channel, and a queue in front of the stream of samples.
// They are made here, because a wait of Python's costs as much time as many cycles of the block.

// 64 other bits in every cycle, by the seed.
module sf_cocotb_noise (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire [31:0] seed_i,
    output reg  [63:0] bits_o
);
  wire [63:0] a = bits_o ^ {bits_o[50:0], 13'd0};
  wire [63:0] b = a ^ {7'd0, a[63:7]};
  always @(posedge clk_i) bits_o <= !rst_ni ? {~seed_i, seed_i} : b ^ {b[46:0], 17'd0};
endmodule

// A channel that waits while wait_i says so. What is on offer stays on offer until it is taken. A shy one is not ready
// before it has seen something on offer.
module sf_cocotb_gate (
    input  wire clk_i,
    input  wire rst_ni,
    input  wire wait_i,
    input  wire shy_i,
    input  wire valid_i,
    output wire ready_o,
    output wire valid_o,
    input  wire ready_i
);
  reg  offered_q;
  wire open = offered_q || !wait_i;
  assign valid_o = valid_i && open;
  assign ready_o = ready_i && open && (valid_i || !shy_i);
  always @(posedge clk_i) offered_q <= rst_ni && valid_o && !ready_i;
endmodule

// Beats of a whole ray: Python hands them over at once, and has nothing to do while the block takes them.
module sf_cocotb_queue #(
    parameter integer WIDTH = 66,
    parameter integer LOG2_DEPTH = 10
) (
    input  wire             clk_i,
    input  wire             rst_ni,
    input  wire             valid_i,
    output wire             ready_o,
    input  wire [WIDTH-1:0] data_i,
    output wire             valid_o,
    input  wire             ready_i,
    output wire [WIDTH-1:0] data_o
);
  reg [WIDTH-1:0] word[0:(1<<LOG2_DEPTH)-1];
  reg [LOG2_DEPTH:0] put, taken;
  wire [LOG2_DEPTH:0] held = put - taken;
  assign ready_o = !held[LOG2_DEPTH];
  assign valid_o = put != taken;
  assign data_o  = word[taken[LOG2_DEPTH-1:0]];
  always @(posedge clk_i)
    if (!rst_ni) {put, taken} <= {2 * LOG2_DEPTH + 2{1'b0}};
    else begin
      if (valid_i && ready_o) begin
        word[put[LOG2_DEPTH-1:0]] <= data_i;
        put <= put + 1'b1;
      end
      if (valid_o && ready_i) taken <= taken + 1'b1;
    end
endmodule
