# One feature, whose row of weights is 1 at the component looked at and 0 at all others; its product is then that component.
# Registers that the property looks at are ports.
s/^    output wire \[991:0\] sums_o .*/    output wire [991:0] sums_o,\n    input  wire look_hit_i,\n    input  wire [3:0] look_component_i,\n    output wire [16:0] look_block_o,\n    output wire [7:0] look_row_o,\n    output wire [3:0] look_at_o,\n    output wire [13:0] look_flags_o,\n    output wire [71:0] look_way_o,\n    output wire [15:0] look_shifted_o,\n    output wire [6:0] look_count_o,\n    output wire [20:0] look_head_o,\n    output wire [1:0] look_ends_o/
s/^  \) u_blocks \(/&\n      .count_o(look_count_o),/
s/f < 32/f < 1/
s/i < 8; i/i < 0; i/
s/^    read_q <= row_q\[row\];/    read_q <= {255'd0, look_hit_i};/
s/24'\(\$signed\(x2_q\) \* \$signed\(read_q\[8\*f\+:8\]\)\)/read_q[0] ? {{8{x2_q[15]}}, x2_q} : 24'd0/
s/^      assign sums_o\[31\*f\+:31\] = out_q;/&\n      assign look_way_o = {read_q[0], x2_q, product_q, sum_q};/
s/^  assign valid_o = .*/&\n  assign look_block_o = {valid1_q, x1_q[16*look_component_i+:16]};\n  assign look_row_o = row;\n  assign look_ends_o = end_q[1:0];\n  assign look_head_o = {head_end, head_pair, head_block, head[16*look_component_i+:16]};\n  assign look_at_o = at_q;\n  assign look_shifted_o = shifted_q[16*(look_component_i-at_q)+:16];\n  assign look_flags_o = {tag1_q, held_q, whole_q, begun_q, work, valid_q[1:0], first_q[1:0], hand_over};/
