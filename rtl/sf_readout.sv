// Output layers: currents of D2 and C3 through the tables into the integrators, one value per cycle. A sample's density
// waits in a queue for its colours. In radix mode the currents are summed up before the tables, a step weighing twice the next;
// the tables are read at the last step alone. Mirror: src/fx/net.c (density_step, colour_step)
`default_nettype none

module sf_readout (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        decodes_i,        // no densities: 0 is their result
    // currents of a sample, a step per cycle: promised by begin, complete with last
    output wire        density_ready_o,
    input  wire        density_begin_i,
    input  wire        density_valid_i,
    input  wire [ 2:0] density_step_i,
    input  wire        density_last_i,
    input  wire [15:0] density_i,
    output wire        colour_ready_o,
    input  wire        colour_begin_i,
    input  wire        colour_valid_i,
    input  wire [ 2:0] colour_step_i,
    input  wire        colour_last_i,
    input  wire [47:0] colour_i,
    output wire        idle_o,
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
    output wire        special_o,      // whose table was read
    output wire        valid_o,        // result of the sample
    input  wire        ready_i,
    output wire [27:0] sigma_o,
    output wire [59:0] colour_o
);
  localparam QUEUE = 8;    // densities whose colours are still in the engine
  localparam STAGES = 16;  // a current, 5 of sf_scale, 6 of the tables, 4 of sf_integrate
  localparam [2:0] STEP = 3'd4;  // a step's accumulators are written five cycles after they were read: slots 0 to 4

  reg [15:0] density_q[0:7];
  reg [15:0] current_q[0:31];  // {step, colour}
  reg density_full_q, colour_full_q;    // complete
  reg density_taken_q, colour_taken_q;  // promised or complete
  reg run_q, colour_q;
  reg [2:0] step_q, slot_q;
  wire [2:0] last_out = colour_q ? 3'd2 : 3'd0;
  wire issue = run_q && slot_q <= last_out;
  wire last_step = {1'b0, step_q} == steps_i - 4'd1;
  wire last = slot_q == last_out && last_step;

  // What goes along with a current.
  reg [STAGES-1:0] valid_q, is_colour_q, last_q;
  reg [2:0] stage_step_q[0:STAGES-1];
  reg [1:0] stage_out_q[0:STAGES-1];
  localparam READ = STAGES - 5;   // reads its accumulator
  localparam WRITE = STAGES - 1;  // writes it
  reg busy_q;  // colours are at work or wait to be taken: they use the accumulators
  reg done_q;  // colours are complete
  reg [27:0] sigma_q;
  reg [19:0] colour_acc_q[0:2];
  reg [27:0] queue_q[0:QUEUE-1];
  reg [3:0] queue_room_q;   // places that are not promised
  reg [3:0] queue_count_q;
  reg [2:0] queue_write_q, queue_read_q;

  wire free = !run_q || last;
  wire start_colour = free && colour_full_q && !busy_q;
  wire start_density = free && !start_colour && density_full_q && !(run_q && !colour_q);
  wire out = valid_o && ready_i;
  wire pop = out && !decodes_i;
  wire radix = mode_i == sf_op_pkg::RADIX;
  wire writes = valid_q[WRITE] && (!radix || {1'b0, stage_step_q[WRITE]} == steps_i - 4'd1);
  wire push = writes && last_q[WRITE] && !is_colour_q[WRITE];

  // The weighted sum of an output comes back five cycles later.
  reg signed [23:0] current0_q;
  reg signed [23:0] weighed_q[0:2];
  wire signed [15:0] here = colour_q ? current_q[{step_q, slot_q[1:0]}] : density_q[step_q];
  wire signed [23:0] so_far = !radix || step_q == 3'd0 ? 24'sd0 : weighed_q[slot_q[1:0]];
  wire signed [23:0] weighed = (so_far <<< 1) + 24'(here);
  wire [17:0] argument;
  wire [27:0] e;
  wire [15:0] s;
  wire [27:0] acc;
  sf_scale u_scale (
      .clk_i          (clk_i),
      .current_i      (current0_q),
      .colour_i       (is_colour_q[0]),
      .exp_mul_i      (exp_mul_i),
      .exp_shift_i    (exp_shift_i),
      .exp_bias_i     (exp_bias_i),
      .sigmoid_mul_i  (sigmoid_mul_i),
      .sigmoid_shift_i(sigmoid_shift_i),
      .sigmoid_bias_i (sigmoid_bias_i),
      .y_o            (argument)
  );
  sf_exp2 u_exp2 (
      .clk_i(clk_i),
      .y_i  (argument),
      .e_o  (e)
  );
  sf_sigmoid u_sigmoid (
      .clk_i(clk_i),
      .x_i  (argument[15:0]),
      .s_o  (s)
  );
  sf_integrate u_integrate (
      .clk_i      (clk_i),
      .acc_i      (is_colour_q[READ] ? {8'd0, colour_acc_q[stage_out_q[READ]]} : sigma_q),
      .in_i       (is_colour_q[READ] ? {12'd0, s} : e),
      .first_i    (stage_step_q[READ] == 3'd0),
      .mode_i     (mode_i),
      .colour_i   (is_colour_q[READ]),
      .k_density_i(k_density_i),
      .k_colour_i (k_colour_i),
      .acc_o      (acc)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {density_taken_q, colour_taken_q, density_full_q, colour_full_q, run_q, busy_q, done_q} <= 7'd0;
      valid_q <= {STAGES{1'b0}};
      {queue_room_q, queue_count_q, queue_write_q, queue_read_q} <= {4'(QUEUE), 10'd0};
    end else if (clear_i) begin
      {density_taken_q, colour_taken_q, density_full_q, colour_full_q, run_q, busy_q, done_q} <= 7'd0;
      valid_q <= {STAGES{1'b0}};
      {queue_room_q, queue_count_q, queue_write_q, queue_read_q} <= {4'(QUEUE), 10'd0};
    end else begin
      if (density_begin_i) density_taken_q <= 1'b1;
      else if (run_q && last && !colour_q) density_taken_q <= 1'b0;
      if (colour_begin_i) colour_taken_q <= 1'b1;
      else if (run_q && last && colour_q) colour_taken_q <= 1'b0;
      if (density_valid_i && density_last_i) density_full_q <= 1'b1;
      else if (run_q && last && !colour_q) density_full_q <= 1'b0;
      if (colour_valid_i && colour_last_i) colour_full_q <= 1'b1;
      else if (run_q && last && colour_q) colour_full_q <= 1'b0;
      run_q <= start_colour || start_density || (run_q && !last);
      valid_q <= {valid_q[STAGES-2:0], issue};
      busy_q <= start_colour || (busy_q && !out);
      if (writes && last_q[WRITE] && is_colour_q[WRITE]) done_q <= 1'b1;
      else if (out) done_q <= 1'b0;
      queue_room_q <= queue_room_q + {3'd0, pop} - {3'd0, density_begin_i};
      queue_count_q <= queue_count_q + {3'd0, push} - {3'd0, pop};
      if (push) queue_write_q <= queue_write_q + 3'd1;
      if (pop) queue_read_q <= queue_read_q + 3'd1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (density_valid_i) density_q[density_step_i] <= density_i;
    if (colour_valid_i) begin
      for (int o = 0; o < 3; o++) current_q[{colour_step_i, o[1:0]}] <= colour_i[16*o+:16];
    end
    if (start_colour || start_density) begin
      colour_q <= start_colour;
      {step_q, slot_q} <= 6'd0;
    end else if (run_q) begin
      slot_q <= slot_q == STEP ? 3'd0 : slot_q + 3'd1;
      if (slot_q == STEP) step_q <= step_q + 3'd1;
    end
    if (!radix || last_step) current0_q <= weighed;
    if (issue && radix) weighed_q[slot_q[1:0]] <= weighed;
    is_colour_q <= {is_colour_q[STAGES-2:0], colour_q};
    last_q <= {last_q[STAGES-2:0], last};
    stage_step_q[0] <= step_q;
    stage_out_q[0] <= slot_q[1:0];
    for (int i = 1; i < STAGES; i++) begin
      stage_step_q[i] <= stage_step_q[i-1];
      stage_out_q[i] <= stage_out_q[i-1];
    end
    if (writes && is_colour_q[WRITE]) colour_acc_q[stage_out_q[WRITE]] <= acc[19:0];
    if (writes && !is_colour_q[WRITE]) sigma_q <= acc;
    if (push) queue_q[queue_write_q] <= acc;
  end

  assign density_ready_o = !density_taken_q && queue_room_q != 4'd0;
  assign colour_ready_o = !colour_taken_q;
  assign idle_o = !density_taken_q && !colour_taken_q && !run_q && valid_q == {STAGES{1'b0}} && !done_q
      && queue_count_q == 4'd0;
  assign update_o = valid_q[WRITE];
  assign special_o = writes;
  assign update_colour_o = is_colour_q[WRITE];
  assign update_step_o = stage_step_q[WRITE];
  assign valid_o = done_q && (decodes_i || queue_count_q != 4'd0);
  assign sigma_o = decodes_i ? 28'd0 : queue_q[queue_read_q];
  assign colour_o = {colour_acc_q[2], colour_acc_q[1], colour_acc_q[0]};
endmodule

`default_nettype wire
