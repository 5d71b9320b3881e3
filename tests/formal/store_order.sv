// Store between two layers, driven as sf_core drives it (a place is taken when there is space, its steps come in order,
// a complete sample is released): no place is written that holds a sample not yet released, samples leave complete, in
// order and unchanged. The neuron and the step looked at are any.
`default_nettype none

module store_order #(
    parameter LANES = 4
) (
    input wire             clk_i,
    input wire             clear_i,
    input wire             take_i,
    input wire             we_i,
    input wire [LANES-1:0] spikes_i,
    input wire             release_i
);
  (* anyconst *) wire [3:0] steps;
  (* anyconst *) wire [1:0] lane;
  (* anyconst *) wire [2:0] step;
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire space, valid, idle;
  wire [LANES-1:0] any;
  wire [7:0] even, odd;
  wire [2*LANES-1:0] look, look_any;
  reg [2:0] step_q = 3'd0;  // to be written next
  sf_store #(
      .LANES(LANES)
  ) u_dut (
      .clk_i       (clk_i),
      .rst_ni      (rst_n_q),
      .clear_i     (clear_i),
      .steps_i     (steps),
      .take_i      (take_i),
      .space_o     (space),
      .we_i        (we_i),
      .wstep_i     (step_q),
      .wspikes_i   (spikes_i),
      .valid_o     (valid),
      .any_o       (any),
      .even_mask_i ({{LANES - 1{1'b0}}, 1'b1} << lane),
      .odd_mask_i  ({LANES{1'b0}}),
      .even_fired_o(even),
      .odd_fired_o (odd),
      .release_i   (release_i),
      .idle_o      (idle),
      .look_i      (step),
      .look_o      (look),
      .look_any_o  (look_any)
  );
  wire [1:0] peek_full_q, peek_taken_q;
  wire peek_write_q, peek_read_q;

  // The samples inside, the oldest first; what the neuron did at the step, and at any.
  reg [1:0] taken_q = 2'd0, full_q = 2'd0;
  reg [1:0] fired_q, any_q;
  reg fired_now_q, any_now_q;  // of the one that is written
  wire last = {1'b0, step_q} == steps - 4'd1;
  wire fired_now = step_q == step ? spikes_i[lane] : fired_now_q;
  wire any_now = spikes_i[lane] || (step_q != 3'd0 && any_now_q);
  wire [1:0] kept = full_q - {1'b0, release_i};
  always @(posedge clk_i) begin
    if (clear_i) {taken_q, full_q, step_q} <= 7'd0;
    else if (rst_n_q) begin
      taken_q <= taken_q + {1'b0, take_i} - {1'b0, release_i};
      full_q <= kept + {1'b0, we_i && last};
      if (we_i) step_q <= last ? 3'd0 : step_q + 3'd1;
    end
    if (we_i) {fired_now_q, any_now_q} <= {fired_now, any_now};
    if (release_i) {fired_q[0], any_q[0]} <= {fired_q[1], any_q[1]};
    if (we_i && last) begin
      fired_q[kept[0]] <= fired_now;
      any_q[kept[0]] <= any_now;
    end
  end

  wire writes_full = we_i && peek_full_q[peek_write_q];
  always @* begin
    assume (steps >= 4'd1 && steps <= 4'd8 && {1'b0, step} < steps);
    assume (!take_i || space);
    assume (!we_i || taken_q > full_q);  // spikes of a place taken, from the cycle after on
    assume (!release_i || valid);
    if (!rst_n_q) at_reset : assert ({taken_q, full_q, step_q} == 7'd0);
    else begin
      never_written_while_full : assert (!writes_full);
      places : assert (taken_q <= 2'd2 && full_q <= taken_q && {1'b0, step_q} < steps);
      space_is_space : assert (space == (taken_q != 2'd2) && idle == (taken_q == 2'd0));
      complete_only : assert (valid == (full_q != 2'd0));
      counts : assert (peek_taken_q == taken_q && {1'b0, peek_full_q[0]} + {1'b0, peek_full_q[1]} == full_q);
      in_order : assert (peek_write_q == (peek_read_q ^ full_q[0]));
      second : assert (full_q != 2'd2 || ((peek_read_q ? look[lane] : look[LANES+lane]) == fired_q[1]
                                       && (peek_read_q ? look_any[lane] : look_any[LANES+lane]) == any_q[1]));
      being_written : assert (full_q == 2'd2 || step_q == 3'd0 ||
          ((step_q <= step || (peek_write_q ? look[LANES+lane] : look[lane]) == fired_now_q)
          && (peek_write_q ? look_any[LANES+lane] : look_any[lane]) == any_now_q));
      unchanged : assert (!valid || (even[step] == fired_q[0] && any[lane] == any_q[0]));
    end
  end
endmodule

`default_nettype wire
