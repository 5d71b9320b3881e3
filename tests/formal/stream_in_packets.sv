// Samples in, for every size of packet: good packets become samples, each once and in order, never overwritten, stable
// until done; every other packet raises its error in the beat that shows it, and then nothing becomes a sample until
// the soft reset. Wires peek_X are u_dut.X: the invariants need the inside.
`default_nettype none

module stream_in_packets (
    input wire        clk_i,
    input wire        clear_i,
    input wire        enable_i,
    input wire        tvalid_i,
    input wire [63:0] tdata_i,
    input wire        tuser_i,
    input wire        tlast_i,
    input wire        done_i,
    input wire [ 5:0] n_feature,
    input wire [ 7:0] n_dir,
    input wire [ 4:0] feature_index,
    input wire [ 7:0] dir_index
);
  reg [26:0] constant_q;
  wire [26:0] constant = {n_feature, n_dir, feature_index, dir_index};
  always @(posedge clk_i) constant_q <= constant;
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire tready, valid, first, empty, error_packet, error_value;
  wire [11:0] feature, dir;
  sf_stream_in u_dut (
      .*,
      .rst_ni         (rst_n_q),
      .n_feature_i    (n_feature),
      .n_dir_i        (n_dir),
      .tready_o       (tready),
      .valid_o        (valid),
      .first_o        (first),
      .feature_index_i(feature_index),
      .feature_o      (feature),
      .dir_index_i    (dir_index),
      .dir_o          (dir),
      .empty_o        (empty),
      .error_packet_o (error_packet),
      .error_value_o  (error_value)
  );

  wire [1:0] peek_full_q, peek_first_q;
  wire [5:0] peek_beat_q;
  wire peek_write_q, peek_read_q, peek_drop_q, peek_begun_q, peek_in_dir_q, peek_packet_first_q, peek_have_dir_q;

  // The specification: place in the packet, its length, samples inside.
  reg [5:0] place_q = 6'd0;
  reg [1:0] inside_q = 2'd0;
  reg bad_q = 1'b0, had_one_q = 1'b0, first_packet_q = 1'b0;
  reg oldest_q, newest_q;  // their first flags
  reg waits_q = 1'b0, was_first_q;
  reg [11:0] was_feature_q, was_dir_q;
  wire of_first = place_q == 6'd0 ? tuser_i : first_packet_q;
  wire [5:0] dir_beats = of_first ? n_dir[7:2] + {5'd0, |n_dir[1:0]} : 6'd0;
  wire [5:0] beats = dir_beats + {2'd0, n_feature[5:2]} + {5'd0, |n_feature[1:0]};
  wire take = tvalid_i && tready && !bad_q;
  wire end_of_packet = place_q == beats - 6'd1;
  wire wide = !(&tdata_i[15:11] || !(|tdata_i[15:11])) || !(&tdata_i[31:27] || !(|tdata_i[31:27]))
      || !(&tdata_i[47:43] || !(|tdata_i[47:43])) || !(&tdata_i[63:59] || !(|tdata_i[63:59]));
  wire wrong = tlast_i != end_of_packet || (place_q == 6'd0 && !tuser_i && (!had_one_q || n_feature == 6'd0));
  wire good = take && end_of_packet && !wrong && !wide;
  always @(posedge clk_i) begin
    if (clear_i) begin
      place_q <= 6'd0;
      inside_q <= 2'd0;
      bad_q <= 1'b0;
      had_one_q <= 1'b0;
    end else if (rst_n_q) begin
      if (take) begin
        place_q <= end_of_packet ? 6'd0 : place_q + 6'd1;
        first_packet_q <= of_first;
        bad_q <= wrong || wide;
      end
      inside_q <= inside_q + {1'b0, good} - {1'b0, done_i};
      if (good) begin
        had_one_q <= 1'b1;
        newest_q <= of_first;
      end
      if (good && (inside_q == 2'd0 || (inside_q == 2'd1 && done_i))) oldest_q <= of_first;
      else if (done_i) oldest_q <= newest_q;
    end
    waits_q <= valid && !done_i && !clear_i;
    was_first_q <= first;
    was_feature_q <= feature;
    was_dir_q <= dir;
  end

  // Where the unit's own state stands to it.
  wire [5:0] begun_dir_beats = first_packet_q ? n_dir[7:2] + {5'd0, |n_dir[1:0]} : 6'd0;
  wire [5:0] begun_place = peek_beat_q + (begun_dir_beats & {6{~peek_in_dir_q}});
  always @* begin
    assume (n_feature == 6'd0 ? n_dir >= 8'd1 && n_dir <= 8'd160 : n_feature <= 6'd32 && n_dir <= 8'd160);
    assume (!done_i || valid);
    assume (!rst_n_q || constant == constant_q);  // any, but always the same
    if (rst_n_q) begin
      samples_inside : assert (valid == (inside_q != 2'd0) && inside_q != 2'd3);
      full_is_not_taken : assert (!(take && inside_q == 2'd2));
      first_in_order : assert (!valid || first == oldest_q);
      stable_until_done : assert (!waits_q || (valid && first == was_first_q && feature == was_feature_q
                                               && dir == was_dir_q));
      wrong_packet_is_an_error : assert (error_packet == (take && wrong));
      wide_value_is_an_error : assert (error_value == (take && wide));
      discards_after_an_error : assert (!bad_q || tready);
      accepts_when_it_can : assert (!(enable_i && inside_q != 2'd2) || tready);
      nothing_while_disabled : assert (bad_q || enable_i || !tready);
      empty_means_nothing : assert (!empty || (inside_q == 2'd0 && place_q == 6'd0));

      invariant_drop : assert (peek_drop_q == bad_q && peek_have_dir_q == had_one_q);
      invariant_full : assert ({1'b0, peek_full_q[0]} + {1'b0, peek_full_q[1]} == inside_q);
      invariant_banks : assert (inside_q == 2'd1 ? peek_full_q[peek_read_q] && peek_write_q != peek_read_q
                                                 : peek_write_q == peek_read_q);
      invariant_oldest : assert (inside_q == 2'd0 || peek_first_q[peek_read_q] == oldest_q);
      invariant_newest : assert (inside_q == 2'd0 || peek_first_q[!peek_write_q] == newest_q);
      invariant_begun : assert (peek_begun_q == (place_q != 6'd0));
      invariant_beat : assert (peek_begun_q || peek_beat_q == 6'd0);
      invariant_place : assert (!peek_begun_q || (begun_place == place_q && peek_packet_first_q == first_packet_q
                                                  && (bad_q || place_q < begun_dir_beats + {2'd0, n_feature[5:2]} + {5'd0, |n_feature[1:0]})));
      invariant_dir : assert (!peek_begun_q || peek_in_dir_q == (place_q < begun_dir_beats));
    end
  end
endmodule

`default_nettype wire
