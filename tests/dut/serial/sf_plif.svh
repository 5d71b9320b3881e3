// Another neuron with the behaviour of rtl/sf_plif.svh: sign and magnitude, the product built bit by bit of the leak,
// the rounding carried in as its lowest term. No multiplication, no sf_rshift_round, no sf_sat.
function automatic [24:0] sf_plif_step(input signed [23:0] v, input signed [23:0] current, input [12:0] k,
                                       input signed [23:0] theta, input [1:0] mode, input first);
  reg signed [24:0] from;
  reg signed [24:0] towards;
  reg signed [25:0] distance;
  reg [25:0] magnitude;
  reg [38:0] product;
  reg [38:0] half;
  reg signed [26:0] moved;
  reg signed [27:0] membrane;
  reg spike;
  integer b;
  begin
    from = first ? 25'sd0 : 25'(v);
    towards = mode == sf_op_pkg::NODECAY ? 25'sd0 : 25'(current);
    distance = 26'(towards) - 26'(from);
    magnitude = distance[25] ? -distance : distance;
    half = 39'd1 << (sf_arch_pkg::LEAK_FRAC - 1);
    // Round half up: a negative distance rounds its magnitude half down. In no-decay mode the leak is what leaves, so
    // that the halves change sides.
    if (mode == sf_op_pkg::NODECAY) product = distance[25] ? half : half - 39'd1;
    else product = distance[25] ? half - 39'd1 : half;
    for (b = 0; b <= sf_arch_pkg::LEAK_FRAC; b = b + 1) if (k[b]) product = product + ({13'd0, magnitude} << b);
    moved = $signed({1'b0, product[sf_arch_pkg::LEAK_FRAC+:26]});
    if (distance[25]) moved = -moved;
    if (mode == sf_op_pkg::HYBRID && first) membrane = 28'(current);
    else membrane = 28'(from) + 28'(moved) + (mode == sf_op_pkg::NODECAY ? 28'(current) : 28'sd0);
    if (membrane > 28'sd8388607) membrane = 28'sd8388607;
    if (membrane < -28'sd8388608) membrane = -28'sd8388608;
    spike = !(membrane < 28'(theta));
    sf_plif_step = {spike, 24'(spike ? membrane - 28'(theta) : membrane)};
  end
endfunction
