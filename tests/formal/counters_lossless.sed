# Counters of 4 bits: they only add, so the low bits of 64 behave alike. And a second look at the counters, by the same
# text, at a place the property chooses (watched_i) instead of the walk's. Of the window's memory only that place is left.
s/^  .*reg \[63:0\] window_q\[0:511\];/  reg [3:0] window_q;/
s/if \(write_q\) window_q\[write_place_q\] <= /if (write_q \&\& write_place_q == watched_i) window_q <= /
s/counter_o <= window_q\[index_i\]/counter_o <= window_q/
s/\[63:0\]/[3:0]/g
s/64'd/4'd/g
s/384'd0/24'd0/
s/n_fed\[64\*f\+:64\]/n_fed[4*f+:4]/
s/\{55'd0, ([a-z0-9]*_out_i|neurons_fired_i)\}/4'(\1)/
s/^    output reg  (.*counter_o)/    input  wire [ 8:0] watched_i,\n    output wire [ 3:0] value_o,\n    output wire [ 3:0] window_o,\n    output wire [ 3:0] written_o,\n    output reg  \1/
/wire \[2:0\] event_w = /,/^  assign hold_o/ {
  /^  assign hold_o/! H
  /^  assign hold_o/ {
    x
    s/place_q/watched_i/g
    s/(event_w|at_layer|at_step|at_narrow|at_neurons|integrating|neurons|fed|at_fed|updates|is_state|threefold|fourfold|mac|weight|global_value|place_value)\b/w_\1/g
    s/(d1_|c1_)w_(mac_q)/\1\2/g
    s/$/\n  assign written_o = written;\n  assign value_o = w_fourfold ? w_place_value << 2 : w_threefold ? (w_place_value << 1) + w_place_value : w_place_value;\n  assign window_o = window_q;\n/
    p
    x
  }
}
