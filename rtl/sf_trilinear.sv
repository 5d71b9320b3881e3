// Two features from the entries of a cell's eight corners, one corner per valid_i. Mirror: src/fx/grid.c (fx_grid_features)
// Nine clock cycles after the eighth entry: the two features are rounded one after the other.
// Weights sum to 65536 and entries are at least -128, so the sums fit 24 bits at every corner.
`default_nettype none

module sf_trilinear (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        valid_i,
    input  wire [15:0] entry_i,   // {feature 1, feature 0}, signed
    input  wire [23:0] place_i,   // of the cell at work: {z, y, x}
    input  wire [ 4:0] shift_i,
    input  wire        last_i,
    output wire        pop_o,     // with the cell's eighth entry
    output wire        valid_o,
    output wire [23:0] features_o,
    output wire        last_o
);
  // The corner's weight and what it is for, four cycles
  localparam integer WEIGHING = 4;
  reg [2:0] corner_q;
  wire [16:0] weight;
  sf_grid_weight u_weight (
      .clk_i   (clk_i),
      .x_i     (place_i[7:0]),
      .y_i     (place_i[15:8]),
      .z_i     (place_i[23:16]),
      .corner_i(corner_q),
      .weight_o(weight)
  );
  assign pop_o = valid_i && corner_q == 3'd7;
  reg [WEIGHING-1:0] valid_q, first_q, end_q;
  reg [16*WEIGHING-1:0] entry_q;
  reg [4:0] shift_q;  // of the cell whose eighth entry came last
  reg last_q;

  // Products, sums
  wire signed [17:0] factor = $signed({1'b0, weight});
  wire signed [7:0] entry0 = $signed(entry_q[16*WEIGHING-16+:8]);
  wire signed [7:0] entry1 = $signed(entry_q[16*WEIGHING-8+:8]);
  wire signed [25:0] product0 = factor * entry0;
  wire signed [25:0] product1 = factor * entry1;
  reg multiplied_q, begins_q, ends_q, summed_q;
  reg signed [23:0] product0_q, product1_q, sum0_q, sum1_q;

  // Twice the feature, then the feature; first the one, then the other
  reg twice0_q, twice1_q, valid8_q, last7_q, last8_q;
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
      corner_q <= 3'd0;
      valid_q <= '0;
      {multiplied_q, summed_q, twice0_q, twice1_q, valid8_q} <= 5'd0;
    end else if (clear_i) begin
      corner_q <= 3'd0;
      valid_q <= '0;
      {multiplied_q, summed_q, twice0_q, twice1_q, valid8_q} <= 5'd0;
    end else begin
      if (valid_i) corner_q <= corner_q + 3'd1;
      valid_q <= {valid_q[WEIGHING-2:0], valid_i};
      multiplied_q <= valid_q[WEIGHING-1];
      summed_q <= multiplied_q && ends_q;
      twice0_q <= summed_q;
      twice1_q <= twice0_q;
      valid8_q <= twice1_q;
    end
  end

  always_ff @(posedge clk_i) begin
    entry_q <= {entry_q[16*WEIGHING-17:0], entry_i};
    first_q <= {first_q[WEIGHING-2:0], corner_q == 3'd0};
    end_q <= {end_q[WEIGHING-2:0], pop_o};
    if (pop_o) {shift_q, last_q} <= {shift_i, last_i};
    product0_q <= product0[23:0];
    product1_q <= product1[23:0];
    begins_q <= first_q[WEIGHING-1];
    ends_q <= end_q[WEIGHING-1];
    if (multiplied_q) begin
      sum0_q <= (begins_q ? 24'sd0 : sum0_q) + product0_q;
      sum1_q <= (begins_q ? 24'sd0 : sum1_q) + product1_q;
    end
    // The next cell's eighth entry is at least eight cycles away.
    if (summed_q) {other_sum_q, last7_q} <= {sum1_q, last_q};
    twice_q <= doubled >>> shift_q;
    if (twice0_q) feature0_q <= feature;
    if (twice1_q) feature1_q <= feature;
    last8_q <= last7_q;
  end

  assign valid_o = valid8_q;
  assign features_o = {feature1_q, feature0_q};
  assign last_o = last8_q;
  wire unused_ok = &{1'b0, product0[25:24], product1[25:24], rounded[0]};
endmodule

`default_nettype wire
