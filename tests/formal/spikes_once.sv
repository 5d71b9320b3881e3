// Spikes between two layers, driven as sf_core drives them (a place is taken when there is space, then its steps come, group
// by group): no place is written that holds a sample not yet handed on; of every sample each neuron that fired is handed on
// exactly once, in rising order, with the steps at which it fired; biases exactly once and first; last exactly once, at the
// end. Sample and neuron looked at are any; whoever takes them waits as long as it likes.
`default_nettype none

module spikes_once (
    input wire       clk_i,
    input wire       clear_i,
    input wire       take_i,
    input wire       we_i,
    input wire [3:0] spikes_i,
    input wire       next_i
);
  (* anyconst *) wire [3:0] steps;
  (* anyconst *) wire group;         // the layer's last
  (* anyconst *) wire bias;
  (* anyconst *) wire [2:0] watched; // {group, unit}
  (* anyconst *) wire [2:0] number;  // of the sample watched, modulo 8
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire space, valid, item_bias, last, idle;
  wire [2:0] index;
  wire [7:0] fired;
  wire [15:0] look;
  reg [2:0] step_q = 3'd0;  // to be written next
  reg group_q = 1'b0;
  sf_spikes #(
      .NEURONS   (4),
      .INDEX_BITS(3),
      .GROUP_BITS(1)
  ) u_dut (
      .*,
      .rst_ni   (rst_n_q),
      .bias_i   (bias),
      .steps_i  (steps),
      .group_i  (group),
      .space_o  (space),
      .wstep_i  (step_q),
      .wgroup_i (group_q),
      .wspikes_i(spikes_i),
      .valid_o  (valid),
      .bias_o   (item_bias),
      .index_o  (index),
      .fired_o  (fired),
      .last_o   (last),
      .idle_o   (idle),
      .look_i   (watched),
      .look_o   (look)
  );
  wire [1:0] peek_full_q, peek_taken_q;
  wire peek_write_q, peek_read_q, peek_group_q, peek_have_q, peek_last_group_q, peek_bias_q, peek_at_q;
  wire [3:0] peek_left_q;
  wire [31:0] peek_steps_q;

  // Samples are numbered: the one being written, the one at the output. What the watched neuron did in the watched one.
  reg [1:0] promised_q = 2'd0;  // places taken and not yet written to the end
  reg [2:0] write_q = 3'd0, out_q = 3'd0;
  reg [7:0] mask_q;
  reg [1:0] seen_q = 2'd0;  // times handed on, 3: three or more
  // Of the sample at the output: a neuron was handed on, which was the last one; the biases were.
  reg any_q = 1'b0, bias_q = 1'b0;
  reg [2:0] newest_q;
  wire [7:0] exists = ~(8'hff << steps);
  wire [7:0] mask = mask_q & exists;
  wire last_write = we_i && {1'b0, step_q} == steps - 4'd1 && group_q == group;
  wire taken = valid && next_i;
  wire neuron = valid && !item_bias && fired != 8'd0;
  wire here = neuron && out_q == number && index == watched;
  always @(posedge clk_i) begin
    if (clear_i) {promised_q, write_q, out_q, step_q, group_q, seen_q, any_q, bias_q} <= 16'd0;
    else if (rst_n_q) begin
      promised_q <= promised_q + {1'b0, take_i} - {1'b0, last_write};
      if (we_i) begin
        group_q <= group_q == group ? 1'b0 : 1'b1;
        if (group_q == group) step_q <= last_write ? 3'd0 : step_q + 3'd1;
      end
      write_q <= write_q + {2'd0, last_write};
      out_q <= out_q + {2'd0, taken && last};
      if (!live) seen_q <= 2'd0;
      else if (here && taken && seen_q != 2'd3) seen_q <= seen_q + 2'd1;
      if (taken) {any_q, bias_q} <= last ? 2'd0 : {any_q || neuron, bias_q || item_bias};
    end
    if (taken && neuron) newest_q <= index;
    if (we_i && write_q == number && group_q == watched[2]) mask_q[step_q] <= spikes_i[watched[1:0]];
  end

  // Where samples and the watched neuron are: in the memory, in the group at hand, offered, handed on.
  wire [1:0] full = {1'b0, peek_full_q[0]} + {1'b0, peek_full_q[1]};
  wire [2:0] read = write_q - {1'b0, full};
  wire [2:0] at_hand = read - {2'd0, peek_have_q && peek_last_group_q};
  wire ends = valid && last;
  wire [2:0] age = write_q - number;
  wire stored = age != 3'd0 && age <= {1'b0, full};
  wire [7:0] look_at = peek_write_q ^ age[0] ? look[15:8] : look[7:0];
  wire group_here = peek_have_q && at_hand == number && peek_at_q == watched[2];
  wire [7:0] steps_here = {peek_steps_q[28+watched[1:0]], peek_steps_q[24+watched[1:0]], peek_steps_q[20+watched[1:0]],
                           peek_steps_q[16+watched[1:0]], peek_steps_q[12+watched[1:0]], peek_steps_q[8+watched[1:0]],
                           peek_steps_q[4+watched[1:0]], peek_steps_q[watched[1:0]]};
  wire in_memory = stored && !(read == number && peek_group_q && !watched[2]);
  wire in_group = group_here && peek_left_q[watched[1:0]];
  wire [2:0] places = {2'd0, in_memory} + {2'd0, in_group} + {2'd0, here} + {1'b0, seen_q};
  wire [2:0] since = write_q - out_q;
  wire [2:0] ahead = number - out_q;
  wire live = ahead < since;  // complete, and not yet handed on to its end
  wire shown = neuron || any_q;
  wire [2:0] newest = neuron ? index : newest_q;
  wire [7:0] written = ~(8'hff << step_q);  // steps of the watched neuron in the sample being written
  wire [7:0] begun = written | (group_q && !watched[2] ? 8'd1 << step_q : 8'd0);

  reg waits_q = 1'b0;
  reg [12:0] waited_q;
  always @(posedge clk_i) begin
    waits_q <= rst_n_q && !clear_i && valid && !next_i;
    waited_q <= {item_bias, last, index, fired};
  end

  integer u;
  always @* begin
    assume (steps >= 4'd1 && steps <= 4'd8 && watched[2] <= group);
    assume (!take_i || space);
    assume (!we_i || promised_q != 2'd0);  // spikes of a place taken, from the cycle after on
    assume (!next_i || valid);
    if (!rst_n_q) at_reset : assert ({promised_q, write_q, out_q, step_q, group_q, seen_q, any_q, bias_q, waits_q} == 17'd0);
    else begin
      never_written_while_full : assert (!we_i || !peek_full_q[peek_write_q]);
      counts : assert (peek_taken_q == promised_q + full && {1'b0, promised_q} + {1'b0, full} <= 3'd2);
      space_is_space : assert (space == (promised_q + full != 2'd2));
      idle_is_idle : assert (idle == (promised_q == 2'd0 && since == 3'd0 && !peek_have_q && !valid));
      being_written : assert ({1'b0, step_q} < steps && group_q <= group && (promised_q != 2'd0 || (step_q == 3'd0 && !group_q)));
      in_order : assert (peek_write_q == (peek_read_q ^ full[0]) && peek_full_q[peek_read_q] == (full != 2'd0));
      at_hand_or_not : assert (peek_have_q || (!peek_group_q && !peek_bias_q));
      first_group : assert (!peek_have_q || peek_last_group_q || (full != 2'd0 && peek_group_q && !peek_at_q && group));
      last_group : assert (!peek_have_q || !peek_last_group_q || (!peek_group_q && peek_at_q == group));
      one_after_another : assert (out_q + {2'd0, ends} == at_hand && since <= 3'd4);
      goes_on : assert (!valid || last || peek_have_q);
      kept : assert (!stored || (look_at & exists) == mask);
      kept_so_far : assert (write_q != number || ((look_at ^ mask_q) & begun & exists) == 8'd0);
      not_yet : assert (seen_q == 2'd0 || live || out_q == number + 3'd1);
      steps_at_hand : assert (!group_here || steps_here == mask);
      unchanged : assert (!here || fired == mask);
      none_that_is_silent : assert (!live || mask != 8'd0 || (!in_group && !here && seen_q == 2'd0));
      exactly_once : assert (!live || mask == 8'd0 || places == 3'd1);
      every_one_by_the_end : assert (!(ends && out_q == number) || mask == 8'd0 || here || seen_q == 2'd1);
      rising : assert (!neuron || !any_q || index > newest_q);
      empty_at_the_end : assert (!valid || fired != 8'd0 || (last && !item_bias));
      biases_are_no_neuron : assert (!valid || !item_bias || (bias && fired == exists && !last && !any_q && !bias_q));
      biases_first : assert (!(neuron || any_q || ends) || bias_q == bias);
      biases_once : assert (ends || !peek_have_q || {1'b0, peek_bias_q} + {1'b0, valid && item_bias} + {1'b0, bias_q} == {1'b0, bias});
      biases_of_the_next : assert (!peek_have_q || !ends || (peek_bias_q == bias && !(bias && peek_at_q)));
      biases_of_the_first_group : assert (!peek_bias_q || (!peek_at_q && (ends || (!valid && !any_q))));
      none_begun : assert (peek_have_q || valid || (!any_q && !bias_q));
      group_order : assert (!peek_have_q || ends || !shown || newest[2] <= peek_at_q);
      // what is left fired at a step, and comes after what was handed on
      for (u = 0; u < 4; u = u + 1) begin
        assert (!peek_have_q || !peek_left_q[u] || peek_steps_q[u] || peek_steps_q[4+u] || peek_steps_q[8+u]
            || peek_steps_q[12+u] || peek_steps_q[16+u] || peek_steps_q[20+u] || peek_steps_q[24+u] || peek_steps_q[28+u]);
        assert (!peek_have_q || ends || !shown || !peek_left_q[u] || {peek_at_q, 2'(u)} > newest);
      end
      waits : assert (!waits_q || (valid && {item_bias, last, index, fired} == waited_q));
    end
  end
endmodule

`default_nettype wire
