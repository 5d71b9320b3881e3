# What a bank holds of the step and the part looked at, in both samples, and what is on its way there; see sums_once.sv.
s/^    output wire +\[ +ROWS-1:0\] +tap_rows_o/&,\n    input  wire [2:0] look_i,\n    output wire [20*BANKS-1:0] look_o/
s/^      assign olds\[.*/&\n      assign look_o[20*b+:20] = {op1_q, op2_q, begun1_q, begun2_q, place1_q, place2_q, sum_q[{1'b1, look_i}][3:0], sum_q[{1'b0, look_i}][3:0]};/
# Of the outputs, side by side and alike, the first; of its 16 bits the low ones, which tell up to 15 rows.
s/16 ?\* ?ADDERS/16/g
s/i < ADDERS/i < 1/
s/\b16\b/4/g
