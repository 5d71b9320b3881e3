// Another neuron with the behaviour of rtl/sf_plif.sv: sign and magnitude, the product built bit by bit of the leak, the
// rounding carried in as its lowest term, all in the last two stages. No multiplication, no sf_rshift_round, no sf_sat.
`default_nettype none

module sf_plif (
    input  wire               clk_i,
    input  wire signed [23:0] v_i,
    input  wire signed [23:0] current_i,
    input  wire        [12:0] k_i,        // one cycle after v_i
    input  wire signed [23:0] theta_i,    // four cycles after v_i
    input  wire               nodecay_i,
    input  wire               radix_i,
    input  wire               first_i,
    output reg  signed [23:0] v_o,        // five cycles after v_i
    output reg                spike_o
);
  localparam [38:0] HALF = 39'd1 << (sf_arch_pkg::LEAK_FRAC - 1);

  // What came in, until it is needed.
  reg signed [24:0] from1_q, from2_q, from3_q;
  reg signed [23:0] current1_q, current2_q, current3_q;
  reg nodecay1_q, nodecay2_q, nodecay3_q;
  reg radix1_q, radix2_q, radix3_q;
  reg [12:0] k2_q, k3_q;
  always_ff @(posedge clk_i) begin
    from1_q <= first_i ? 25'sd0 : 25'(v_i);
    {from3_q, from2_q} <= {from2_q, from1_q};
    current1_q <= current_i;
    {current3_q, current2_q} <= {current2_q, current1_q};
    nodecay1_q <= nodecay_i;
    {nodecay3_q, nodecay2_q} <= {nodecay2_q, nodecay1_q};
    {radix3_q, radix2_q, radix1_q} <= {radix2_q, radix1_q, radix_i};
    k2_q <= k_i;
    k3_q <= k2_q;
  end

  // Names within the operation, not registers.
  reg signed [25:0] distance;
  reg [25:0] magnitude;
  reg [38:0] product;
  reg signed [26:0] moved;
  reg signed [27:0] sum;
  reg signed [23:0] membrane4_q;
  always_comb begin
    distance = nodecay3_q ? -26'(from3_q) : radix3_q ? 26'(current3_q) : 26'(current3_q) - 26'(from3_q);
    magnitude = distance[25] ? -distance : distance;
    // Round half up: a negative distance rounds its magnitude half down. In no-decay mode the leak is what leaves, so
    // that the halves change sides.
    product = nodecay3_q == distance[25] ? HALF : HALF - 39'd1;
    for (int b = 0; b <= sf_arch_pkg::LEAK_FRAC; b++) if (k3_q[b]) product = product + ({13'd0, magnitude} << b);
    moved = $signed({1'b0, product[sf_arch_pkg::LEAK_FRAC+:26]});
    if (distance[25]) moved = -moved;
    sum = 28'(from3_q) + 28'(moved) + (nodecay3_q ? 28'(current3_q) : 28'sd0);
    if (radix3_q) sum = sum + 28'(from3_q);
    if (sum > 28'sd8388607) sum = 28'sd8388607;
    if (sum < -28'sd8388608) sum = -28'sd8388608;
  end
  always_ff @(posedge clk_i) begin
    membrane4_q <= sum[23:0];
    spike_o <= !(membrane4_q < theta_i);
    v_o <= membrane4_q < theta_i ? membrane4_q : membrane4_q - theta_i;
  end
endmodule

`default_nettype wire
