#n
# The queue between C1 and C2 and the rule by which C1 fires, out of sf_core as they stand there.
1 i\
`default_nettype none\
module sf_core_queue #(\
    parameter LANES = 4\
) (\
    input wire clk_i, input wire rst_ni, input wire clear_i,\
    input wire pending_i, input wire goes_i, output wire fire_o,\
    input wire valid_i, input wire [LANES-1:0] spikes, input wire [2:0] spikes_step,\
    input wire c2_done, output wire queue_valid_o, output wire [LANES-1:0] spikes_o, output wire [2:0] step_o,\
    input wire [1:0] look_i, output wire [LANES-1:0] look_o, output wire [2:0] look_step_o\
);\
  wire [2:0] pending_q = {1'b0, pending_i, 1'b0};\
  wire [2:0] spikes_valid = {1'b0, valid_i, 1'b0};\
  wire [2:0] wanted;\
  wire [2:0] fire = {1'b0, wanted[1] && goes_i && !clear_i, 1'b0};
/localparam QUEUE/ p
/reg \[2:0\] queue_room_q/ p
/assign wanted\[1\]/ p
/Spikes of C1, step by step/,/---- C2/ {
  /wire c2_done/! p
}
$ i\
  assign fire_o = fire[1];\
  assign queue_valid_o = queue_count_q != 3'd0;\
  assign spikes_o = queue_q[queue_read_q];\
  assign step_o = queue_step_q[queue_read_q];\
  assign look_o = queue_q[look_i];\
  assign look_step_o = queue_step_q[look_i];\
endmodule\
`default_nettype wire
