// Spikes of one layer over all steps, of two samples: one comes in, NEURONS of a step at a time, while the other is handed
// on, a neuron at a time: those that fired at any step, in their order, each with its steps. Biases, where the layer
// behind has them, go first: they count at every step.
`default_nettype none

module sf_spikes #(
    parameter NEURONS = 16,
    parameter INDEX_BITS = 7,
    parameter GROUP_BITS = 3   // of the number of a group of NEURONS
) (
    input  wire                  clk_i,
    input  wire                  rst_ni,
    input  wire                  clear_i,
    input  wire                  bias_i,
    input  wire [           3:0] steps_i,
    input  wire [GROUP_BITS-1:0] group_i,   // the last group that the layer has
    // a place is taken before the spikes come
    input  wire                  take_i,
    output wire                  space_o,
    input  wire                  we_i,
    input  wire [           2:0] wstep_i,
    input  wire [GROUP_BITS-1:0] wgroup_i,
    input  wire [   NEURONS-1:0] wspikes_i,
    // a neuron that fired
    output wire                  valid_o,
    output wire                  bias_o,    // no neuron: the biases
    output wire [INDEX_BITS-1:0] index_o,
    output wire [           7:0] fired_o,   // its steps; 0: none, of a sample's end without a neuron
    output wire                  last_o,    // of the sample
    input  wire                  next_i,
    output wire                  idle_o
);
  localparam UNIT_BITS = $clog2(NEURONS);

  reg [1:0] taken_q, full_q;  // taken: how many places
  reg write_q, read_q;
  reg [GROUP_BITS-1:0] group_q;  // the next one to look at
  wire last_write = we_i && {1'b0, wstep_i} == steps_i - 4'd1 && wgroup_i == group_i;

  // ---- the group at hand: which of its neurons are left, and their steps
  reg have_q, last_group_q, bias_q;
  reg [NEURONS-1:0] left_q;
  reg [GROUP_BITS-1:0] at_q;
  reg [8*NEURONS-1:0] steps_q;  // {step, neuron}
  // ---- the neuron that is offered
  reg valid_q, item_bias_q, item_last_q;
  reg [INDEX_BITS-1:0] index_q;
  reg [7:0] fired_q;

  wire room = !valid_q || next_i;
  wire [NEURONS-1:0] rest = left_q & (left_q - 1'b1);
  wire [NEURONS-1:0] first = left_q & ~rest;
  wire any = left_q != {NEURONS{1'b0}};
  wire worked_off = have_q && !bias_q && rest == {NEURONS{1'b0}} && (room || (!any && !last_group_q));
  wire offers = have_q && room && (bias_q || any || last_group_q);
  wire load = full_q[read_q] && (!have_q || worked_off);
  wire load_last = load && group_q == group_i;

  wire [8*NEURONS-1:0] stored;
  wire [7:0] exists = ~(8'hff << steps_i);
  genvar t;
  generate
    for (t = 0; t < 8; t = t + 1) begin : g_step
      reg [NEURONS-1:0] spikes_q[0:(2<<GROUP_BITS)-1];  // {sample, group}
      always_ff @(posedge clk_i) begin
        if (we_i && wstep_i == 3'(t)) spikes_q[{write_q, wgroup_i}] <= wspikes_i;
      end
      assign stored[NEURONS*t+:NEURONS] = exists[t] ? spikes_q[{read_q, group_q}] : {NEURONS{1'b0}};
    end
  endgenerate
  reg [NEURONS-1:0] fires;
  reg [7:0] fired;
  reg [UNIT_BITS-1:0] unit;
  always_comb begin
    fires = {NEURONS{1'b0}};
    for (int s = 0; s < 8; s++) fires = fires | stored[NEURONS*s+:NEURONS];
    for (int s = 0; s < 8; s++) fired[s] = |(steps_q[NEURONS*s+:NEURONS] & first);
    unit = {UNIT_BITS{1'b0}};
    for (int n = 0; n < NEURONS; n++) if (first[n]) unit = unit | UNIT_BITS'(n);
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      full_q <= 2'd0;
      {taken_q, write_q, read_q, have_q, valid_q, bias_q} <= 7'd0;
      group_q <= {GROUP_BITS{1'b0}};
    end else if (clear_i) begin
      full_q <= 2'd0;
      {taken_q, write_q, read_q, have_q, valid_q, bias_q} <= 7'd0;
      group_q <= {GROUP_BITS{1'b0}};
    end else begin
      taken_q <= taken_q + {1'b0, take_i} - {1'b0, load_last};
      if (last_write) begin
        full_q[write_q] <= 1'b1;
        write_q <= !write_q;
      end
      if (load_last) begin
        full_q[read_q] <= 1'b0;
        read_q <= !read_q;
      end
      if (load) begin
        group_q <= load_last ? {GROUP_BITS{1'b0}} : group_q + 1'b1;
        bias_q <= bias_i && group_q == {GROUP_BITS{1'b0}};
      end else if (room) bias_q <= 1'b0;
      have_q <= load || (have_q && !worked_off);
      valid_q <= offers || (valid_q && !next_i);
    end
  end
  always_ff @(posedge clk_i) begin
    if (load) begin
      left_q <= fires;
      steps_q <= stored;
      at_q <= group_q;
      last_group_q <= load_last;
    end else if (room && !bias_q) left_q <= rest;
    if (room) begin
      item_bias_q <= bias_q;
      index_q <= INDEX_BITS'({at_q, unit});
      fired_q <= bias_q ? exists : fired;
      item_last_q <= last_group_q && !bias_q && rest == {NEURONS{1'b0}};
    end
  end

  assign space_o = !taken_q[1];
  assign valid_o = valid_q;
  assign bias_o = item_bias_q;
  assign index_o = index_q;
  assign fired_o = fired_q;
  assign last_o = item_last_q;
  assign idle_o = taken_q == 2'd0 && !have_q && !valid_q;
endmodule

`default_nettype wire
