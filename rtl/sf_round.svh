// The one rounding, the one saturation. Mirror: src/fx/round.h
// Included inside a module. 48 bits hold every product of this design before its shift: 29 x 13 bits at most.

// x / 2^n, round half up; arithmetic shift.
function automatic signed [47:0] sf_rshift_round(input signed [47:0] x, input [4:0] n);
  sf_rshift_round = n == 5'd0 ? x : (x + (48'sd1 <<< (n - 5'd1))) >>> n;
endfunction

// Clamp to a signed number of `bits` bits.
function automatic signed [47:0] sf_sat(input signed [47:0] x, input [5:0] bits);
  reg signed [47:0] high;
  begin
    high = (48'sd1 <<< (bits - 6'd1)) - 48'sd1;
    sf_sat = x > high ? high : x < -high - 48'sd1 ? -high - 48'sd1 : x;
  end
endfunction

// Clamp to an unsigned number of `bits` bits.
function automatic signed [47:0] sf_usat(input signed [47:0] x, input [5:0] bits);
  reg signed [47:0] high;
  begin
    high = (48'sd1 <<< bits) - 48'sd1;
    sf_usat = x > high ? high : x < 48'sd0 ? 48'sd0 : x;
  end
endfunction
