# What both places hold, for the invariant: at the step look_i and at any step.
s/^    output wire             idle_o/    output wire             idle_o,\n    input  wire [      2:0] look_i,\n    output wire [2*LANES-1:0] look_o,\n    output wire [2*LANES-1:0] look_any_o/
s/^  assign idle_o = .*/&\n  assign look_o = {spikes_q[{1'b1, look_i}], spikes_q[{1'b0, look_i}]};\n  assign look_any_o = {any_q[1], any_q[0]};/
