// The neurons: NEURONS pipelined units that the spiking layers D1, C1 and C2 share. A group of neurons of one layer takes
// one step per cycle; its next step begins DEPTH cycles later at the earliest. Its currents are those of the layer's part that
// was loaded last. Membranes of the layer at work lie in a small memory beside the units. Mirror: src/fx/plif.c
// Radix mode: a neuron takes its current once, then fires a digit per turn. C2 first adds up its current, step by step: v = 2 v
// + sum / 2^steps. These turns fire nothing and are updates of their own steps.
`default_nettype none

module sf_neurons #(
    parameter MACS = 128,
    parameter NEURONS = 16,
    parameter GROUP_BITS = 3
) (
    input  wire                  clk_i,
    input  wire                  rst_ni,
    input  wire                  clear_i,
    input  wire [           1:0] mode_i,
    input  wire [           3:0] steps_i,
    input  wire [          12:0] d1_k_i,
    input  wire [          12:0] c1_k_i,
    input  wire [          12:0] c2_k_i,
    input  wire [          23:0] d1_theta_i,
    input  wire [          23:0] c1_theta_i,
    input  wire [          23:0] c2_theta_i,
    input  wire [           8:0] d1_out_i,    // neurons of the layer
    input  wire [           8:0] c1_out_i,
    input  wire [           8:0] c2_out_i,
    // a group's turn
    input  wire                  valid_i,
    input  wire [           1:0] layer_i,     // 0: D1, 1: C1, 2: C2
    input  wire [           2:0] step_i,
    input  wire                  first_i,     // from membranes of 0
    input  wire                  charges_i,   // there is a current
    input  wire                  fires_i,     // else it adds up alone
    input  wire [GROUP_BITS-1:0] group_i,
    input  wire                  last_i,      // the layer's last group
    input  wire [   24*MACS-1:0] values_i,    // currents of D1 or C1
    input  wire [   16*MACS-1:0] c2_sums_i,
    // DEPTH - 1 cycles later, if it fires: its spikes and membranes after reset
    output wire                  valid_o,
    output wire [           1:0] layer_o,
    output wire [           2:0] step_o,
    output wire [GROUP_BITS-1:0] group_o,
    output wire                  last_o,
    output wire [   NEURONS-1:0] spikes_o,
    output wire [24*NEURONS-1:0] membrane_o,
    // any turn, for the counters, another cycle later
    output wire                  count_o,
    output wire [           1:0] count_layer_o,
    output wire [           2:0] count_step_o,
    output wire                  count_first_o,
    output wire                  count_last_o,
    output wire [           8:0] count_fired_o,
    output wire                  idle_o
);
  localparam PART_GROUPS = MACS / NEURONS;
  localparam STAGES = 5;
  localparam [12:0] ONE = 13'd1 << sf_arch_pkg::LEAK_FRAC;
  localparam [23:0] NEVER = 24'h7fffff;  // above any sum of C2

  wire [GROUP_BITS-1:0] place = group_i & GROUP_BITS'(PART_GROUPS - 1);  // in the part
  wire of_c2 = layer_i == sf_op_pkg::SPIKING_C2;
  wire nodecay = mode_i == sf_op_pkg::NODECAY;
  wire radix = mode_i == sf_op_pkg::RADIX;
  reg [24*NEURONS-1:0] current;
  always_comb begin
    current = {(24 * NEURONS) {1'b0}};
    for (int g = 0; g < PART_GROUPS; g++) begin
      if (place == GROUP_BITS'(g)) begin
        for (int n = 0; n < NEURONS; n++)
          current[24*n+:24] = of_c2 ? 24'($signed(c2_sums_i[16*(NEURONS*g+n)+:16])) <<< (radix ? sf_arch_pkg::T_MAX : sf_arch_pkg::AC_FRAC)
                            : values_i[24*(NEURONS*g+n)+:24];
      end
    end
  end

  // What goes along with a group, stage by stage.
  reg [STAGES-1:0] valid_q;
  reg [2*STAGES-1:0] layer_q;
  reg [3*STAGES-1:0] step_q;
  reg [GROUP_BITS*STAGES-1:0] group_q;
  reg [STAGES-1:0] last_q;
  reg [STAGES-1:0] first_q, fires_q;
  reg [12:0] k1_q;
  reg [12:0] c2_share_q;  // of C2's sums in radix mode
  reg signed [23:0] theta4_q;
  reg [8:0] n_out4_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) valid_q <= {STAGES{1'b0}};
    else valid_q <= clear_i ? {STAGES{1'b0}} : {valid_q[STAGES-2:0], valid_i};
  end
  wire [1:0] layer3 = layer_q[4+:2];
  wire [23:0] theta3 = layer3[1] ? c2_theta_i : layer3[0] ? c1_theta_i : d1_theta_i;
  always_ff @(posedge clk_i) begin
    layer_q <= {layer_q[2*STAGES-3:0], layer_i};
    step_q <= {step_q[3*STAGES-4:0], step_i};
    group_q <= {group_q[GROUP_BITS*(STAGES-1)-1:0], group_i};
    last_q <= {last_q[STAGES-2:0], last_i};
    first_q <= {first_q[STAGES-2:0], first_i};
    fires_q <= {fires_q[STAGES-2:0], fires_i};
    c2_share_q <= ONE >> steps_i;
    k1_q <= radix ? (!charges_i ? 13'd0 : layer_i[1] ? c2_share_q : ONE)
          : mode_i == sf_op_pkg::HYBRID && first_i ? ONE
          : layer_i[1] ? c2_k_i : layer_i[0] ? c1_k_i : d1_k_i;
    theta4_q <= fires_q[2] ? theta3 : NEVER;
    n_out4_q <= layer3[1] ? c2_out_i : layer3[0] ? c1_out_i : d1_out_i;
  end

  reg [24*NEURONS-1:0] membrane_q[0:(1<<GROUP_BITS)-1];
  wire [24*NEURONS-1:0] state = membrane_q[group_i];
  wire [NEURONS-1:0] fired;
  reg [NEURONS-1:0] exists_q;  // neurons that the layer has
  always_ff @(posedge clk_i) begin
    if (valid_q[STAGES-1]) membrane_q[group_o] <= membrane_o;
    for (int u = 0; u < NEURONS; u++)
      exists_q[u] <= 9'(32'(group_q[GROUP_BITS*(STAGES-2)+:GROUP_BITS]) * NEURONS + u) < n_out4_q;
  end

  genvar u;
  generate
    for (u = 0; u < NEURONS; u = u + 1) begin : g_unit
      sf_plif u_plif (
          .clk_i     (clk_i),
          .v_i       (state[24*u+:24]),
          .current_i (current[24*u+:24]),
          .k_i       (k1_q),
          .theta_i   (theta4_q),
          .nodecay_i (nodecay),
          .radix_i   (radix),
          .first_i   (first_i),
          .v_o       (membrane_o[24*u+:24]),
          .spike_o   (fired[u])
      );
    end
  endgenerate

  assign valid_o = valid_q[STAGES-1] && fires_q[STAGES-1];
  assign layer_o = layer_q[2*(STAGES-1)+:2];
  assign step_o = step_q[3*(STAGES-1)+:3];
  assign group_o = group_q[GROUP_BITS*(STAGES-1)+:GROUP_BITS];
  assign last_o = last_q[STAGES-1];
  assign spikes_o = fired & exists_q;

  reg count_q, count_first_q, count_last_q;
  reg [1:0] count_layer_q;
  reg [2:0] count_step_q;
  reg [8:0] count_fired_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) count_q <= 1'b0;
    else count_q <= valid_q[STAGES-1];
  end
  always_ff @(posedge clk_i) begin
    count_first_q <= first_q[STAGES-1];
    count_last_q <= last_o;
    count_layer_q <= layer_o;
    count_step_q <= step_o;
    count_fired_q <= 9'($countones(spikes_o));
  end
  assign count_o = count_q;
  assign count_first_o = count_first_q;
  assign count_last_o = count_last_q;
  assign count_layer_o = count_layer_q;
  assign count_step_o = count_step_q;
  assign count_fired_o = count_fired_q;
  assign idle_o = valid_q == {STAGES{1'b0}} && !count_q;
endmodule

`default_nettype wire
