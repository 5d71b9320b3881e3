// Two features from the entries of a cell's eight corners, a pair (x, x + 1) per valid_i. Mirror: src/fx/grid.c
// (fx_grid_features)
// Ten clock cycles after the fourth pair: the two features are rounded one after the other.
// Weights sum to 65536 and entries are at least -128, so the sums fit 24 bits at every corner.
`default_nettype none

module sf_trilinear (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        valid_i,
    input  wire [31:0] entries_i,  // of x + 1 and of x: {feature 1, feature 0}, signed
    input  wire [23:0] place_i,    // of the cell at work: {z, y, x}
    input  wire [ 4:0] shift_i,
    input  wire        last_i,
    output wire        pop_o,      // with the cell's fourth pair
    output wire        valid_o,
    output wire [23:0] features_o,
    output wire        last_o
);
  // The pair's weights and what they are for, four cycles
  localparam integer WEIGHING = 4;
  reg [1:0] pair_q;
  wire [16:0] weight0, weight1;
  sf_grid_weight u_weight (
      .clk_i    (clk_i),
      .x_i      (place_i[7:0]),
      .y_i      (place_i[15:8]),
      .z_i      (place_i[23:16]),
      .pair_i   (pair_q),
      .weight0_o(weight0),
      .weight1_o(weight1)
  );
  assign pop_o = valid_i && pair_q == 2'd3;
  reg [WEIGHING-1:0] valid_q, first_q, end_q;
  reg [32*WEIGHING-1:0] entries_q;
  reg [4:0] shift_q, ended_shift_q;  // of the cell whose fourth pair came last; of the one whose products are ready
  reg last_q, ended_last_q;

  // Products, sums of a pair, sums of the cell
  wire [31:0] entries = entries_q[32*WEIGHING-1-:32];
  reg signed [23:0] product00_q, product01_q, product10_q, product11_q, pair0_q, pair1_q, sum0_q, sum1_q;
  wire signed [25:0] product00 = $signed({1'b0, weight0}) * $signed(entries[7:0]);
  wire signed [25:0] product01 = $signed({1'b0, weight0}) * $signed(entries[15:8]);
  wire signed [25:0] product10 = $signed({1'b0, weight1}) * $signed(entries[23:16]);
  wire signed [25:0] product11 = $signed({1'b0, weight1}) * $signed(entries[31:24]);
  reg multiplied_q, begins_q, ends_q, added_q, begins2_q, ends2_q, summed_q;

  // Twice the feature, then the feature; first the one, then the other
  reg twice0_q, twice1_q, valid9_q, last8_q, last9_q;
  reg signed [23:0] other_sum_q;
  reg signed [24:0] twice_q;
  reg [11:0] feature0_q, feature1_q;
  wire signed [24:0] doubled = {twice0_q ? other_sum_q : sum0_q, 1'b0};
  wire signed [25:0] rounded = 26'(twice_q) + 26'sd1;
  wire signed [24:0] exact = rounded[25:1];
  wire fits = exact[24:11] == {14{exact[24]}} && exact[11:0] != 12'h800;
  wire [11:0] feature = fits ? exact[11:0] : {exact[24], {10{!exact[24]}}, 1'b1};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      pair_q <= 2'd0;
      valid_q <= '0;
      {multiplied_q, added_q, summed_q, twice0_q, twice1_q, valid9_q} <= 6'd0;
    end else if (clear_i) begin
      pair_q <= 2'd0;
      valid_q <= '0;
      {multiplied_q, added_q, summed_q, twice0_q, twice1_q, valid9_q} <= 6'd0;
    end else begin
      if (valid_i) pair_q <= pair_q + 2'd1;
      valid_q <= {valid_q[WEIGHING-2:0], valid_i};
      multiplied_q <= valid_q[WEIGHING-1];
      added_q <= multiplied_q;
      summed_q <= added_q && ends2_q;
      twice0_q <= summed_q;
      twice1_q <= twice0_q;
      valid9_q <= twice1_q;
    end
  end

  always_ff @(posedge clk_i) begin
    entries_q <= {entries_q[32*WEIGHING-33:0], entries_i};
    first_q <= {first_q[WEIGHING-2:0], pair_q == 2'd0};
    end_q <= {end_q[WEIGHING-2:0], pop_o};
    if (pop_o) {shift_q, last_q} <= {shift_i, last_i};
    if (end_q[WEIGHING-1] && valid_q[WEIGHING-1]) {ended_shift_q, ended_last_q} <= {shift_q, last_q};
    product00_q <= product00[23:0];
    product01_q <= product01[23:0];
    product10_q <= product10[23:0];
    product11_q <= product11[23:0];
    begins_q <= first_q[WEIGHING-1];
    ends_q <= end_q[WEIGHING-1];
    pair0_q <= product00_q + product10_q;
    pair1_q <= product01_q + product11_q;
    begins2_q <= begins_q;
    ends2_q <= ends_q;
    if (added_q) begin
      sum0_q <= (begins2_q ? 24'sd0 : sum0_q) + pair0_q;
      sum1_q <= (begins2_q ? 24'sd0 : sum1_q) + pair1_q;
    end
    // The next cell's fourth pair is at least four cycles away.
    if (summed_q) {other_sum_q, last8_q} <= {sum1_q, ended_last_q};
    twice_q <= doubled >>> ended_shift_q;
    if (twice0_q) feature0_q <= feature;
    if (twice1_q) feature1_q <= feature;
    last9_q <= last8_q;
  end

  assign valid_o = valid9_q;
  assign features_o = {feature1_q, feature0_q};
  assign last_o = last9_q;
  wire unused_ok = &{1'b0, product00[25:24], product01[25:24], product10[25:24], product11[25:24], rounded[0]};
endmodule

`default_nettype wire
