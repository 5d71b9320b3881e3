// Layer engine: D1, D2, C1, C2 and C3 work at the same time, each on a sample of its own; the spiking layers share one
// array of neurons. Mirror: src/fx/net.c
//
//   D1 -> neurons -> store -> D2 -> h -> C1 -> neurons -> queue -> C2 -> neurons -> store -> C3
//
// A layer hands its current over and begins the next sum while the neurons are at work on the last one. Cycles without
// stalls: src/cycles/cycles.c
`default_nettype none

module sf_core #(
    parameter TAP = 1,
    parameter LANES = 128
) (
    input  wire                clk_i,
    input  wire                rst_ni,
    input  wire                clear_i,
    input  wire                hold_i,             // begin no sample
    output wire                idle_o,
    // programming
    input  wire                we_i,
    input  wire         [ 2:0] wlayer_i,
    input  wire         [ 8:0] wrow_i,
    input  wire         [ 5:0] wword_i,
    input  wire         [31:0] wdata_i,
    input  wire         [44:0] n_in_i,             // 9 bits a layer, D1 in the lowest
    input  wire         [44:0] n_out_i,
    input  wire         [64:0] k_i,
    input  wire        [119:0] theta_i,
    input  wire         [12:0] bias_i,             // C3, C2, value of C1's
    input  wire         [ 1:0] mode_i,
    input  wire         [ 3:0] steps_i,
    // inputs of a sample
    input  wire                sample_valid_i,
    input  wire                sample_first_i,
    output wire                sample_done_o,
    output wire         [ 4:0] feature_index_o,
    input  wire         [11:0] feature_i,
    output wire         [ 7:0] dir_index_o,
    input  wire         [11:0] dir_i,
    // currents of D2 and C3, one cycle after they were taken: {step, output}, 16 bits each
    input  wire                density_ready_i,
    output wire                density_valid_o,
    output wire       [2047:0] density_o,
    input  wire                colour_ready_i,
    output wire                colour_valid_o,
    output wire       [2047:0] colour_o,
    // events, in the cycle in which they happen
    output wire                d1_row_o,
    output wire                c1_row_o,
    output wire                c1_bias_row_o,
    output wire         [ 2:0] c1_step_o,
    output wire         [ 1:0] c2_rows_o,
    output wire         [ 2:0] c2_step_o,
    output wire         [15:0] d2_fired_o,         // two presynaptic neurons: the steps at which each fired
    output wire         [15:0] c3_fired_o,
    output wire                ray_o,
    output wire         [ 2:0] spikes_valid_o,     // C2, C1, D1: a step of the layer's neurons
    output wire         [ 2:0] spikes_step_o,
    output wire         [ 8:0] spikes_count_o,
    output wire                stall_o,            // a layer waits for the readout
    // tap
    output wire                tap_valid_o,
    output wire         [ 2:0] tap_layer_o,
    output wire         [ 2:0] tap_step_o,
    output wire [   LANES-1:0] tap_spikes_o,
    output wire [   LANES-1:0] tap_rows_o,
    output wire [24*LANES-1:0] tap_membrane_o
);
  localparam BITS = $clog2(LANES) - 1;  // of a row within a bank
  localparam WORD_BITS = $clog2(LANES / 4);
  localparam QUEUE = 4;                 // steps between C1 and C2

  // Sizes; sf_csr has checked that they are consistent.
  wire decodes = n_out_i[8:0] == 9'd0;  // no D1 and D2: C1 takes its inputs from the buffer
  wire [7:0] n_h = decodes ? 8'd0 : n_out_i[16:9] - 8'd1;
  wire [7:0] n_dir = n_in_i[25:18] - n_h;
  wire bias_we = we_i && wrow_i == 9'(sf_arch_pkg::BIAS_ROW);
  wire row_we = we_i && !bias_we;
  wire [WORD_BITS-1:0] word = wword_i[WORD_BITS-1:0];
  wire unused_ok = &{1'b0, wrow_i, wword_i, n_out_i[44:36], n_out_i[17], n_in_i[44:26], n_in_i[17:6], n_h[7:5], theta_i[119:96], theta_i[47:24],
                     k_i[64:52], k_i[25:13]};

  // ---- neurons: what waits for its turn. The layer nearest to the output goes first.
  reg [2:0] reserved_q;  // by {C2, C1, D1}: the current will be replaced, or is not worked off yet
  reg [2:0] pending_q;   // the current is there
  reg [2:0] d1_step_q, c1_step_q, c2_step_q;
  wire [2:0] fire_next, fire_valid;
  wire [2:0] wanted;
  wire [2:0] fire;
  wire take_d2, take_c3;
  wire ready_d2, ready_c3;
  wire space_d2, space_c3;   // of the stores
  reg [2:0] queue_room_q;    // places in the queue that are not promised
  wire d1_ends = {1'b0, d1_step_q} == steps_i - 4'd1;
  wire c1_ends = {1'b0, c1_step_q} == steps_i - 4'd1;
  wire c2_ends = {1'b0, c2_step_q} == steps_i - 4'd1;

  assign wanted[2] = pending_q[2] && (c2_step_q != 3'd0 || space_c3);
  assign wanted[1] = pending_q[1] && queue_room_q != 3'd0;
  assign wanted[0] = pending_q[0] && (d1_step_q != 3'd0 || space_d2);
  wire h_room;
  wire wanted_c3 = ready_c3 && colour_ready_i;
  wire wanted_d2 = ready_d2 && density_ready_i && h_room;
  assign take_c3 = wanted_c3 && !clear_i;
  assign fire[2] = wanted[2] && !wanted_c3 && !clear_i;
  assign fire[1] = wanted[1] && !wanted_c3 && !wanted[2] && !clear_i;
  assign take_d2 = wanted_d2 && !wanted_c3 && !wanted[2] && !wanted[1] && !clear_i;
  assign fire[0] = wanted[0] && !wanted_c3 && !wanted[2] && !wanted[1] && !wanted_d2 && !clear_i;
  wire [2:0] fire_step = fire[2] ? c2_step_q : fire[1] ? c1_step_q : d1_step_q;
  // D1's current serves all steps, and a decoder's of C1.
  wire [2:0] fire_ends = {fire[2], fire[1] && (!decodes || c1_ends), fire[0] && d1_ends};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {reserved_q, pending_q, d1_step_q, c1_step_q, c2_step_q} <= 15'd0;
    end else if (clear_i) begin
      {reserved_q, pending_q, d1_step_q, c1_step_q, c2_step_q} <= 15'd0;
    end else begin
      reserved_q <= (reserved_q & ~fire_ends) | fire_next;
      pending_q <= (pending_q & ~fire_ends) | fire_valid;
      if (fire[0]) d1_step_q <= d1_ends ? 3'd0 : d1_step_q + 3'd1;
      if (fire[1]) c1_step_q <= c1_ends ? 3'd0 : c1_step_q + 3'd1;
      if (fire[2]) c2_step_q <= c2_ends ? 3'd0 : c2_step_q + 3'd1;
    end
  end

  wire [2:0] spikes_valid, spikes_step;
  wire [LANES-1:0] spikes;
  wire [24*LANES-1:0] d1_current, c1_current;
  wire [16*LANES-1:0] c2_current;
  sf_neurons #(
      .LANES(LANES),
      .TAP  (TAP)
  ) u_neurons (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .mode_i        (mode_i),
      .k_i           ({k_i[51:26], k_i[12:0]}),
      .theta_i       ({theta_i[95:48], theta_i[23:0]}),
      .n_out_i       ({n_out_i[35:18], n_out_i[8:0]}),
      .fire_i        (fire),
      .step_i        (fire_step),
      .d1_i          (d1_current),
      .c1_i          (c1_current),
      .c2_i          (c2_current),
      .valid_o       (spikes_valid),
      .step_o        (spikes_step),
      .spikes_o      (spikes),
      .count_o       (spikes_count_o),
      .tap_membrane_o(tap_membrane_o)
  );

  // ---- D1
  wire dir_we, first_we, first_in, d1_idle, d1_done;
  wire [3:0] d1_dir_index;
  wire [11:0] dir_in;
  wire wd1 = we_i && wlayer_i == sf_op_pkg::D1;
  sf_d1 #(
      .LANES(LANES)
  ) u_d1 (
      .clk_i          (clk_i),
      .rst_ni         (rst_ni),
      .clear_i        (clear_i),
      .hold_i         (hold_i),
      .n_feature_i    (n_in_i[5:0]),
      .n_dir_i        (n_dir[4:0]),
      .we_i           (wd1),
      .wrow_i         (wrow_i[4:0]),
      .wword_i        (word),
      .wdata_i        (wdata_i),
      .sample_valid_i (sample_valid_i && !decodes),
      .sample_first_i (sample_first_i),
      .sample_done_o  (d1_done),
      .feature_index_o(feature_index_o),
      .feature_i      (feature_i),
      .dir_i          (dir_i),
      .dir_we_o       (dir_we),
      .dir_index_o    (d1_dir_index),
      .dir_o          (dir_in),
      .first_we_o     (first_we),
      .first_o        (first_in),
      .fire_free_i    (!reserved_q[0]),
      .fire_next_o    (fire_next[0]),
      .fire_valid_o   (fire_valid[0]),
      .current_o      (d1_current),
      .row_o          (d1_row_o),
      .idle_o         (d1_idle)
  );

  // Directions and ray marks from D1 to C1. At most 6 samples are between the two.
  reg [11:0] dir_q[0:127];
  reg [7:0] mark_q;
  reg [2:0] mark_write_q, mark_read_q, ray_write_q, ray_read_q;
  wire c1_done, ray_done;
  wire [7:0] c1_dir_index;
  assign dir_index_o = decodes ? c1_dir_index : {4'd0, d1_dir_index};
  assign sample_done_o = decodes ? c1_done : d1_done;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {mark_write_q, mark_read_q, ray_write_q, ray_read_q} <= 12'd0;
    else if (clear_i) {mark_write_q, mark_read_q, ray_write_q, ray_read_q} <= 12'd0;
    else begin
      if (first_we) mark_write_q <= mark_write_q + 3'd1;
      if (first_we && first_in) ray_write_q <= ray_write_q + 3'd1;
      if (c1_done) mark_read_q <= mark_read_q + 3'd1;
      if (ray_done) ray_read_q <= ray_read_q + 3'd1;
    end
  end
  always_ff @(posedge clk_i) begin
    if (first_we) mark_q[mark_write_q] <= first_in;
    if (dir_we) dir_q[{ray_write_q, d1_dir_index}] <= dir_in;
  end

  // ---- D2
  wire d2_valid, d2_release, d2_idle, store2_idle;
  wire [LANES-1:0] d2_any, d2_even, d2_odd, d2_rows;
  wire [7:0] d2_even_fired, d2_odd_fired;
  sf_store #(
      .LANES(LANES)
  ) u_store_d2 (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .steps_i     (steps_i),
      .take_i      (fire[0] && d1_step_q == 3'd0),
      .space_o     (space_d2),
      .we_i        (spikes_valid[0]),
      .wstep_i     (spikes_step),
      .wspikes_i   (spikes),
      .valid_o     (d2_valid),
      .any_o       (d2_any),
      .even_mask_i (d2_even),
      .odd_mask_i  (d2_odd),
      .even_fired_o(d2_even_fired),
      .odd_fired_o (d2_odd_fired),
      .release_i   (d2_release),
      .idle_o      (store2_idle)
  );
  sf_split #(
      .LANES(LANES),
      .BITS (BITS),
      .TAP  (TAP)
  ) u_d2 (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .bias_i      (1'b0),
      .we_i        (row_we && wlayer_i == sf_op_pkg::D2),
      .bias_we_i   (1'b0),
      .wrow_i      (wrow_i[BITS:0]),
      .wword_i     (wword_i[1:0]),
      .wdata_i     (wdata_i),
      .valid_i     (d2_valid),
      .any_i       (d2_any),
      .even_mask_o (d2_even),
      .odd_mask_o  (d2_odd),
      .even_fired_i(d2_even_fired),
      .odd_fired_i (d2_odd_fired),
      .release_o   (d2_release),
      .valid_o     (ready_d2),
      .take_i      (take_d2),
      .current_o   (density_o),
      .even_fired_o(d2_fired_o[7:0]),
      .odd_fired_o (d2_fired_o[15:8]),
      .idle_o      (d2_idle),
      .tap_rows_o  (d2_rows)
  );

  // D2's currents of two samples. h = current >>> H_SHIFT: 16384 >> 3 fits 12 bits; with a smaller H_SHIFT the scene's
  // weights see to it.
  reg [2047:0] h_q[0:1];
  reg [1:0] h_full_q;
  reg h_write_q, h_read_q, take_d2_q, take_c3_q;
  wire [6:0] h_index;
  wire [6:0] h_lane = h_index + 7'd1;  // output 0 is the density
  wire [11:0] h = h_q[h_read_q][16*h_lane+sf_arch_pkg::H_SHIFT+:12];
  assign h_room = !h_full_q[h_write_q] && !take_d2_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      h_full_q <= 2'd0;
      {h_write_q, h_read_q, take_d2_q, take_c3_q} <= 4'd0;
    end else if (clear_i) begin
      h_full_q <= 2'd0;
      {h_write_q, h_read_q, take_d2_q, take_c3_q} <= 4'd0;
    end else begin
      take_d2_q <= take_d2;
      take_c3_q <= take_c3;
      if (take_d2_q) begin
        h_full_q[h_write_q] <= 1'b1;
        h_write_q <= !h_write_q;
      end
      if (c1_done) begin
        h_full_q[h_read_q] <= 1'b0;
        h_read_q <= !h_read_q;
      end
    end
  end
  always_ff @(posedge clk_i) begin
    if (take_d2_q) h_q[h_write_q] <= density_o;
  end
  assign density_valid_o = take_d2_q;
  assign colour_valid_o = take_c3_q;

  // ---- C1
  wire c1_idle;
  sf_c1 #(
      .LANES(LANES)
  ) u_c1 (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .decodes_i   (decodes),
      .n_dir_i     (n_dir),
      .bias_i      (bias_i[10:0]),
      .n_h_i       (n_h[4:0]),
      .steps_i     (steps_i),
      .we_i        (we_i && wlayer_i == sf_op_pkg::C1),
      .wrow_i      (wrow_i),
      .wword_i     (word),
      .wdata_i     (wdata_i),
      .valid_i     (decodes ? sample_valid_i && !hold_i : h_full_q[h_read_q]),
      .first_i     (mark_q[mark_read_q]),
      .done_o      (c1_done),
      .dir_index_o (c1_dir_index),
      .dir_i       (decodes ? dir_i : dir_q[{ray_read_q, c1_dir_index[3:0]}]),
      .h_index_o   (h_index),
      .h_i         (h),
      .fire_free_i (!reserved_q[1]),
      .fire_next_o (fire_next[1]),
      .fire_valid_o(fire_valid[1]),
      .current_o   (c1_current),
      .row_o       (c1_row_o),
      .bias_row_o  (c1_bias_row_o),
      .row_step_o  (c1_step_o),
      .ray_o       (ray_o),
      .idle_o      (c1_idle)
  );
  assign ray_done = ray_o;

  // Spikes of C1, step by step, to C2.
  reg [LANES-1:0] queue_q[0:QUEUE-1];
  reg [2:0] queue_step_q[0:QUEUE-1];
  reg [2:0] queue_count_q;
  reg [1:0] queue_write_q, queue_read_q;
  wire c2_done;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {queue_count_q, queue_write_q, queue_read_q, queue_room_q} <= {7'd0, 3'(QUEUE)};
    else if (clear_i) {queue_count_q, queue_write_q, queue_read_q, queue_room_q} <= {7'd0, 3'(QUEUE)};
    else begin
      queue_count_q <= queue_count_q + {2'd0, spikes_valid[1]} - {2'd0, c2_done};
      queue_room_q <= queue_room_q + {2'd0, c2_done} - {2'd0, fire[1]};
      if (spikes_valid[1]) queue_write_q <= queue_write_q + 2'd1;
      if (c2_done) queue_read_q <= queue_read_q + 2'd1;
    end
  end
  always_ff @(posedge clk_i) begin
    if (spikes_valid[1]) begin
      queue_q[queue_write_q] <= spikes;
      queue_step_q[queue_write_q] <= spikes_step;
    end
  end

  // ---- C2
  wire c2_idle;
  wire [LANES-1:0] c2_rows;
  sf_c2 #(
      .LANES(LANES),
      .BITS (BITS),
      .TAP  (TAP)
  ) u_c2 (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .bias_i      (bias_i[11]),
      .we_i        (row_we && wlayer_i == sf_op_pkg::C2),
      .bias_we_i   (bias_we && wlayer_i == sf_op_pkg::C2),
      .wrow_i      (wrow_i[BITS:0]),
      .wword_i     (word),
      .wdata_i     (wdata_i),
      .valid_i     (queue_count_q != 3'd0),
      .spikes_i    (queue_q[queue_read_q]),
      .step_i      (queue_step_q[queue_read_q]),
      .done_o      (c2_done),
      .fire_free_i (!reserved_q[2]),
      .fire_next_o (fire_next[2]),
      .fire_valid_o(fire_valid[2]),
      .current_o   (c2_current),
      .rows_o      (c2_rows_o),
      .rows_step_o (c2_step_o),
      .idle_o      (c2_idle),
      .tap_rows_o  (c2_rows)
  );

  // ---- C3
  wire c3_valid, c3_release, c3_idle, store3_idle;
  wire [LANES-1:0] c3_any, c3_even, c3_odd, c3_rows;
  wire [7:0] c3_even_fired, c3_odd_fired;
  sf_store #(
      .LANES(LANES)
  ) u_store_c3 (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .steps_i     (steps_i),
      .take_i      (fire[2] && c2_step_q == 3'd0),
      .space_o     (space_c3),
      .we_i        (spikes_valid[2]),
      .wstep_i     (spikes_step),
      .wspikes_i   (spikes),
      .valid_o     (c3_valid),
      .any_o       (c3_any),
      .even_mask_i (c3_even),
      .odd_mask_i  (c3_odd),
      .even_fired_o(c3_even_fired),
      .odd_fired_o (c3_odd_fired),
      .release_i   (c3_release),
      .idle_o      (store3_idle)
  );
  sf_split #(
      .LANES(LANES),
      .BITS (BITS),
      .TAP  (TAP)
  ) u_c3 (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .bias_i      (bias_i[12]),
      .we_i        (row_we && wlayer_i == sf_op_pkg::C3),
      .bias_we_i   (bias_we && wlayer_i == sf_op_pkg::C3),
      .wrow_i      (wrow_i[BITS:0]),
      .wword_i     (wword_i[1:0]),
      .wdata_i     (wdata_i),
      .valid_i     (c3_valid),
      .any_i       (c3_any),
      .even_mask_o (c3_even),
      .odd_mask_o  (c3_odd),
      .even_fired_i(c3_even_fired),
      .odd_fired_i (c3_odd_fired),
      .release_o   (c3_release),
      .valid_o     (ready_c3),
      .take_i      (take_c3),
      .current_o   (colour_o),
      .even_fired_o(c3_fired_o[7:0]),
      .odd_fired_o (c3_fired_o[15:8]),
      .idle_o      (c3_idle),
      .tap_rows_o  (c3_rows)
  );

  assign spikes_valid_o = spikes_valid;
  assign spikes_step_o = spikes_step;
  assign stall_o = (ready_c3 && !colour_ready_i) || (ready_d2 && !density_ready_i);
  assign idle_o = d1_idle && d2_idle && c1_idle && c2_idle && c3_idle && store2_idle && store3_idle
      && reserved_q == 3'd0 && spikes_valid == 3'd0 && queue_count_q == 3'd0 && h_full_q == 2'd0
      && !take_d2_q && !take_c3_q;

  // Tap: one beat per spiking layer and step, one per sample of D2 and C3; never two in a cycle.
  generate
    if (TAP != 0) begin : g_tap
      reg valid_q;
      reg [2:0] layer_q, step_q;
      reg [LANES-1:0] spikes_q, rows_q;
      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) valid_q <= 1'b0;
        else valid_q <= (spikes_valid != 3'd0 || take_d2_q || take_c3_q) && !clear_i;
      end
      always_ff @(posedge clk_i) begin
        layer_q <= take_c3_q ? sf_op_pkg::C3 : take_d2_q ? sf_op_pkg::D2 : spikes_valid[2] ? sf_op_pkg::C2
                 : spikes_valid[1] ? sf_op_pkg::C1 : sf_op_pkg::D1;
        step_q <= take_c3_q || take_d2_q ? 3'd0 : spikes_step;
        spikes_q <= take_c3_q || take_d2_q ? {LANES{1'b0}} : spikes;
        rows_q <= take_c3_q ? c3_rows : take_d2_q ? d2_rows : spikes_valid[2] ? c2_rows : {LANES{1'b0}};
      end
      assign tap_valid_o = valid_q;
      assign tap_layer_o = layer_q;
      assign tap_step_o = step_q;
      assign tap_spikes_o = spikes_q;
      assign tap_rows_o = rows_q;
    end else begin : g_no_tap
      assign {tap_valid_o, tap_layer_o, tap_step_o} = 7'd0;
      assign tap_spikes_o = {LANES{1'b0}};
      assign tap_rows_o = {LANES{1'b0}};
      wire unused_tap_ok = &{1'b0, c2_rows, d2_rows, c3_rows};
    end
  endgenerate
endmodule

`default_nettype wire
