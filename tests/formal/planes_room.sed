# Out of sf_planes, what counts appearances: the room for them, who may begin, and the queue of their directions.
1i module sf_planes (\n    input  wire clk_i, rst_ni, clear_i,\n    input  wire read_valid, read_appearance, reads_ready, sums_valid, sums_ready,\n    input  wire [47:0] read_dir, turn_q,\n    output wire read_ready, dir_valid,\n    output wire [47:0] dir, turn,\n    output wire look_begins_o, look_start_o,\n    output wire [6:0] look_dirs_o\n);
$a\  assign look_begins_o = begins;\nendmodule
/^  wire reads_ready, sums_ready, sums_valid;/d
/^      \.s_valid_i +\(read_valid/{
s/^.*\((.*)\),/  assign look_start_o = \1;/
b
}
/^  localparam \[2:0\] APPEARANCES/,/^  end$/b
/^  sf_fifo #/,/^  \);/{
s/^  \) u_dirs \(/&\n      .count_o(look_dirs_o),/
b
}
d
