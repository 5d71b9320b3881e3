// Event counters, 64 bits each, per layer and step, where the event happens: every row, neuron step and integrator
// step that executes adds its own share. What is one event: include/spikefield/fx.h (struct fx_counts).
// Clear and snapshot walk over all 512 places of the window, between samples: the sequencer holds meanwhile.
`default_nettype none

module sf_counters (
    input  wire        clk_i,
    input  wire        rst_ni,
    // lanes
    input  wire [ 2:0] op_i,
    input  wire [ 2:0] layer_i,
    input  wire [ 2:0] step_i,
    input  wire [ 7:0] n_out_i,
    input  wire [ 7:0] fired_i,
    input  wire        spikes_valid_i,
    input  wire [ 2:0] spikes_layer_i,
    input  wire [ 2:0] spikes_step_i,
    input  wire [ 7:0] spikes_count_i,
    // readout
    input  wire        update_i,
    input  wire        update_colour_i,
    input  wire [ 2:0] update_step_i,
    input  wire        sample_i,
    // block
    input  wire        active_i,
    input  wire        stall_in_i,
    input  wire        stall_out_i,
    // commands
    input  wire        clear_i,
    input  wire        snapshot_i,
    input  wire        quiet_i,          // no sample is at work
    output wire        hold_o,           // begin none
    output wire        busy_o,
    input  wire [ 8:0] index_i,
    output reg  [63:0] counter_o
);
  localparam [63:0] NEURON_BYTES = 64'd3;
  localparam [63:0] INTEGRATOR_BYTES = 64'd4;

  // By {layer, step}.
  reg [63:0] mac_q[0:63];
  reg [63:0] add_q[0:63];      // sop of C2
  reg [63:0] spikes_q[0:63];
  reg [63:0] weight_q[0:63];   // D1, C1, C2
  reg [63:0] neuron_q[0:63];   // updates of D1, C1, C2; their state bytes are 3 each
  // By {C3 else D2, step}.
  reg [63:0] split_q[0:15];    // sop
  reg [63:0] split_weight_q[0:15];
  reg [63:0] integrate_q[0:15];
  reg [63:0] sample_q, ray_q, cycle_q, busy_q, stall_in_q, stall_out_q;
  reg [63:0] window_q[0:511];

  // ---- walk
  reg clear_wanted_q, snapshot_wanted_q, walk_q, walk_clear_q, walk_snapshot_q;
  reg [8:0] place_q;
  wire walk_last = &place_q;
  wire [2:0] event_w = place_q[8:6];
  wire [5:0] at = place_q[5:0];
  wire [2:0] at_layer = place_q[5:3];
  wire [2:0] at_step = place_q[2:0];
  wire integrating = at_layer == sf_op_pkg::D2 || at_layer == sf_op_pkg::C3;
  wire neurons = at_layer == sf_op_pkg::D1 || at_layer == sf_op_pkg::C1 || at_layer == sf_op_pkg::C2;
  wire [3:0] at_narrow = {at_layer == sf_op_pkg::C3, at_step};
  wire [63:0] updates = neurons ? neuron_q[at] : integrate_q[at_narrow];
  wire [63:0] state_bytes = updates * (neurons ? NEURON_BYTES : INTEGRATOR_BYTES);
  reg [63:0] global_value, place_value;
  always_comb begin
    case (at_step)
      3'd0: global_value = sample_q;
      3'd1: global_value = ray_q;
      3'd2: global_value = cycle_q;
      3'd3: global_value = busy_q;
      3'd4: global_value = stall_in_q;
      3'd5: global_value = stall_out_q;
      default: global_value = 64'd0;
    endcase
    case (event_w)
      3'd0: place_value = mac_q[at];
      3'd1: place_value = integrating ? split_q[at_narrow] : add_q[at];
      3'd2: place_value = spikes_q[at];
      3'd3: place_value = updates;
      3'd4: place_value = integrating ? split_weight_q[at_narrow] : weight_q[at];
      3'd5: place_value = at_step == 3'd0 ? 64'd0 : state_bytes;
      3'd6: place_value = state_bytes;
      default: place_value = integrating ? integrate_q[at_narrow] : 64'd0;
    endcase
    if (!integrating && !neurons) place_value = at_layer == 3'd7 && event_w == 3'd0 ? global_value : 64'd0;
  end

  assign hold_o = clear_wanted_q || snapshot_wanted_q || walk_q;
  assign busy_o = hold_o;

  // Commands that come during a walk belong to the next one.
  wire walk_begin = (clear_wanted_q || snapshot_wanted_q) && !walk_q && quiet_i;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      clear_wanted_q <= 1'b1;  // the memories hold anything at power-on
      snapshot_wanted_q <= 1'b0;
      {walk_q, walk_clear_q, walk_snapshot_q} <= 3'd0;
      place_q <= 9'd0;
    end else begin
      clear_wanted_q <= clear_i || (clear_wanted_q && !walk_begin);
      snapshot_wanted_q <= snapshot_i || (snapshot_wanted_q && !walk_begin);
      if (walk_begin) begin
        walk_q <= 1'b1;
        walk_clear_q <= clear_wanted_q;
        walk_snapshot_q <= snapshot_wanted_q;
      end else if (walk_q && walk_last) walk_q <= 1'b0;
      if (walk_q) place_q <= place_q + 9'd1;
    end
  end
  wire wipe = walk_q && walk_clear_q;
  always_ff @(posedge clk_i) begin
    if (walk_q && walk_snapshot_q) window_q[place_q] <= place_value;
    counter_o <= window_q[index_i];
  end

  // ---- events
  wire [63:0] n_out = {56'd0, n_out_i};
  wire is_mac = op_i == sf_op_pkg::MAC;
  wire is_add = op_i == sf_op_pkg::ADD;
  wire is_split = op_i == sf_op_pkg::SPLIT;
  wire [5:0] here = {layer_i, step_i};
  wire [5:0] spikes_here = {spikes_layer_i, spikes_step_i};
  wire [3:0] update_here = {update_colour_i, update_step_i};
  wire [7:0] first_fired = fired_i & (~fired_i + 8'd1);

  always_ff @(posedge clk_i) begin
    if (wipe) mac_q[at] <= 64'd0;
    else if (is_mac) mac_q[here] <= mac_q[here] + n_out;
    if (wipe) add_q[at] <= 64'd0;
    else if (is_add) add_q[here] <= add_q[here] + n_out;
    if (wipe) weight_q[at] <= 64'd0;
    else if (is_mac || is_add) weight_q[here] <= weight_q[here] + n_out;
    if (wipe) spikes_q[at] <= 64'd0;
    else if (spikes_valid_i) spikes_q[spikes_here] <= spikes_q[spikes_here] + {56'd0, spikes_count_i};
    if (wipe) neuron_q[at] <= 64'd0;
    else if (op_i == sf_op_pkg::FIRE) neuron_q[here] <= neuron_q[here] + n_out;
    if (wipe && integrating) integrate_q[at_narrow] <= 64'd0;
    else if (update_i) integrate_q[update_here] <= integrate_q[update_here] + 64'd1;
    for (int t = 0; t < 8; t++) begin
      if (wipe && integrating && at_step == t[2:0]) begin
        split_q[{at_layer == sf_op_pkg::C3, t[2:0]}] <= 64'd0;
        split_weight_q[{at_layer == sf_op_pkg::C3, t[2:0]}] <= 64'd0;
      end else if (is_split) begin
        if (fired_i[t])
          split_q[{layer_i == sf_op_pkg::C3, t[2:0]}] <= split_q[{layer_i == sf_op_pkg::C3, t[2:0]}] + n_out;
        if (first_fired[t])
          split_weight_q[{layer_i == sf_op_pkg::C3, t[2:0]}] <=
              split_weight_q[{layer_i == sf_op_pkg::C3, t[2:0]}] + n_out;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (wipe && walk_last) begin
      {sample_q, ray_q, cycle_q, busy_q, stall_in_q, stall_out_q} <= 384'd0;
    end else begin
      if (sample_i) sample_q <= sample_q + 64'd1;
      if (op_i == sf_op_pkg::KEEP) ray_q <= ray_q + 64'd1;
      if (active_i && !walk_q) cycle_q <= cycle_q + 64'd1;
      if (is_mac || is_add || is_split) busy_q <= busy_q + 64'd1;
      if (stall_in_i && !walk_q) stall_in_q <= stall_in_q + 64'd1;
      if (stall_out_i) stall_out_q <= stall_out_q + 64'd1;
    end
  end
endmodule

`default_nettype wire
