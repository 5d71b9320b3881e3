// Layer engine: sequencer, weight memories, lanes and spike store. Mirror: src/fx/net.c
`default_nettype none

module sf_core #(
    parameter TAP = 1
) (
    input  wire          clk_i,
    input  wire          rst_ni,
    input  wire          clear_i,
    input  wire          hold_i,
    output wire          idle_o,
    // programming
    input  wire          we_i,
    input  wire   [ 2:0] wlayer_i,
    input  wire   [ 6:0] wrow_i,
    input  wire   [ 4:0] wword_i,
    input  wire   [31:0] wdata_i,
    input  wire   [39:0] n_in_i,
    input  wire   [39:0] n_out_i,
    input  wire   [64:0] k_i,
    input  wire  [119:0] theta_i,
    input  wire   [ 1:0] mode_i,
    input  wire   [ 3:0] steps_i,
    // inputs of a sample
    input  wire          sample_valid_i,
    input  wire          sample_first_i,
    output wire          sample_done_o,
    output wire   [ 4:0] feature_index_o,
    input  wire   [11:0] feature_i,
    output wire   [ 3:0] dir_index_o,
    input  wire   [11:0] dir_i,
    // currents of D2 and C3
    input  wire          readout_ready_i,
    output wire          take_o,
    output wire          take_colour_o,
    input  wire          current_colour_i,
    input  wire   [ 6:0] current_lane_i,
    output wire   [15:0] current_o,
    // events, in the cycle in which they happen
    output wire   [ 2:0] op_o,
    output wire   [ 2:0] layer_o,
    output wire   [ 2:0] step_o,
    output wire   [ 7:0] n_out_o,
    output wire   [ 7:0] fired_o,
    output wire          spikes_valid_o,  // one cycle behind the FIRE
    output wire   [ 2:0] spikes_layer_o,
    output wire   [ 2:0] spikes_step_o,
    output wire   [ 7:0] spikes_count_o,
    output wire          stall_o,
    // tap
    output wire          tap_valid_o,
    output wire   [ 2:0] tap_layer_o,
    output wire   [ 2:0] tap_step_o,
    output wire  [127:0] tap_spikes_o,
    output wire  [127:0] tap_rows_o,
    output wire [3071:0] tap_membrane_o
);
  wire [2:0] op_d, layer_d, step_d;
  wire base_d;
  wire [7:0] wide_row, narrow_row;
  wire [5:0] value_index;
  wire [1:0] value_select;
  wire [127:0] spike_mask;
  wire [6:0] spike_index;

  // Sizes the sequencer needs; sf_csr has checked that they are consistent.
  wire [7:0] n_h = n_out_i[15:8] - 8'd1;
  wire [7:0] n_dir = n_in_i[23:16] - n_h;
  wire unused_ok = &{1'b0, n_in_i[39:24], n_in_i[15:6], n_h[7:5], n_dir[7:5], value_index[5]};

  reg [2:0] op_q, layer_q, step_q;
  reg base_q, tapped_q, spikes_valid_q;
  reg [2:0] spikes_layer_q, spikes_step_q;
  reg [11:0] value_q;
  reg [7:0] fired_q;
  reg [127:0] spike_mask_q, issued_q, lanes_q;
  reg [127:0] store_q[0:7];  // spikes of D1, then C2, by step
  reg [127:0] any_q;

  wire [127:0] spikes_all;
  wire [127:0] spikes = spikes_all & lanes_q;
  wire [11:0] h;
  wire [1023:0] row;
  wire [127:0] narrow;

  sf_sequencer u_sequencer (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .hold_i         (hold_i),
      .sample_valid_i (sample_valid_i),
      .sample_first_i (sample_first_i),
      .sample_done_o  (sample_done_o),
      .n_feature_i    (n_in_i[5:0]),
      .n_dir_i        (n_dir[4:0]),
      .n_h_i          (n_h[4:0]),
      .steps_i        (steps_i),
      .spikes_now_i   (spikes),
      .spikes_any_i   (any_q),
      .readout_ready_i(readout_ready_i),
      .op_o           (op_d),
      .layer_o        (layer_d),
      .step_o         (step_d),
      .base_o         (base_d),
      .wide_row_o     (wide_row),
      .narrow_row_o   (narrow_row),
      .value_index_o  (value_index),
      .value_select_o (value_select),
      .spike_mask_o   (spike_mask),
      .spike_index_o  (spike_index),
      .idle_o         (idle_o),
      .stall_o        (stall_o)
  );

  // Where a layer's rows begin in the wide memory: D1 0, C1 32, C2 64.
  wire wlayer_narrow = wlayer_i == sf_op_pkg::D2 || wlayer_i == sf_op_pkg::C3;
  wire [7:0] wwide = (wlayer_i == sf_op_pkg::C2 ? 8'd64 : wlayer_i == sf_op_pkg::C1 ? 8'd32 : 8'd0) + {1'b0, wrow_i};
  sf_wmem #(
      .WORDS(32),
      .ROWS (192)
  ) u_wide (
      .clk_i  (clk_i),
      .we_i   (we_i && !wlayer_narrow),
      .wrow_i (wwide),
      .wword_i(wword_i),
      .wdata_i(wdata_i),
      .re_i   (op_d == sf_op_pkg::MAC || op_d == sf_op_pkg::ADD),
      .rrow_i (wide_row),
      .row_o  (row)
  );
  sf_wmem #(
      .WORDS    (4),
      .ROWS     (256),
      .WORD_BITS(2)
  ) u_narrow (
      .clk_i  (clk_i),
      .we_i   (we_i && wlayer_narrow),
      .wrow_i ({wlayer_i == sf_op_pkg::C3, wrow_i}),
      .wword_i(wword_i[1:0]),
      .wdata_i(wdata_i),
      .re_i   (op_d == sf_op_pkg::SPLIT),
      .rrow_i (narrow_row),
      .row_o  (narrow)
  );

  assign feature_index_o = value_index[4:0];
  assign dir_index_o = value_index[3:0];

  reg [7:0] fired_d;
  always_comb begin
    for (int t = 0; t < 8; t++) fired_d[t] = |(store_q[t] & spike_mask);
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      op_q <= sf_op_pkg::NOP;
      tapped_q <= 1'b0;
      spikes_valid_q <= 1'b0;
    end else begin
      op_q <= clear_i ? sf_op_pkg::NOP : op_d;
      spikes_valid_q <= !clear_i && op_q == sf_op_pkg::FIRE;
      tapped_q <= !clear_i && (op_q == sf_op_pkg::FIRE || op_q == sf_op_pkg::TAKE);
    end
  end

  wire [7:0] n_out_q = n_out_i[8*layer_q+:8];
  always_ff @(posedge clk_i) begin
    layer_q <= layer_d;
    step_q <= step_d;
    base_q <= base_d;
    value_q <= value_select == 2'd0 ? feature_i : value_select == 2'd1 ? dir_i : h;
    fired_q <= fired_d;
    spike_mask_q <= spike_mask;
    spikes_layer_q <= layer_q;
    spikes_step_q <= step_q;
    lanes_q <= ~(~128'd0 << n_out_q);  // lanes that the layer has; a FIRE's own by the time its spikes are seen
    if (op_q == sf_op_pkg::LOAD) issued_q <= 128'd0;
    else if (op_q == sf_op_pkg::ADD || op_q == sf_op_pkg::SPLIT) issued_q <= issued_q | spike_mask_q;
    if (spikes_valid_q && spikes_layer_q != sf_op_pkg::C1) begin
      any_q <= spikes_step_q == 3'd0 ? spikes : any_q | spikes;
      for (int t = 0; t < 8; t++) begin
        if (spikes_step_q == t[2:0]) store_q[t] <= spikes;
        else if (spikes_step_q == 3'd0) store_q[t] <= 128'd0;
      end
    end
  end

  sf_layer #(
      .TAP(TAP)
  ) u_layer (
      .clk_i         (clk_i),
      .op_i          (op_q),
      .base_i        (base_q),
      .spikes_in_i   (layer_q == sf_op_pkg::C2),
      .first_i       (step_q == 3'd0),
      .mode_i        (mode_i),
      .k_i           (k_i[13*layer_q+:13]),
      .theta_i       (theta_i[24*layer_q+:24]),
      .value_i       (value_q),
      .fired_i       (fired_q),
      .row_i         (row),
      .narrow_i      (narrow),
      .spikes_o      (spikes_all),
      .tap_i         (spikes_valid_q),
      .tap_spikes_in_i(spikes_layer_q == sf_op_pkg::C2),
      .membrane_o    (tap_membrane_o),
      .h_lane_i      ({step_d, 4'd0} + {2'd0, value_index[4:0]} + 7'd1),
      .h_o           (h),
      .take_colour_i (take_colour_o),
      .current_colour_i(current_colour_i),
      .current_lane_i(current_lane_i),
      .current_o     (current_o)
  );

  assign take_o = op_q == sf_op_pkg::TAKE;
  assign take_colour_o = layer_q == sf_op_pkg::C3;
  assign op_o = op_q;
  assign layer_o = layer_q;
  assign step_o = step_q;
  assign n_out_o = n_out_q;
  assign fired_o = fired_q;
  assign spikes_valid_o = spikes_valid_q;
  assign spikes_layer_o = spikes_layer_q;
  assign spikes_step_o = spikes_step_q;
  assign spikes_count_o = 8'($countones(spikes));

  // Tap: one beat per spiking layer and step, one per TAKE of an integrating layer. Two cycles behind.
  if (TAP != 0) begin : g_tap
    reg valid_q;
    reg [2:0] layer2_q, step2_q;
    reg [127:0] spikes_q, rows_q;
    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) valid_q <= 1'b0;
      else valid_q <= tapped_q && !clear_i;
    end
    always_ff @(posedge clk_i) begin
      if (tapped_q) begin
        layer2_q <= spikes_layer_q;
        step2_q <= spikes_step_q;
        spikes_q <= spikes;
        rows_q <= issued_q;
      end
    end
    assign tap_valid_o = valid_q;
    assign tap_layer_o = layer2_q;
    assign tap_step_o = step2_q;
    assign tap_spikes_o = spikes_q;
    assign tap_rows_o = rows_q;
  end else begin : g_no_tap
    assign {tap_valid_o, tap_layer_o, tap_step_o, tap_spikes_o, tap_rows_o} = 263'd0;
    wire unused_tap_ok = &{1'b0, tapped_q, issued_q};
  end
  wire unused_index_ok = &{1'b0, spike_index};
endmodule

`default_nettype wire
