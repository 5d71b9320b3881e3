// Output layers: currents of D2 and C3 through the tables into the integrators, one value per cycle, while the lanes go
// on. Mirror: src/fx/net.c (density_step, colour_step)
`default_nettype none

module sf_readout (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        take_i,         // currents are ready from the next cycle on
    input  wire        take_colour_i,
    output wire        ready_o,        // a TAKE may be issued
    output wire        current_colour_o,
    output wire [ 6:0] current_lane_o,
    input  wire [15:0] current_i,
    input  wire [ 1:0] mode_i,
    input  wire [ 3:0] steps_i,
    input  wire [12:0] k_density_i,
    input  wire [12:0] k_colour_i,
    input  wire [15:0] exp_mul_i,
    input  wire [ 4:0] exp_shift_i,
    input  wire [31:0] exp_bias_i,
    input  wire [15:0] sigmoid_mul_i,
    input  wire [ 4:0] sigmoid_shift_i,
    input  wire [31:0] sigmoid_bias_i,
    output wire        update_o,       // one integrator step: an event
    output wire        update_colour_o,
    output wire [ 2:0] update_step_o,
    output wire        valid_o,        // result of the sample
    input  wire        ready_i,
    output wire [27:0] sigma_o,
    output wire [59:0] colour_o
);
  // Stage 0 reads a current and scales it; 1 looks up; 2 integrates.
  reg run_q, colour_q;
  reg [2:0] step_q;
  reg [1:0] out_q;
  wire last_out = !colour_q || out_q == 2'd2;
  wire last = last_out && {1'b0, step_q} == steps_i - 4'd1;

  reg valid1_q, valid2_q, colour1_q, colour2_q, last1_q, last2_q;
  reg [2:0] step1_q, step2_q;
  reg [1:0] out1_q, out2_q;
  reg [17:0] argument_q;
  reg [27:0] in_q;
  reg done_q;
  reg [27:0] sigma_q;
  reg [19:0] colour_acc_q[0:2];

  wire [17:0] argument;
  wire [27:0] e;
  wire [15:0] s;
  wire [27:0] acc;

  assign current_colour_o = colour_q;
  assign current_lane_o = {step_q, 2'd0, out_q};
  sf_scale u_scale (
      .current_i(current_i),
      .mul_i    (colour_q ? sigmoid_mul_i : exp_mul_i),
      .shift_i  (colour_q ? sigmoid_shift_i : exp_shift_i),
      .bias_i   (colour_q ? sigmoid_bias_i : exp_bias_i),
      .colour_i (colour_q),
      .y_o      (argument)
  );
  sf_exp2 u_exp2 (
      .y_i(argument_q),
      .e_o(e)
  );
  sf_sigmoid u_sigmoid (
      .x_i(argument_q[15:0]),
      .s_o(s)
  );
  sf_integrate u_integrate (
      .acc_i   (colour2_q ? {8'd0, colour_acc_q[out2_q]} : sigma_q),
      .in_i    (in_q),
      .k_i     (colour2_q ? k_colour_i : k_density_i),
      .mode_i  (mode_i),
      .first_i (step2_q == 3'd0),
      .colour_i(colour2_q),
      .acc_o   (acc)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      run_q <= 1'b0;
      valid1_q <= 1'b0;
      valid2_q <= 1'b0;
      done_q <= 1'b0;
    end else if (clear_i) begin
      run_q <= 1'b0;
      valid1_q <= 1'b0;
      valid2_q <= 1'b0;
      done_q <= 1'b0;
    end else begin
      run_q <= take_i || (run_q && !last);
      valid1_q <= run_q;
      valid2_q <= valid1_q;
      if (valid2_q && last2_q && colour2_q) done_q <= 1'b1;
      else if (ready_i) done_q <= 1'b0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (take_i) begin
      colour_q <= take_colour_i;
      step_q <= 3'd0;
      out_q <= 2'd0;
    end else if (run_q) begin
      out_q <= last_out ? 2'd0 : out_q + 2'd1;
      if (last_out) step_q <= step_q + 3'd1;
    end
    colour1_q <= colour_q;
    step1_q <= step_q;
    out1_q <= out_q;
    last1_q <= last;
    argument_q <= argument;
    colour2_q <= colour1_q;
    step2_q <= step1_q;
    out2_q <= out1_q;
    last2_q <= last1_q;
    in_q <= colour1_q ? {12'd0, s} : e;
    if (valid2_q && colour2_q) colour_acc_q[out2_q] <= acc[19:0];
    if (valid2_q && !colour2_q) sigma_q <= acc;
  end

  assign ready_o = !run_q && !valid1_q && !valid2_q && !done_q && !take_i;
  assign update_o = valid2_q;
  assign update_colour_o = colour2_q;
  assign update_step_o = step2_q;
  assign valid_o = done_q;
  assign sigma_o = sigma_q;
  assign colour_o = {colour_acc_q[2], colour_acc_q[1], colour_acc_q[0]};
endmodule

`default_nettype wire
