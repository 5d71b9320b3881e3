# The memory of the constant inputs with 8 of its 64 places a bank: a place is only written while its bank is filled and
# only read while it is not, wherever in the bank it lies.
s/reg \[47:0\] dir_q\[0:127\];/reg [47:0] dir_q[0:15];/
s/dir_q\[\{write_q, beat_q\}\]/dir_q[{write_q, beat_q[2:0]}]/
s/dir_q\[\{read_q, dir_index_i\[7:2\]\}\]/dir_q[{read_q, dir_index_i[4:2]}]/
