// Decay and hybrid mode, over any number of steps: the membrane stays between the extremes of 0 and the currents it was
// given. The bounds are arbitrary, so this is the statement for every range of currents. The unit stands here as what
// plif_spec proves of it: a membrane between v and the current, and a reset that leaves no debt.
`default_nettype none

module plif_steps (
    input wire               clk_i,
    input wire signed [23:0] current_i,
    input wire signed [23:0] membrane_i,
    input wire signed [23:0] theta_i,
    input wire               first_i
);
  (* anyconst *) wire signed [23:0] low;
  (* anyconst *) wire signed [23:0] high;
  reg started_q = 1'b0;
  reg signed [23:0] v_q;
  wire signed [23:0] old = first_i ? 24'sd0 : v_q;
  wire signed [23:0] after = membrane_i >= theta_i ? membrane_i - theta_i : membrane_i;

  always @(posedge clk_i) begin
    started_q <= 1'b1;
    v_q <= after;
  end

  always @* begin
    assume (low <= 24'sd0 && high >= 24'sd0);
    assume (current_i >= low && current_i <= high);
    assume (theta_i >= 24'sd1);
    assume (old < current_i ? membrane_i >= old && membrane_i <= current_i
                            : membrane_i >= current_i && membrane_i <= old);
    assume (started_q || first_i);  // a sample begins with its first step
    if (started_q) stays_in_range : assert (v_q >= low && v_q <= high);
  end
endmodule

`default_nettype wire
