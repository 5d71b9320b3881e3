// Accumulators of a layer fed by values (D1, C1): one row of weights times one value per cycle.
// Mirror: src/fx/current.c. Width: of 32 rows |sum| <= 32 * 2048 * 127 < 2^23, of 161 < 2^26; a current has 24 bits.
// Datapath registers have no reset: the first row of a sum defines them.
`default_nettype none

module sf_mac #(
    parameter LANES = 128,
    parameter SUM_BITS = 24
) (
    input  wire                       clk_i,
    input  wire                       row_valid_i,
    input  wire                       first_i,     // begins a sum: from 0, or from the base
    input  wire                       base_i,
    input  wire                       zero_i,      // begins a sum without a row
    input  wire signed [        11:0] value_i,
    input  wire        [ 8*LANES-1:0] row_i,
    input  wire                       keep_i,      // base = sum
    input  wire                       move_i,      // current = saturated sum; a new sum may begin in the same cycle
    output reg         [24*LANES-1:0] current_o
);
  `include "sf_round.svh"

  reg signed [SUM_BITS-1:0] acc_q[0:LANES-1];
  reg signed [19:0] product;  // names a product, not a register
  reg [24*LANES-1:0] base_q;
  reg [24*LANES-1:0] sums;  // names a whole row within one operation, not a register

  always_ff @(posedge clk_i) begin
    if (keep_i || move_i) begin
      for (int l = 0; l < LANES; l++)
        sums[24*l+:24] = SUM_BITS > 24 ? 24'(sf_sat(48'(acc_q[l]), 6'd24)) : 24'(acc_q[l]);
      if (keep_i) base_q <= sums;
      if (move_i) current_o <= sums;
    end
    if (row_valid_i) begin
      if (zero_i) begin
        for (int l = 0; l < LANES; l++) acc_q[l] = base_i ? SUM_BITS'($signed(base_q[24*l+:24])) : {SUM_BITS{1'b0}};
      end else if (first_i && base_i) begin
        for (int l = 0; l < LANES; l++) begin
          product = $signed(row_i[8*l+:8]) * value_i;
          acc_q[l] = SUM_BITS'($signed(base_q[24*l+:24])) + SUM_BITS'(product);
        end
      end else if (first_i) begin
        for (int l = 0; l < LANES; l++) begin
          product = $signed(row_i[8*l+:8]) * value_i;
          acc_q[l] = SUM_BITS'(product);
        end
      end else begin
        for (int l = 0; l < LANES; l++) begin
          product = $signed(row_i[8*l+:8]) * value_i;
          acc_q[l] = acc_q[l] + SUM_BITS'(product);
        end
      end
    end
  end
endmodule

`default_nettype wire
