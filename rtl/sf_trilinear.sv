// Two features from the entries of a cell's eight corners, one corner per valid_i. Mirror: src/fx/grid.c (fx_grid_features)
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
  `include "sf_round.svh"

  // The corner's weight.
  reg [2:0] corner_q;
  wire [16:0] weight;
  sf_grid_weight u_weight (
      .x_i     (place_i[7:0]),
      .y_i     (place_i[15:8]),
      .z_i     (place_i[23:16]),
      .corner_i(corner_q),
      .weight_o(weight)
  );
  assign pop_o = valid_i && corner_q == 3'd7;

  reg weighed_q, first_q, end_q;
  reg signed [17:0] weight_q;
  reg signed [7:0] entry0_q, entry1_q;
  reg [4:0] shift_q;
  reg last_q;

  // Sums.
  reg summed_q, sum_last_q;
  reg [4:0] sum_shift_q;
  reg signed [23:0] sum0_q, sum1_q;
  wire signed [25:0] product0 = weight_q * entry0_q;
  wire signed [25:0] product1 = weight_q * entry1_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      corner_q <= 3'd0;
      {weighed_q, summed_q} <= 2'd0;
    end else if (clear_i) begin
      corner_q <= 3'd0;
      {weighed_q, summed_q} <= 2'd0;
    end else begin
      if (valid_i) corner_q <= corner_q + 3'd1;
      weighed_q <= valid_i;
      summed_q <= weighed_q && end_q;
    end
  end

  always_ff @(posedge clk_i) begin
    weight_q <= {1'b0, weight};
    entry0_q <= entry_i[7:0];
    entry1_q <= entry_i[15:8];
    first_q <= corner_q == 3'd0;
    end_q <= pop_o;
    shift_q <= shift_i;
    last_q <= last_i;
    if (weighed_q) begin
      sum0_q <= (first_q ? 24'sd0 : sum0_q) + product0[23:0];
      sum1_q <= (first_q ? 24'sd0 : sum1_q) + product1[23:0];
      sum_shift_q <= shift_q;
      sum_last_q <= last_q;
    end
  end

  function automatic [11:0] feature(input signed [23:0] sum, input [4:0] shift);
    reg signed [47:0] exact;
    begin
      exact = sf_rshift_round(48'(sum), shift);
      feature = exact > 48'sd2047 ? 12'sd2047 : exact < -48'sd2047 ? -12'sd2047 : exact[11:0];
    end
  endfunction

  assign valid_o = summed_q;
  assign features_o = {feature(sum1_q, sum_shift_q), feature(sum0_q, sum_shift_q)};
  assign last_o = sum_last_q;
  wire unused_ok = &{1'b0, product0[25:24], product1[25:24]};
endmodule

`default_nettype wire
