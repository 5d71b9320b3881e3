// Queue between C1 and C2, its text out of sf_core (queue_order.sed): C1 fires only when a place is promised to the step,
// whenever the neurons deliver it; no place is written that C2 has not yet worked off; steps leave in order, unchanged.
`default_nettype none

module queue_order #(
    parameter LANES = 4
) (
    input wire             clk_i,
    input wire             clear_i,
    input wire             pending_i,
    input wire             goes_i,
    input wire             valid_i,
    input wire [LANES-1:0] spikes_i,
    input wire [      2:0] step_i,
    input wire             done_i
);
  (* anyconst *) wire [5:0] watched;  // the number, modulo 64, of the step that is watched
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  reg [5:0] fired_q = 6'd0, written_q = 6'd0, done_q = 6'd0;  // steps so far
  wire fire, valid;
  wire [LANES-1:0] spikes, look;
  wire [2:0] step, look_step;
  sf_core_queue #(
      .LANES(LANES)
  ) u_dut (
      .clk_i        (clk_i),
      .rst_ni       (rst_n_q),
      .clear_i      (clear_i),
      .pending_i    (pending_i),
      .goes_i       (goes_i),
      .fire_o       (fire),
      .valid_i      (valid_i),
      .spikes       (spikes_i),
      .spikes_step  (step_i),
      .c2_done      (done_i),
      .queue_valid_o(valid),
      .spikes_o     (spikes),
      .step_o       (step),
      .look_i       (watched[1:0]),
      .look_o       (look),
      .look_step_o  (look_step)
  );
  wire [2:0] peek_queue_count_q, peek_queue_room_q;
  wire [1:0] peek_queue_write_q, peek_queue_read_q;

  reg [LANES-1:0] spikes_q;
  reg [2:0] step_q;
  always @(posedge clk_i) begin
    if (clear_i) {fired_q, written_q, done_q} <= 18'd0;
    else if (rst_n_q) begin
      fired_q <= fired_q + {5'd0, fire};
      written_q <= written_q + {5'd0, valid_i};
      done_q <= done_q + {5'd0, done_i};
    end
    if (valid_i && written_q == watched) {spikes_q, step_q} <= {spikes_i, step_i};
  end

  wire [5:0] age = watched - done_q;
  wire [5:0] inside = written_q - done_q;
  wire [5:0] promised = fired_q - done_q;
  always @* begin
    assume (!valid_i || fired_q != written_q);  // sf_neurons: spikes of a step fired
    assume (!done_i || valid);                  // sf_c2 works off what is there
    if (!rst_n_q) at_reset : assert ({fired_q, written_q, done_q} == 18'd0);
    else begin
      never_written_while_full : assert (!valid_i || inside < 6'd4);
      places : assert (inside <= promised && promised <= 6'd4);
      counts : assert (peek_queue_count_q == inside[2:0] && peek_queue_room_q == 3'd4 - promised[2:0]);
      pointers : assert (peek_queue_write_q == written_q[1:0] && peek_queue_read_q == done_q[1:0]);
      waits : assert (valid == (inside != 6'd0));
      unchanged : assert (age >= inside || (look == spikes_q && look_step == step_q));
      in_order : assert (!valid || done_q != watched || (spikes == spikes_q && step == step_q));
      no_waste : assert (fire == (pending_i && goes_i && !clear_i && promised != 6'd4));
    end
  end
endmodule

`default_nettype wire
