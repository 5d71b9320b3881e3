// The neuron unit equals its specification (the equations of src/fx/plif.c), written here in 64 bits and case by case;
// in decay and hybrid mode the membrane before the reset lies between the old one and the current, ends included.
`default_nettype none

module plif_spec #(
    parameter [1:0] MODE = 2'd0,
    parameter [0:0] FIRST = 1'b0
) (
    input wire signed [23:0] v_i,
    input wire signed [23:0] current_i,
    input wire        [12:0] k_i,
    input wire signed [23:0] theta_i
);
  localparam integer FRAC = sf_arch_pkg::LEAK_FRAC;
  localparam signed [63:0] MAX = 64'sd8388607;
  localparam signed [63:0] HALF = 64'sd1 << (FRAC - 1);
  localparam NODECAY = MODE == sf_op_pkg::NODECAY;

  wire signed [23:0] v;
  wire spike;
  sf_plif u_dut (
      .v_i      (v_i),
      .current_i(current_i),
      .k_i      (k_i),
      .theta_i  (theta_i),
      .mode_i   (MODE),
      .first_i  (FIRST),
      .v_o      (v),
      .spike_o  (spike)
  );

  wire signed [63:0] old = FIRST ? 64'sd0 : {{40{v_i[23]}}, v_i};
  wire signed [63:0] current = {{40{current_i[23]}}, current_i};
  wire signed [63:0] theta = {{40{theta_i[23]}}, theta_i};
  wire signed [63:0] k = {51'd0, k_i};
  wire signed [63:0] factor = NODECAY ? old : current - old;
  wire signed [63:0] product = factor * k;
  wire signed [63:0] leak = (product + HALF) >>> FRAC;
  wire signed [63:0] exact = old - leak + current;
  wire signed [63:0] nodecay = exact > MAX ? MAX : exact < -MAX - 64'sd1 ? -MAX - 64'sd1 : exact;
  wire signed [63:0] leaky = MODE == sf_op_pkg::HYBRID && FIRST ? current : old + leak;
  wire signed [63:0] membrane = NODECAY ? nodecay : leaky;
  wire fires = membrane >= theta;
  wire signed [63:0] after = fires ? membrane - theta : membrane;
  wire signed [63:0] whole = factor <<< FRAC;

  always @* begin
    // What sf_csr enforces.
    assume (k_i <= 13'd1 << FRAC);
    assume (theta_i >= 24'sd1);
    // mul_bounds
    assume (factor < 64'sd0 ? product <= 64'sd0 && product >= whole : product >= 64'sd0 && product <= whole);

    spike_is_the_comparison : assert (spike == fires);
    membrane_is_exact : assert ({{40{v[23]}}, v} == after);
    reset_leaves_no_debt : assert (!spike || v >= 24'sd0);
    if (!NODECAY) between_v_and_current : assert (old < current ? membrane >= old && membrane <= current
                                                                : membrane >= current && membrane <= old);
  end
endmodule

`default_nettype wire
