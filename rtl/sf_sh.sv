// Spherical harmonics of a direction, one after the other, from one 18 x 18 multiplier. Mirror: src/fx/sh.c
// 6 products of two axes, then two for each harmonic: 2 n + 15 cycles for n harmonics when the sink does not stall. That
// is once per ray, beside the 8 cycles per level and sample that its grid features take; more multipliers would idle.
//
// Issue slots: 0..5 products; from 6 on, even slots a[i] = coefficient * u, odd ones dir[i-2] = a * q. Behind a slot its
// operands, their product, twice the rounded value and that value have a register each: a[i] is there for the slot that
// reads it, five later.
`default_nettype none

module sf_sh (
    input  wire               clk_i,
    input  wire               rst_ni,
    input  wire               clear_i,
    input  wire        [ 4:0] n_i,      // 1..16
    input  wire        [ 3:0] frac_i,   // LSB 2^-frac, 0..11
    input  wire               valid_i,
    output wire               ready_o,
    input  wire        [47:0] unit_i,   // {z, y, x}, signed Q1.14
    output wire               valid_o,
    input  wire               ready_i,
    output wire signed [11:0] dir_o,
    output wire               last_o
);
  localparam signed [17:0] UNIT_ONE = 18'sd16384;  // Q.14
  localparam signed [17:0] ONE = 18'sd32768, ZERO = 18'sd0;  // Q.15
  localparam [1:0] NONE = 2'd0, PRODUCT = 2'd1, FACTOR = 2'd2, VALUE = 2'd3;

  function automatic signed [17:0] axis(input signed [15:0] v);
    axis = v > 16'sd16384 ? UNIT_ONE : v < -16'sd16384 ? -UNIT_ONE : 18'(v);
  endfunction

  reg active_q;
  reg [5:0] slot_q;
  reg signed [17:0] x_q, y_q, z_q;
  reg signed [17:0] xx_q, yy_q, zz_q, xy_q, yz_q, xz_q, a_q;  // Q.15; a in Q.16

  // Issue: the operands of a slot. q, a difference, is chosen two slots before.
  wire [4:0] pair = slot_q[5:1] - 5'd3;
  wire [3:0] index = pair[3:0];              // of a
  wire [3:0] next_value = pair[3:0] - 4'd1;  // of the dir of two slots later
  wire odd = slot_q[0];
  wire is_product = slot_q < 6'd6;
  wire is_factor = !is_product && !odd && pair < n_i;
  wire is_value = !is_product && odd && pair >= 5'd2;
  wire last_slot = is_value && pair == n_i + 5'd1;

  reg signed [17:0] coefficient, u, minuend, subtrahend, left, right;
  reg signed [17:0] minuend_q, subtrahend_q, q_q, three_xx_q, three_yy_q, three_zz_q, five_zz_q;
  always_comb begin
    case (index)
      4'd0: {coefficient, u} = {18'sd18487, UNIT_ONE};
      4'd1: {coefficient, u} = {-18'sd32021, y_q};
      4'd2: {coefficient, u} = {18'sd32021, z_q};
      4'd3: {coefficient, u} = {-18'sd32021, x_q};
      4'd4: {coefficient, u} = {18'sd71601, UNIT_ONE};
      4'd5: {coefficient, u} = {-18'sd71601, UNIT_ONE};
      4'd6: {coefficient, u} = {18'sd20670, UNIT_ONE};
      4'd7: {coefficient, u} = {-18'sd71601, UNIT_ONE};
      4'd8: {coefficient, u} = {18'sd35801, UNIT_ONE};
      4'd9: {coefficient, u} = {18'sd38669, y_q};
      4'd10: {coefficient, u} = {18'sd94720, z_q};
      4'd11: {coefficient, u} = {18'sd29953, y_q};
      4'd12: {coefficient, u} = {18'sd24456, z_q};
      4'd13: {coefficient, u} = {18'sd29953, x_q};
      4'd14: {coefficient, u} = {18'sd94720, z_q};
      default: {coefficient, u} = {-18'sd38669, x_q};
    endcase
    case (next_value)
      4'd4: {minuend, subtrahend} = {xy_q, ZERO};
      4'd5: {minuend, subtrahend} = {yz_q, ZERO};
      4'd6: {minuend, subtrahend} = {three_zz_q, ONE};
      4'd7: {minuend, subtrahend} = {xz_q, ZERO};
      4'd8, 4'd14: {minuend, subtrahend} = {xx_q, yy_q};
      4'd9: {minuend, subtrahend} = {yy_q, three_xx_q};
      4'd10: {minuend, subtrahend} = {xy_q <<< 1, ZERO};
      4'd11, 4'd13: {minuend, subtrahend} = {ONE, five_zz_q};
      4'd12: {minuend, subtrahend} = {five_zz_q, 18'sd3 * ONE};
      4'd15: {minuend, subtrahend} = {xx_q, three_yy_q};
      default: {minuend, subtrahend} = {ONE, ZERO};
    endcase
    case (slot_q)
      6'd0: {left, right} = {x_q, x_q};
      6'd1: {left, right} = {y_q, y_q};
      6'd2: {left, right} = {z_q, z_q};
      6'd3: {left, right} = {x_q, y_q};
      6'd4: {left, right} = {y_q, z_q};
      6'd5: {left, right} = {x_q, z_q};
      default: {left, right} = odd ? {a_q, q_q} : {coefficient, u};
    endcase
  end

  // The product, and what becomes of it.
  reg [1:0] kind1_q, kind2_q, kind3_q;
  reg [2:0] place1_q, place2_q, place3_q;
  reg last1_q, last2_q, last3_q;
  reg signed [17:0] left_q, right_q;
  reg signed [35:0] product_q;
  wire [3:0] down = 4'd11 - frac_i;
  wire signed [16:0] value2 = $signed(product_q[35:19]) >>> down;
  reg signed [18:0] twice_q;
  wire signed [18:0] above = twice_q + 19'sd1;
  wire signed [17:0] rounded = above[18:1];
  wire fits = rounded[17:11] == {7{rounded[17]}} && rounded[11:0] != 12'h800;
  wire [1:0] kind = !active_q ? NONE : is_product ? PRODUCT : is_factor ? FACTOR : is_value ? VALUE : NONE;

  reg out_valid_q, out_last_q;
  reg signed [11:0] out_q;
  wire step = !out_valid_q || ready_i;
  assign ready_o = !active_q && {kind1_q, kind2_q, kind3_q} == {3{NONE}} && !out_valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {active_q, kind1_q, kind2_q, kind3_q, out_valid_q} <= 8'd0;
    end else if (clear_i) begin
      {active_q, kind1_q, kind2_q, kind3_q, out_valid_q} <= 8'd0;
    end else if (ready_o) begin
      active_q <= valid_i;
    end else if (step) begin
      if (last_slot) active_q <= 1'b0;
      {kind1_q, kind2_q, kind3_q} <= {kind, kind1_q, kind2_q};
      out_valid_q <= kind3_q == VALUE;
    end
  end

  always_ff @(posedge clk_i) begin
    three_xx_q <= (xx_q <<< 1) + xx_q;
    three_yy_q <= (yy_q <<< 1) + yy_q;
    three_zz_q <= (zz_q <<< 1) + zz_q;
    five_zz_q <= (zz_q <<< 2) + zz_q;
    if (ready_o) begin
      slot_q <= 6'd0;
      x_q <= axis(unit_i[15:0]);
      y_q <= axis(unit_i[31:16]);
      z_q <= axis(unit_i[47:32]);
    end else if (step) begin
      slot_q <= slot_q + 6'd1;
      {minuend_q, subtrahend_q} <= {minuend, subtrahend};
      q_q <= minuend_q - subtrahend_q;
      {left_q, right_q} <= {left, right};
      product_q <= left_q * right_q;
      twice_q <= kind2_q == PRODUCT ? product_q[30:12] : kind2_q == FACTOR ? product_q[31:13] : 19'(value2);
      {place1_q, place2_q, place3_q} <= {slot_q[2:0], place1_q, place2_q};
      {last1_q, last2_q, last3_q} <= {last_slot, last1_q, last2_q};
      if (kind3_q == PRODUCT) begin
        case (place3_q)
          3'd0: xx_q <= rounded;
          3'd1: yy_q <= rounded;
          3'd2: zz_q <= rounded;
          3'd3: xy_q <= rounded;
          3'd4: yz_q <= rounded;
          default: xz_q <= rounded;
        endcase
      end
      if (kind3_q == FACTOR) a_q <= rounded;
      out_q <= fits ? rounded[11:0] : {rounded[17], {10{!rounded[17]}}, 1'b1};
      out_last_q <= last3_q;
    end
  end

  assign valid_o = out_valid_q;
  assign dir_o = out_q;
  assign last_o = out_last_q;
  wire unused_ok = &{1'b0, product_q[11:0], above[0], pair[4]};
endmodule

`default_nettype wire
