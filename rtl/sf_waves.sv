// Sums of features and a direction to the packet of a decoder: features, direction, sines and cosines of 1, 2, 4 ... times
// each feature, then of the direction.
// Mirror: src/fx/sine.c; src/fx/tensorf.c (fx_vm_encode, waves)
//
// Two halves, each at work on a sample of its own. Scaling takes two cycles per feature: the feature, then its phase.
// The other half makes one value in every cycle and puts four into a beat.
`default_nettype none

module sf_waves (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    // programming
    input  wire [  5:0] features_i,        // 1..32
    input  wire [  2:0] feature_freqs_i,   // 0..4
    input  wire [  2:0] view_freqs_i,
    input  wire [  3:0] frac_i,            // LSB of directions and sines 2^-frac, 0..11
    input  wire [ 15:0] feature_mul_i,     // sum to feature
    input  wire [  5:0] feature_shift_i,
    input  wire [ 15:0] phase_mul_i,       // sum to phase in turns, Q.16
    input  wire [  5:0] phase_shift_i,
    // samples
    input  wire         valid_i,
    output wire         ready_o,
    input  wire [991:0] sums_i,            // as sf_basis
    input  wire [ 47:0] dir_i,             // {z, y, x}, signed Q1.14
    input  wire [ 47:0] turn_i,            // the same as phases
    // packets
    output wire         m_axis_tvalid_o,
    input  wire         m_axis_tready_i,
    output wire [ 63:0] m_axis_tdata_o,
    output wire         m_axis_tuser_o,
    output wire         m_axis_tlast_o
);
  // ---- scaling, into one of two banks
  reg scale_q;                    // at work
  reg [5:0] next_q;               // {feature, phase or not}
  reg into_q, from_q;             // banks
  reg [1:0] bank_full_q;
  reg [4:0] n_q;                  // last feature
  always_ff @(posedge clk_i) n_q <= 5'(features_i - 6'd1);
  wire issue = scale_q;
  wire issue_end = next_q == {n_q, 1'b1};
  reg [4:0] going_q;              // valid of each stage
  reg [4:0] phase_q;              // which kind
  reg [24:0] index_q;             // of which feature
  reg signed [30:0] sum_q;
  assign ready_o = scale_q && issue_end;
  wire begins = valid_i && !scale_q && going_q == 5'd0 && !bank_full_q[into_q];
  wire scaled = going_q[4] && going_q[3:0] == 4'd0 && !scale_q;
  wire last_beat;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {scale_q, into_q} <= 2'b00;
      bank_full_q <= 2'b00;
      {next_q, going_q} <= 11'd0;
    end else if (clear_i) begin
      {scale_q, into_q} <= 2'b00;
      bank_full_q <= 2'b00;
      {next_q, going_q} <= 11'd0;
    end else begin
      scale_q <= begins || (scale_q && !issue_end);
      next_q <= scale_q ? next_q + 6'd1 : 6'd0;
      going_q <= {going_q[3:0], issue};
      if (scaled) into_q <= !into_q;
      if (scaled) bank_full_q[into_q] <= 1'b1;
      if (last_beat) bank_full_q[from_q] <= 1'b0;
    end
  end
  wire signed [48:0] y;
  sf_rescale #(
      .IN(31)
  ) u_scale (
      .clk_i  (clk_i),
      .sum_i  (sum_q),
      .mul_i  (phase_q[0] ? phase_mul_i : feature_mul_i),
      .shift_i(phase_q[1] ? phase_shift_i : feature_shift_i),
      .bias_i (24'sd0),
      .y_o    (y)
  );
  reg signed [11:0] feature_q[0:63];
  reg [15:0] angle_q[0:63];
  wire [5:0] place = {into_q, index_q[24:20]};
  wire low = y < -49'sd2047;
  wire high = y > 49'sd2047;
  always_ff @(posedge clk_i) begin
    sum_q <= sums_i[31*next_q[5:1]+:31];
    phase_q <= {phase_q[3:0], next_q[0]};
    index_q <= {index_q[19:0], next_q[5:1]};
    if (going_q[4] && !phase_q[4]) feature_q[place] <= low ? -12'sd2047 : high ? 12'sd2047 : y[11:0];
    if (going_q[4] && phase_q[4]) angle_q[place] <= y[15:0];
  end
  reg [47:0] dir_q[0:1], turn_q[0:1];
  always_ff @(posedge clk_i) begin
    if (begins) dir_q[into_q] <= dir_i;
    if (begins) turn_q[into_q] <= turn_i;
  end

  // ---- values, in the order of the decoder's inputs
  localparam [2:0] FEATURES = 3'd0, AXES = 3'd1, SINES = 3'd2, COSINES = 3'd3, AXIS_SINES = 3'd4, AXIS_COSINES = 3'd5;
  reg work_q;
  reg [2:0] part_q;
  reg [4:0] value_q;
  reg [1:0] octave_q;
  reg [1:0] feature_last_q, view_last_q;  // octaves
  always_ff @(posedge clk_i) {feature_last_q, view_last_q} <= {2'(feature_freqs_i - 3'd1), 2'(view_freqs_i - 3'd1)};
  wire of_features = part_q == FEATURES || part_q == SINES || part_q == COSINES;
  wire once = part_q == FEATURES || part_q == AXES;
  wire octave_end = once || octave_q == (of_features ? feature_last_q : view_last_q);
  wire part_end = octave_end && value_q == (of_features ? n_q : 5'd2);
  wire no_sines = feature_freqs_i == 3'd0;
  wire no_axis_sines = view_freqs_i == 3'd0;
  reg [2:0] part_next;
  reg last_part;
  always_comb begin
    part_next = part_q + 3'd1;
    last_part = part_q == AXIS_COSINES;
    if (part_q == AXES && no_sines) part_next = AXIS_SINES;
    if (part_q == AXES && no_sines && no_axis_sines) last_part = 1'b1;
    if (part_q == COSINES && no_axis_sines) last_part = 1'b1;
  end
  wire room;
  wire give = work_q && room;
  assign last_beat = give && part_end && last_part;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {work_q, from_q} <= 2'b00;
    else if (clear_i) {work_q, from_q} <= 2'b00;
    else begin
      work_q <= work_q ? !last_beat : bank_full_q[from_q];
      if (last_beat) from_q <= !from_q;
    end
  end
  always_ff @(posedge clk_i) begin
    if (!work_q) begin
      part_q <= FEATURES;
      value_q <= 5'd0;
      octave_q <= 2'd0;
    end else if (room) begin
      octave_q <= octave_end ? 2'd0 : octave_q + 2'd1;
      if (octave_end) value_q <= part_end ? 5'd0 : value_q + 5'd1;
      if (part_end) part_q <= part_next;
    end
  end

  // ---- 1: the value, or the phase of a sine; 2: its octave; 3: its quarter; 4: table; 5: rise; 6: product; 7: from the
  // table; 8: Q1.14; 9: half of what is shifted away; 10: the LSB of the packet
  reg [9:0] valid_q;
  reg [9:0] last_q, first_q;
  reg [8:0] plain_q;   // a feature, which is whole
  reg [6:0] axis_q;    // of the direction
  reg signed [15:0] value1_q, value2_q, value3_q, value4_q, value5_q, value6_q, value7_q;
  reg [15:0] phase1_q, phase2_q;
  reg [1:0] octave1_q;
  reg cosine1_q;
  reg begun_q;
  wire [5:0] from = {from_q, value_q};
  wire [47:0] turns = turn_q[from_q];
  wire [47:0] axes = dir_q[from_q];
  wire [15:0] axis_value = value_q[1:0] == 2'd0 ? axes[15:0] : value_q[1:0] == 2'd1 ? axes[31:16] : axes[47:32];
  wire [15:0] axis_turn = value_q[1:0] == 2'd0 ? turns[15:0] : value_q[1:0] == 2'd1 ? turns[31:16] : turns[47:32];
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {valid_q, begun_q} <= 11'd0;
    else if (clear_i) {valid_q, begun_q} <= 11'd0;
    else if (room) begin
      valid_q <= {valid_q[8:0], work_q};
      if (work_q) begun_q <= !last_beat;
    end
  end

  // Within its half turn and folded at the quarter: 0..2^14. The end of the last piece is the whole quarter.
  wire [14:0] turned = phase2_q[14:0];
  wire [14:0] folded = turned > 15'd16384 ? 15'(16'd32768 - {1'b0, turned}) : turned;
  reg [14:0] quarter3_q;
  reg minus3_q;
  reg [4:0] minus_q;  // of stages 4 to 8
  wire [16:0] low_end;
  wire [16:0] high_end;
  sf_rom_sine u_rom (
      .index_i(quarter3_q[14] ? 8'd255 : quarter3_q[13:6]),
      .low_o  (low_end),
      .high_o (high_end)
  );
  reg [16:0] low4_q, high4_q, low5_q, low6_q, p7_q;
  reg [6:0] place4_q, place5_q;
  reg [8:0] rise5_q;
  reg [14:0] step6_q;
  reg signed [15:0] sine8_q;
  wire [14:0] rounding = step6_q + 15'd32;
  wire [17:0] magnitude = {1'b0, p7_q} + 18'd2;
  wire signed [15:0] sine = {magnitude[17], magnitude[16:2]};
  reg signed [16:0] half9_q;
  reg signed [11:0] value10_q;
  wire [3:0] down = 4'd14 - frac_i;
  wire [16:0] half = (17'd1 << down) >> 1;
  wire signed [16:0] shifted = half9_q >>> down;
  always_ff @(posedge clk_i) begin
    if (room) begin
      first_q <= {first_q[8:0], !begun_q};
      last_q <= {last_q[8:0], part_end && last_part};
      plain_q <= {plain_q[7:0], part_q == FEATURES};
      axis_q <= {axis_q[5:0], part_q == AXES};
      // 1, 2
      value1_q <= part_q == FEATURES ? 16'(feature_q[from]) : axis_value;
      phase1_q <= of_features ? angle_q[from] : axis_turn;
      octave1_q <= octave_q;
      cosine1_q <= part_q == COSINES || part_q == AXIS_COSINES;
      phase2_q <= (phase1_q << octave1_q) + {1'b0, cosine1_q, 14'd0};
      // 3 to 8
      quarter3_q <= folded;
      minus3_q <= phase2_q[15];
      {low4_q, high4_q, place4_q} <= {low_end, high_end, quarter3_q[14], quarter3_q[5:0]};
      rise5_q <= 9'(high4_q - low4_q);
      {low5_q, place5_q} <= {low4_q, place4_q};
      step6_q <= 15'(rise5_q) * 15'(place5_q);
      low6_q <= low5_q;
      p7_q <= low6_q + {8'd0, rounding[14:6]};
      minus_q <= {minus_q[3:0], minus3_q};
      sine8_q <= plain_q[6] || axis_q[6] ? value7_q : minus_q[3] ? -sine : sine;
      {value2_q, value3_q, value4_q, value5_q, value6_q, value7_q} <= {value1_q, value2_q, value3_q, value4_q, value5_q, value6_q};
      // 9, 10
      half9_q <= 17'(sine8_q) + (plain_q[7] ? 17'sd0 : $signed(half));
      value10_q <= plain_q[8] ? half9_q[11:0] : shifted > 17'sd2047 ? 12'sd2047 : shifted < -17'sd2047 ? -12'sd2047 : shifted[11:0];
    end
  end

  // ---- beats
  reg full_q, user_q, end_q;
  reg [1:0] at_q;
  reg signed [11:0] place_q[0:3];
  assign room = !full_q || m_axis_tready_i;
  wire put = valid_q[9] && room;
  wire beat_end = put && (at_q == 2'd3 || last_q[9]);
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      full_q <= 1'b0;
      at_q <= 2'd0;
    end else if (clear_i) begin
      full_q <= 1'b0;
      at_q <= 2'd0;
    end else begin
      if (room) full_q <= beat_end;
      if (put) at_q <= beat_end ? 2'd0 : at_q + 2'd1;
    end
  end
  integer i;
  always_ff @(posedge clk_i) begin
    for (i = 0; i < 4; i = i + 1) begin
      if (put && at_q == 2'(i)) place_q[i] <= value10_q;
      else if (put && at_q == 2'd0) place_q[i] <= 12'sd0;
    end
    if (put && at_q == 2'd0) user_q <= first_q[9];
    if (put) end_q <= last_q[9];
  end
  assign m_axis_tvalid_o = full_q;
  assign m_axis_tdata_o = {16'(place_q[3]), 16'(place_q[2]), 16'(place_q[1]), 16'(place_q[0])};
  assign m_axis_tuser_o = user_q;
  assign m_axis_tlast_o = end_q;
  wire unused_ok = &{1'b0, rounding[5:0], magnitude[1:0], minus_q[4], shifted[16:12], y[48:16]};
endmodule

`default_nettype wire
