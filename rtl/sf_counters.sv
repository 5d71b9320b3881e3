// Event counters, 64 bits each, per layer and step, where the event happens: every row, neuron step and integrator
// step that executes adds its own share. What is one event: src/fx/fx.h (struct fx_counts).
// Clear and snapshot walk over all 512 places of the window, between samples: the sequencer holds meanwhile.
`default_nettype none

module sf_counters (
    input  wire        clk_i,
    input  wire        rst_ni,
    // engine (sf_core)
    input  wire        radix_i,
    input  wire [ 8:0] d1_out_i,         // neurons of a layer
    input  wire [ 8:0] d2_out_i,
    input  wire [ 8:0] c1_out_i,
    input  wire [ 8:0] c2_out_i,
    input  wire [ 8:0] c3_out_i,
    input  wire        d1_row_i,
    input  wire        c1_row_i,
    input  wire        c1_bias_row_i,
    input  wire        c1_products_i,
    input  wire [ 2:0] c1_step_i,
    input  wire        d2_row_i,
    input  wire [ 7:0] d2_fired_i,
    input  wire        c2_row_i,
    input  wire [ 7:0] c2_fired_i,
    input  wire        c2_bias_row_i,
    input  wire        c3_row_i,
    input  wire [ 7:0] c3_fired_i,
    input  wire        c3_bias_row_i,
    input  wire [ 4:0] busy_i,
    input  wire        ray_i,
    input  wire        neurons_valid_i,
    input  wire [ 1:0] neurons_layer_i,
    input  wire [ 2:0] neurons_step_i,
    input  wire        neurons_first_i,  // the sample's first turn: from membranes of 0
    input  wire        neurons_last_i,
    input  wire [ 8:0] neurons_fired_i,
    // readout
    input  wire        update_i,
    input  wire        special_i,
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
  // By step, each layer where its events happen. A row of weights is read once, at the first step that it serves; biases
  // are weights that are read, but no operations.
  reg [63:0] d1_mac_q, c1_weight_q;
  reg [63:0] c1_mac_q[0:7];
  // By {layer of D2, C2, C3, step}
  reg [63:0] sop_q[0:31];
  reg [63:0] weight_q[0:31];
  // By {C3 else D2, step}
  reg [63:0] integrate_q[0:15];
  reg [63:0] special_q[0:15];
  // By {layer of D1, C1, C2, step}
  reg [63:0] spikes_q[0:31];
  reg [63:0] neuron_q[0:31];
  reg [63:0] c2_read_q;  // membranes of C2 at step 0 that were read: a sum that goes on
  reg [63:0] sample_q, ray_q, cycle_q, busy_q, stall_in_q, stall_out_q;
  reg [63:0] layer_busy_q[0:4];
  (* no_rw_check *) reg [63:0] window_q[0:511];  // a word that is read while it is written may be either

  // ---- walk
  reg clear_wanted_q, snapshot_wanted_q, walk_q, walk_clear_q, walk_snapshot_q;
  reg [8:0] place_q;
  reg write_q, threefold_q, fourfold_q;  // the place before this one, on its way to the window
  reg [8:0] write_place_q;
  reg [63:0] value_q;
  wire walk_last = &place_q;
  wire [2:0] event_w = place_q[8:6];
  wire [2:0] at_layer = place_q[5:3];
  wire [2:0] at_step = place_q[2:0];
  wire integrating = at_layer == sf_op_pkg::D2 || at_layer == sf_op_pkg::C3;
  wire neurons = at_layer == sf_op_pkg::D1 || at_layer == sf_op_pkg::C1 || at_layer == sf_op_pkg::C2;
  wire [3:0] at_narrow = {at_layer == sf_op_pkg::C3, at_step};
  wire [4:0] at_neurons = {at_layer == sf_op_pkg::C2 ? 2'd2 : at_layer == sf_op_pkg::C1 ? 2'd1 : 2'd0, at_step};
  wire [63:0] updates = neurons ? neuron_q[at_neurons] : integrate_q[at_narrow];
  wire [63:0] mac = at_layer == sf_op_pkg::C1 ? c1_mac_q[at_step]
                  : at_layer == sf_op_pkg::D1 && at_step == 3'd0 ? d1_mac_q : 64'd0;
  wire fed = integrating || at_layer == sf_op_pkg::C2;
  wire [4:0] at_fed = {at_layer == sf_op_pkg::C3 ? 2'd2 : at_layer == sf_op_pkg::C2 ? 2'd1 : 2'd0, at_step};
  wire [63:0] weight = fed ? weight_q[at_fed] : at_step != 3'd0 ? 64'd0 : at_layer == sf_op_pkg::C1 ? c1_weight_q : d1_mac_q;
  wire is_state = event_w == sf_csr_pkg::EVENT_STATE_R || event_w == sf_csr_pkg::EVENT_STATE_W;
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
      sf_csr_pkg::EVENT_MAC: place_value = mac;
      sf_csr_pkg::EVENT_SOP: place_value = fed ? sop_q[at_fed] : 64'd0;
      sf_csr_pkg::EVENT_SPIKES: place_value = neurons ? spikes_q[at_neurons] : 64'd0;
      sf_csr_pkg::EVENT_UPDATES: place_value = updates;
      sf_csr_pkg::EVENT_WEIGHT: place_value = weight;
      sf_csr_pkg::EVENT_STATE_R: place_value = at_step != 3'd0 ? updates : at_layer == sf_op_pkg::C2 ? c2_read_q : 64'd0;
      sf_csr_pkg::EVENT_STATE_W: place_value = updates;
      default: place_value = integrating ? special_q[at_narrow] : 64'd0;
    endcase
    if (!integrating && !neurons) begin
      place_value = 64'd0;
      if (at_layer == 3'd7 && event_w == sf_csr_pkg::EVENT_MAC) place_value = global_value;
      if (at_layer == 3'd7 && event_w == sf_csr_pkg::EVENT_SOP && at_step <= sf_op_pkg::C3) place_value = layer_busy_q[at_step];
    end
  end

  // State bytes are 3 a membrane, 4 an integrator.
  wire threefold = is_state && neurons;
  wire fourfold = is_state && integrating;

  assign hold_o = clear_wanted_q || snapshot_wanted_q || walk_q;
  assign busy_o = hold_o || write_q;

  // Commands that come during a walk belong to the next one.
  wire walk_begin = (clear_wanted_q || snapshot_wanted_q) && !walk_q && quiet_i;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      clear_wanted_q <= 1'b1;  // the memories hold anything at power-on
      snapshot_wanted_q <= 1'b0;
      {walk_q, walk_clear_q, walk_snapshot_q, write_q} <= 4'd0;
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
      write_q <= walk_q && walk_snapshot_q;
    end
  end
  // At the last event of the walk, so a snapshot has read every event.
  wire wipe = walk_q && walk_clear_q && event_w == sf_csr_pkg::EVENT_SPECIAL;
  wire [63:0] written = fourfold_q ? value_q << 2 : threefold_q ? (value_q << 1) + value_q : value_q;
  always_ff @(posedge clk_i) begin
    write_place_q <= place_q;
    {threefold_q, fourfold_q} <= {threefold, fourfold};
    value_q <= place_value;
    if (write_q) window_q[write_place_q] <= written;
    counter_o <= window_q[index_i];
  end

  // ---- events
  wire [63:0] n_d1 = {55'd0, d1_out_i};
  wire [63:0] n_d2 = {55'd0, d2_out_i};
  wire [63:0] n_c1 = {55'd0, c1_out_i};
  wire [63:0] n_c2 = {55'd0, c2_out_i};
  wire [63:0] n_c3 = {55'd0, c3_out_i};
  wire [4:0] neurons_here = {neurons_layer_i, neurons_step_i};
  wire [63:0] n_neurons = neurons_layer_i[1] ? n_c2 : neurons_layer_i[0] ? n_c1 : n_d1;
  wire [3:0] update_here = {update_colour_i, update_step_i};
  // Layers that spikes feed, D2 in the lowest place
  wire [191:0] n_fed = {n_c3, n_c2, n_d2};
  wire [2:0] fed_row = {c3_row_i, c2_row_i, d2_row_i};
  wire [23:0] fed_fired = {c3_fired_i, c2_fired_i, d2_fired_i};
  wire [2:0] fed_bias = {c3_bias_row_i, c2_bias_row_i, 1'b0};

  always_ff @(posedge clk_i) begin
    if (wipe && at_layer == sf_op_pkg::D1) d1_mac_q <= 64'd0;
    else if (d1_row_i) d1_mac_q <= d1_mac_q + n_d1;
    if (wipe && at_layer == sf_op_pkg::C1 && at_step == 3'd0) c1_weight_q <= 64'd0;
    else if (c1_row_i || c1_bias_row_i) c1_weight_q <= c1_weight_q + n_c1;
    if (wipe && at_layer == sf_op_pkg::C1) c1_mac_q[at_step] <= 64'd0;
    else if (c1_products_i) c1_mac_q[c1_step_i] <= c1_mac_q[c1_step_i] + n_c1;
    if (wipe) begin
      if (neurons) begin
        spikes_q[at_neurons] <= 64'd0;
        neuron_q[at_neurons] <= 64'd0;
      end
    end else if (neurons_valid_i) begin
      spikes_q[neurons_here] <= spikes_q[neurons_here] + {55'd0, neurons_fired_i};
      if (neurons_last_i) neuron_q[neurons_here] <= neuron_q[neurons_here] + n_neurons;
    end
    if (wipe && at_layer == sf_op_pkg::C2) c2_read_q <= 64'd0;
    else if (neurons_valid_i && neurons_last_i && neurons_here == {sf_op_pkg::SPIKING_C2, 3'd0} && !neurons_first_i)
      c2_read_q <= c2_read_q + n_c2;
    if (wipe && integrating) integrate_q[at_narrow] <= 64'd0;
    else if (update_i) integrate_q[update_here] <= integrate_q[update_here] + (radix_i && !update_colour_i ? n_d2 : 64'd1);
    if (wipe && integrating) special_q[at_narrow] <= 64'd0;
    else if (special_i) special_q[update_here] <= special_q[update_here] + 64'd1;
  end
  genvar f, t;
  generate
    for (f = 0; f < 3; f = f + 1) begin : g_fed
      wire [7:0] fired = fed_row[f] ? fed_fired[8*f+:8] : 8'd0;
      for (t = 0; t < 8; t = t + 1) begin : g_step
        wire first = fired[t] && (t == 0 || (fired & ((8'd1 << t) - 8'd1)) == 8'd0);
        always_ff @(posedge clk_i) begin
          if (wipe) begin
            if (fed && at_fed == 5'(8 * f + t)) begin
              sop_q[8*f+t] <= 64'd0;
              weight_q[8*f+t] <= 64'd0;
            end
          end else begin
            if (fired[t]) sop_q[8*f+t] <= sop_q[8*f+t] + n_fed[64*f+:64];
            if (first || (t == 0 && fed_bias[f])) weight_q[8*f+t] <= weight_q[8*f+t] + n_fed[64*f+:64];
          end
        end
      end
    end
  endgenerate

  always_ff @(posedge clk_i) begin
    if (wipe && walk_last) begin
      {sample_q, ray_q, cycle_q, busy_q, stall_in_q, stall_out_q} <= 384'd0;
      for (int l = 0; l < 5; l++) layer_busy_q[l] <= 64'd0;
    end else begin
      if (sample_i) sample_q <= sample_q + 64'd1;
      if (ray_i) ray_q <= ray_q + 64'd1;
      if (active_i && !walk_q) cycle_q <= cycle_q + 64'd1;
      if (busy_i != 5'd0) busy_q <= busy_q + 64'd1;
      for (int l = 0; l < 5; l++) if (busy_i[l]) layer_busy_q[l] <= layer_busy_q[l] + 64'd1;
      if (stall_in_i && !walk_q) stall_in_q <= stall_in_q + 64'd1;
      if (stall_out_i) stall_out_q <= stall_out_q + 64'd1;
    end
  end
endmodule

`default_nettype wire
