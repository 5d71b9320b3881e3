// Counters: for a place of the window that the solver chooses, and every sequence of events and commands: the counter is
// the number of its events since the last clear, each with its weight; a snapshot reads the number at the moment its walk
// began, which with a clear in the same walk is what the clear removes; a walk begins for every command, and only when
// no sample is at work. counters_lossless.sed leaves 4 bits of each counter.
`default_nettype none

module counters_lossless (
    input wire        clk_i,
    input wire        radix_i,
    input wire [ 8:0] d1_out_i,
    input wire [ 8:0] d2_out_i,
    input wire [ 8:0] c1_out_i,
    input wire [ 8:0] c2_out_i,
    input wire [ 8:0] c3_out_i,
    input wire        d1_row_i,
    input wire        c1_row_i,
    input wire        c1_bias_row_i,
    input wire        c1_products_i,
    input wire [ 2:0] c1_step_i,
    input wire        d2_row_i,
    input wire [ 7:0] d2_fired_i,
    input wire        c2_row_i,
    input wire [ 7:0] c2_fired_i,
    input wire        c2_bias_row_i,
    input wire        c3_row_i,
    input wire [ 7:0] c3_fired_i,
    input wire        c3_bias_row_i,
    input wire [ 4:0] busy_i,
    input wire        ray_i,
    input wire        neurons_valid_i,
    input wire [ 1:0] neurons_layer_i,
    input wire [ 2:0] neurons_step_i,
    input wire        neurons_first_i,
    input wire        neurons_last_i,
    input wire [ 8:0] neurons_fired_i,
    input wire        update_i,
    input wire        special_i,
    input wire        update_colour_i,
    input wire [ 2:0] update_step_i,
    input wire        sample_i,
    input wire        active_i,
    input wire        stall_in_i,
    input wire        stall_out_i,
    input wire        clear_i,
    input wire        snapshot_i,
    input wire        quiet_i,
    input wire [ 8:0] index_i
);
  (* anyconst *) wire [8:0] watched;
  wire [2:0] kind = watched[8:6];
  wire [2:0] layer = watched[5:3];
  wire [2:0] step = watched[2:0];
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire hold, busy;
  wire [3:0] value, written, window, counter;
  sf_counters u_dut (
      .*,
      .rst_ni   (rst_n_q),
      .hold_o   (hold),
      .busy_o   (busy),
      .watched_i(watched),
      .value_o  (value),
      .window_o (window),
      .written_o(written),
      .counter_o(counter)
  );
  wire peek_write_q, peek_walk_q, peek_clear_wanted_q, peek_snapshot_wanted_q, peek_walk_clear_q, peek_walk_snapshot_q;
  wire [8:0] peek_place_q, peek_write_place_q;

  // ---- what one cycle adds to the place
  wire neurons = layer == 3'd0 || layer == 3'd2 || layer == 3'd3;
  wire [3:0] n = layer == 3'd0 ? d1_out_i[3:0] : layer == 3'd1 ? d2_out_i[3:0] : layer == 3'd2 ? c1_out_i[3:0]
               : layer == 3'd3 ? c2_out_i[3:0] : c3_out_i[3:0];
  wire [7:0] fired = layer == 3'd1 ? d2_fired_i : layer == 3'd3 ? c2_fired_i : c3_fired_i;
  wire row = layer == 3'd1 ? d2_row_i : layer == 3'd3 ? c2_row_i : c3_row_i;
  wire bias_row = layer == 3'd1 ? 1'b0 : layer == 3'd3 ? c2_bias_row_i : c3_bias_row_i;
  wire fed = row && fired[step];
  wire [7:0] earlier = (8'd1 << step) - 8'd1;
  wire first = fed && (fired & earlier) == 8'd0;
  wire acts = neurons_valid_i && neurons_step_i == step
            && neurons_layer_i == (layer == 3'd0 ? 2'd0 : layer == 3'd2 ? 2'd1 : 2'd2);
  wire asks = special_i && update_step_i == step && update_colour_i == (layer == 3'd4);
  wire updates = update_i && update_step_i == step && update_colour_i == (layer == 3'd4);
  wire mac = (layer == 3'd0 && step == 3'd0 && d1_row_i) || (layer == 3'd2 && c1_products_i && c1_step_i == step);
  wire sop = (layer == 3'd1 || layer == 3'd3 || layer == 3'd4) && fed;
  wire read = layer == 3'd0 ? mac : layer == 3'd2 ? step == 3'd0 && (c1_row_i || c1_bias_row_i)
            : first || (step == 3'd0 && bias_row);
  wire [3:0] update = neurons ? (acts && neurons_last_i ? n : 4'd0)
                    : layer == 3'd1 && radix_i ? (updates ? n : 4'd0) : {3'd0, updates};
  wire [3:0] bytes = neurons ? update + update + update : update << 2;
  wire reads_state = step != 3'd0 || (layer == 3'd3 && !neurons_first_i);
  reg walking_q = 1'b0;
  reg [3:0] share;
  always @* begin
    share = 4'd0;
    if (layer == 3'd7) begin
      if (kind == 3'd0)
        case (step)
          3'd0: share = {3'd0, sample_i};
          3'd1: share = {3'd0, ray_i};
          3'd2: share = {3'd0, active_i && !walking_q};  // a walk's own cycles are no work
          3'd3: share = {3'd0, busy_i != 5'd0};
          3'd4: share = {3'd0, stall_in_i && !walking_q};
          3'd5: share = {3'd0, stall_out_i};
          default: share = 4'd0;
        endcase
      if (kind == 3'd1 && step <= 3'd4) share = {3'd0, busy_i[step]};
    end else if (layer <= 3'd4)
      case (kind)
        3'd0: share = mac ? n : 4'd0;
        3'd1: share = sop ? n : 4'd0;
        3'd2: share = neurons && acts ? neurons_fired_i[3:0] : 4'd0;
        3'd3: share = update;
        3'd4: share = read ? n : 4'd0;
        3'd5: share = reads_state ? bytes : 4'd0;
        3'd6: share = bytes;
        default: share = {3'd0, !neurons && asks};
      endcase
  end

  // ---- what was counted, removed and shown
  reg clear_q = 1'b1, snapshot_q = 1'b0;  // wanted
  reg clears_q = 1'b0, shows_q = 1'b0;    // the walk under way
  reg known_q = 1'b0, shown_known_q = 1'b0;
  reg [8:0] place_q = 9'd0;
  reg [3:0] total_q, removed_q, shown_q, window_q;
  reg held_q = 1'b0, looked_q = 1'b0;
  wire begins = (clear_q || snapshot_q) && !walking_q && quiet_i;
  wire ends = walking_q && place_q == 9'd511;
  always @(posedge clk_i) begin
    if (rst_n_q) begin
      clear_q <= clear_i || (clear_q && !begins);
      snapshot_q <= snapshot_i || (snapshot_q && !begins);
      walking_q <= begins || (walking_q && !ends);
      if (walking_q) place_q <= place_q + 9'd1;
      if (begins) {clears_q, shows_q} <= {clear_q, snapshot_q};
      if (ends && clears_q) known_q <= 1'b1;
      if (ends && shows_q && known_q) shown_known_q <= 1'b1;
      if (ends && shows_q && !known_q) shown_known_q <= 1'b0;
    end
    total_q <= begins && clear_q ? 4'd0 : total_q + share;
    if (begins) removed_q <= total_q + share;
    if (ends && shows_q) shown_q <= removed_q;
    held_q <= hold && quiet_i;
    looked_q <= index_i == watched;
    window_q <= window;
  end

  wire [8:0] wiped_at = {3'd7, layer, step};
  wire passed = walking_q && place_q > watched;
  // A value that was read waits a cycle before it is in the window.
  wire waits = peek_write_q && peek_write_place_q == watched;
  wire [3:0] seen = waits ? written : window;
  wire events = d1_row_i || c1_row_i || c1_bias_row_i || c1_products_i || d2_row_i || c2_row_i || c2_bias_row_i || c3_row_i || c3_bias_row_i || busy_i != 5'd0
              || ray_i || neurons_valid_i || update_i || special_i || sample_i || stall_out_i;
  always @* begin
    assume (!quiet_i || !events);   // sf_core, sf_readout: idle
    assume (!held_q || quiet_i);    // sf_core begins no sample
    if (!rst_n_q) begin
      at_reset : assert ({clear_q, snapshot_q, walking_q, known_q, shown_known_q, place_q} == {5'b10000, 9'd0});
    end else begin
      every_command : assert (peek_clear_wanted_q == clear_q && peek_snapshot_wanted_q == snapshot_q);
      walks : assert (peek_walk_q == walking_q && peek_place_q == place_q && (walking_q || place_q == 9'd0));
      walks_as_wanted : assert (!walking_q || (peek_walk_clear_q == clears_q && peek_walk_snapshot_q == shows_q));
      holds : assert (hold == (clear_q || snapshot_q || walking_q) && busy == (hold || peek_write_q));
      only_when_quiet : assert (!walking_q || (held_q && quiet_i));
      frozen : assert (!walking_q || total_q == (clears_q ? 4'd0 : removed_q));
      counts : assert (walking_q || !known_q || value == total_q);
      kept : assert (!walking_q || clears_q || !known_q || value == removed_q);
      kept_until_read : assert (!walking_q || passed || !known_q || value == removed_q);
      cleared : assert (!walking_q || !clears_q || layer == 3'd7 || place_q <= wiped_at || value == 4'd0);
      all_or_nothing : assert (!walking_q || !known_q || value == removed_q || (value == 4'd0 && clears_q && place_q[8:6] == 3'd7));
      clears_together : assert (!walking_q || layer != 3'd7 || !known_q || value == removed_q);
      snapshot : assert (passed && shows_q ? !known_q || seen == removed_q : !shown_known_q || seen == shown_q);
      writes : assert (walking_q ? peek_write_q == (shows_q && place_q != 9'd0) : !peek_write_q || peek_write_place_q == 9'd511);
      follows : assert (!walking_q || !peek_write_q || peek_write_place_q == place_q - 9'd1);
      reads : assert (!looked_q || counter == window_q);
    end
  end
endmodule

`default_nettype wire
