// One neuron, one step: leak, compare, soft reset. Mirror: src/fx/plif.c (fx_plif_step)
// Included inside a module after sf_round.svh. A function and not an instance per lane: see rtl/README.md, "Lanes".
// Returns {spike, v after reset}. No-decay mode alone needs the saturation; 0 <= k <= 1.0 and theta >= 1 are
// enforced by sf_csr.
function automatic [24:0] sf_plif_step(input signed [23:0] v, input signed [23:0] current, input [12:0] k,
                                       input signed [23:0] theta, input [1:0] mode, input first);
  reg signed [47:0] old;
  reg signed [47:0] leak;
  reg signed [47:0] product;  // 25 x 13 bits
  reg signed [47:0] membrane;
  reg spike;
  begin
    old = first ? 48'sd0 : 48'(v);
    leak = mode == sf_op_pkg::HYBRID && first ? 48'sd1 <<< sf_arch_pkg::LEAK_FRAC : $signed({35'd0, k});
    product = (mode == sf_op_pkg::NODECAY ? old : 48'(current) - old) * leak;
    product = sf_rshift_round(product, 5'(sf_arch_pkg::LEAK_FRAC));
    if (mode == sf_op_pkg::NODECAY) membrane = sf_sat(old - product + 48'(current), 6'd24);
    else membrane = old + product;
    spike = membrane >= 48'(theta);
    if (spike) membrane = membrane - 48'(theta);
    sf_plif_step = {spike, membrane[23:0]};
  end
endfunction
