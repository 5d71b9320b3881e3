// Samples in over AXI4-Stream, double-buffered. Two's complement values, 16 bits each, four per beat, the first in
// bits 15:0.
// A packet is one sample: with tuser on its first beat, the direction of a new ray (n_dir values, padded to whole
// beats), then the features (n_feature values, padded likewise); tlast on its last beat. Padding is 0. Without features,
// as of a decoder, every sample has tuser and its own direction.
// A bad packet raises error_packet_o or error_value_o; from then on everything is discarded until a soft reset,
// because later samples of the ray would use the wrong direction.
`default_nettype none

module sf_stream_in (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        enable_i,
    input  wire [ 5:0] n_feature_i,
    input  wire [ 7:0] n_dir_i,
    input  wire        tvalid_i,
    output wire        tready_o,
    input  wire [63:0] tdata_i,
    input  wire        tuser_i,
    input  wire        tlast_i,
    output wire        valid_o,
    output wire        first_o,
    input  wire        done_i,
    input  wire [ 4:0] feature_index_i,
    output wire [11:0] feature_o,
    input  wire [ 7:0] dir_index_i,
    output wire [11:0] dir_o,
    output wire        empty_o,
    output wire        error_packet_o,
    output wire        error_value_o
);
  reg [11:0] feature_q[0:63];
  reg [47:0] dir_q[0:127];  // by beat
  reg [1:0] full_q, first_q;
  reg write_q, read_q;     // bank
  reg [5:0] beat_q;
  reg begun_q, in_dir_q, packet_first_q, have_dir_q, drop_q;

  wire dir_part = begun_q ? in_dir_q : tuser_i && n_dir_i != 8'd0;
  wire packet_first = begun_q ? packet_first_q : tuser_i;
  wire no_features = n_feature_i == 6'd0;
  wire [5:0] dir_beats = 6'((n_dir_i + 8'd3) >> 2);
  wire [3:0] feature_beats = 4'(({1'b0, n_feature_i} + 7'd3) >> 2);
  wire dir_end = dir_part && beat_q == dir_beats - 6'd1;
  wire end_expected = no_features ? dir_end : !dir_part && beat_q == {2'd0, feature_beats} - 6'd1;

  assign tready_o = drop_q || (enable_i && !full_q[write_q]);
  wire beat = tvalid_i && tready_o && !drop_q;

  // Padding counts as values: it has to be in range too.
  reg wide_value;
  always_comb begin
    wide_value = 1'b0;
    for (int i = 0; i < 4; i++)
      if (tdata_i[16*i+11+:5] != 5'd0 && tdata_i[16*i+11+:5] != 5'h1f) wide_value = 1'b1;
  end
  wire no_direction = !begun_q && !tuser_i && (no_features || !have_dir_q);
  assign error_packet_o = beat && (tlast_i != end_expected || no_direction);
  assign error_value_o = beat && wide_value;
  wire bad = error_packet_o || error_value_o;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      full_q <= 2'd0;
      {write_q, read_q, beat_q, begun_q, have_dir_q, drop_q} <= 11'd0;
    end else if (clear_i) begin
      full_q <= 2'd0;
      {write_q, read_q, beat_q, begun_q, have_dir_q, drop_q} <= 11'd0;
    end else begin
      if (bad) drop_q <= 1'b1;
      if (beat) begin
        beat_q <= dir_end || end_expected ? 6'd0 : beat_q + 6'd1;
        begun_q <= !end_expected;
        if (end_expected && !bad) begin
          full_q[write_q] <= 1'b1;
          write_q <= !write_q;
          have_dir_q <= 1'b1;
        end
      end
      if (done_i) begin
        full_q[read_q] <= 1'b0;
        read_q <= !read_q;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (beat) begin
      in_dir_q <= dir_part && !dir_end;
      packet_first_q <= packet_first;
      first_q[write_q] <= packet_first;
      if (dir_part) begin
        dir_q[{write_q, beat_q}] <= {tdata_i[59:48], tdata_i[43:32], tdata_i[27:16], tdata_i[11:0]};
      end else begin
        for (int i = 0; i < 4; i++) feature_q[{write_q, beat_q[2:0], i[1:0]}] <= tdata_i[16*i+:12];
      end
    end
  end

  assign valid_o = full_q[read_q];
  assign first_o = first_q[read_q];
  assign feature_o = feature_q[{read_q, feature_index_i}];
  wire [47:0] dir_beat = dir_q[{read_q, dir_index_i[7:2]}];
  assign dir_o = dir_beat[12*dir_index_i[1:0]+:12];
  assign empty_o = full_q == 2'd0 && !begun_q;
endmodule

`default_nettype wire
