# Products come from the property, which says what they can be; a weight is its two factors side by side. Points and places
# within a cell are shown, of all axes, the row at hand,
# and the registers by which the property chooses: what it takes of a wire peek_X may not choose.
s/^    output wire +end_o .*/    output wire end_o,\n    input wire [104:0] look_products_i,\n    input wire [22:0] look_row_i,\n    output wire [32:0] look_at_o,\n    output wire [23:0] look_g_o,\n    output wire [10:0] look_y1_o,\n    output wire [11:0] look_width1_o,\n    output wire [6:0] look_key_o,\n    output wire look_appearance_o,\n    output wire [4:0] look_valid_o/
s/35'\(pos_q\[23:0\]\) \* 35'\(last_x\)/look_products_i[34:0]/
s/35'\(pos_q\[47:24\]\) \* 35'\(last_y\)/look_products_i[69:35]/
s/35'\(pos_q\[71:48\]\) \* 35'\(last_z\)/look_products_i[104:70]/
s/23'\(y1_q\) \* 23'\(width1_q\)/look_row_i/
s/\{17'\(beside1_q\) \* 17'\(b1_q\), 17'\(a1_q\) \* 17'\(b1_q\)\}/{b1_q[7:0], beside1_q, b1_q[7:0], a1_q}/
s/^  assign s_ready_o = .*/&\n  assign look_at_o = {at_q[2], at_q[1], at_q[0]};\n  assign look_g_o = {g_q[2], g_q[1], g_q[0]};\n  assign look_y1_o = y1_q;\n  assign look_width1_o = width1_q;\n  assign look_key_o = {pair_q, of_line_q, far_q, line_q, beside_q};\n  assign look_appearance_o = appearance_q;\n  assign look_valid_o = valid_q;/
