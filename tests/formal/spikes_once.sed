# What both places hold of the neuron looked at, step by step, for the invariant.
s/^    output wire +idle_o/&,\n    input  wire [INDEX_BITS-1:0] look_i,\n    output wire [15:0] look_o/
s/^      assign stored\[.*/&\n      assign look_o[t] = spikes_q[{1'b0, look_i[INDEX_BITS-1:UNIT_BITS]}][look_i[UNIT_BITS-1:0]];\n      assign look_o[8+t] = spikes_q[{1'b1, look_i[INDEX_BITS-1:UNIT_BITS]}][look_i[UNIT_BITS-1:0]];/
