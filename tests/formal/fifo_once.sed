# The place of the word looked at, for the invariant.
s/^    output wire \[WIDTH-1:0\] data_o/&,\n    input  wire [LOG2_DEPTH-1:0] look_i,\n    output wire [WIDTH-1:0] look_o/
s/^  assign valid_o = .*/&\n  assign look_o = word_q[look_i];/
