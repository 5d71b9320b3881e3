// Layer fed by spikes: of every sample, the sum of a step has the row of each neuron that fired at it, and the biases,
// exactly once and nothing else (counted modulo 16); a neuron's row is read once, whatever its steps; samples are loaded complete and in order,
// and none is added to that is full. Sample, step, row and part looked at are any; the row of weights is 1 there and 0 in
// all others (sf_rows below), so that its sum counts how often it was added.
`default_nettype none

module sf_rows #(
    parameter WORDS = 32,
    parameter ROWS = 192,
    parameter ROW_BITS = 8,
    parameter WORD_BITS = 5
) (
    input  wire                 clk_i,
    input  wire                 we_i,
    input  wire [ ROW_BITS-1:0] wrow_i,
    input  wire [WORD_BITS-1:0] wword_i,
    input  wire [         31:0] wdata_i,
    input  wire                 re_i,
    input  wire [ ROW_BITS-1:0] rrow_i,
    output wire [ 32*WORDS-1:0] row_o
);
  (* anyconst *) wire [ROW_BITS-1:0] watched;
  reg hit_q;
  always @(posedge clk_i) if (re_i) hit_q <= rrow_i == watched;
  assign row_o = {{32 * WORDS - 16{1'b0}}, {8 - ROW_BITS{1'b0}}, watched, 7'd0, hit_q};
endmodule

module sums_once (
    input wire       clk_i,
    input wire       clear_i,
    input wire       valid_i,
    input wire       bias_i,
    input wire [1:0] index_i,
    input wire [7:0] fired_i,
    input wire       last_i,
    input wire       load_i,
    input wire [2:0] load_step_i,
    input wire       load_part_i,
    input wire       release_i
);
  (* anyconst *) wire part;  // the layer's last
  (* anyconst *) wire [2:0] step;
  (* anyconst *) wire [3:0] watched;  // {neuron, part}; neuron 4: the biases
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire next, full, row, bias_row, busy, idle;
  wire [3:0] sums;
  wire [7:0] fired;
  wire [39:0] look;
  wire [63:0] peek_row, peek_row2_q;
  sf_sums #(
      .ROWS     (4),
      .ROW_BITS (2),
      .OUTS     (16),
      .ADDERS   (8),
      .PART_BITS(1),
      .BANKS    (2),
      .TAP      (0)
  ) u_dut (
      .*,
      .rst_ni    (rst_n_q),
      .part_i    (part),
      .we_i      (1'b0),
      .bias_we_i (1'b0),
      .wrow_i    (2'd0),
      .wword_i   (2'd0),
      .wdata_i   (32'd0),
      .next_o    (next),
      .full_o    (full),
      .sums_o    (sums),
      .row_o     (row),
      .bias_row_o(bias_row),
      .fired_o   (fired),
      .busy_o    (busy),
      .idle_o    (idle),
      .look_i    ({step[2:1], watched[0]}),
      .look_o    (look),
      .tap_rows_o()
  );
  wire peek_fresh_q, peek_part_q, peek_write_q, peek_read_q, peek_moved_q, peek_go;
  wire [1:0] peek_full_q, peek_load_q;
  wire [2:0] peek_load1_step_q, peek_load2_step_q;
  wire [7:0] peek_left_q;
  wire [15:0] peek_begun_low_q, peek_begun_high_q;

  // ---- what was handed over: the number of times that the watched row belongs into the sum, of both samples
  reg write_q = 1'b0, read_q = 1'b0;
  reg [1:0] full_q = 2'd0;
  reg [3:0] low_q, high_q;
  wire here = (bias_i ? 3'd4 : {1'b0, index_i}) == watched[3:1] && fired_i[step];
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) begin
      {write_q, read_q, full_q} <= 4'd0;
      {high_q, low_q} <= 8'd0;
    end else begin
      full_q <= full_q + {1'b0, next && last_i} - {1'b0, release_i};
      if (next && last_i) write_q <= !write_q;
      if (release_i) read_q <= !read_q;
      low_q <= release_i && !read_q ? 4'd0 : low_q + {3'd0, next && here && !write_q};
      high_q <= release_i && read_q ? 4'd0 : high_q + {3'd0, next && here && write_q};
    end
  end

  // ---- the neuron at work: it waits, what it was, whether an operation of it has been
  reg waits_q = 1'b0, worked_q = 1'b0;
  reg [11:0] waited_q;
  always @(posedge clk_i) begin
    waits_q <= rst_n_q && !clear_i && valid_i && !next;
    worked_q <= rst_n_q && !clear_i && (peek_go || worked_q) && !next;
    waited_q <= {bias_i, last_i, index_i, fired_i};
  end
  wire here_done = here && valid_i && (peek_part_q > watched[0] || (peek_part_q == watched[0] && !peek_fresh_q && !peek_left_q[step]));

  // ---- what the sums are when all that is on its way has come
  wire [19:0] bank = step[0] ? look[39:20] : look[19:0];
  wire op1 = bank[19];
  wire op2 = bank[18];
  wire begun1 = bank[17];
  wire begun2 = bank[16];
  wire [3:0] place1 = bank[15:12];
  wire [3:0] place2 = bank[11:8];
  wire hit1 = (peek_moved_q & peek_row[0]) | (~peek_moved_q & peek_row2_q[0]);
  wire [3:0] low_place = {1'b0, step[2:1], watched[0]};
  wire [3:0] high_place = {1'b1, step[2:1], watched[0]};
  wire [3:0] low2 = op2 && place2 == low_place ? (begun2 ? bank[3:0] : 4'd0) + {3'd0, peek_row2_q[0]} : bank[3:0];
  wire [3:0] low1 = op1 && place1 == low_place ? (begun1 ? low2 : 4'd0) + {3'd0, hit1} : low2;
  wire [3:0] high2 = op2 && place2 == high_place ? (begun2 ? bank[7:4] : 4'd0) + {3'd0, peek_row2_q[0]} : bank[7:4];
  wire [3:0] high1 = op1 && place1 == high_place ? (begun1 ? high2 : 4'd0) + {3'd0, hit1} : high2;
  wire [3:0] low = peek_begun_low_q[{watched[0], step}] ? low1 : 4'd0;
  wire [3:0] high = peek_begun_high_q[{watched[0], step}] ? high1 : 4'd0;

  // ---- what was asked for: three cycles later, and until the next load's comes
  reg [1:0] load_q = 2'd0, wanted_q = 2'd0, slot_q;
  reg known_q = 1'b0;
  reg [3:0] wanted1_q, wanted2_q, wanted3_q;
  reg row_q = 1'b0, bias_row_q = 1'b0;
  reg [7:0] fired_q;
  always @(posedge clk_i) begin
    load_q <= rst_n_q && !clear_i ? {load_q[0], load_i} : 2'd0;
    wanted_q <= {wanted_q[0], load_i && load_step_i == step && load_part_i == watched[0]};
    slot_q <= {slot_q[0], read_q};
    wanted1_q <= read_q ? high_q : low_q;
    wanted2_q <= wanted1_q;
    if (load_q[1]) {known_q, wanted3_q} <= {wanted_q[1], wanted2_q};
    if (!rst_n_q || clear_i) known_q <= 1'b0;
    row_q <= rst_n_q && !clear_i && peek_go && !worked_q && !bias_i && fired_i != 8'd0;
    bias_row_q <= rst_n_q && !clear_i && peek_go && !worked_q && bias_i;
    fired_q <= fired_i;
  end

  always @* begin
    assume (peek_row[11:8] == watched);  // sf_rows above
    assume (watched < 4'd10 && watched[0] <= part && load_part_i <= part);
    assume (!valid_i || !bias_i || fired_i != 8'd0);  // sf_spikes: the biases count at every step
    assume (!load_i || full);        // sf_core
    assume (!release_i || load_i);   // with the last load
    assume (!waits_q || (valid_i && {bias_i, last_i, index_i, fired_i} == waited_q));  // sf_spikes
    if (!rst_n_q) at_reset : assert ({write_q, read_q, full_q, waits_q, worked_q, load_q, known_q, row_q, bias_row_q} == 11'd0);
    else begin
      counts : assert ({1'b0, peek_full_q[0]} + {1'b0, peek_full_q[1]} == full_q && full == (full_q != 2'd0) && full_q != 2'd3);
      in_order : assert (peek_write_q == write_q && peek_read_q == read_q && write_q == (read_q ^ full_q[0]));
      the_oldest : assert (peek_full_q[read_q] == full);
      none_added_while_full : assert (!peek_go || !peek_full_q[write_q]);
      one_at_a_time : assert (!peek_go || (valid_i && !load_i));
      parts : assert (peek_part_q <= part);
      at_work : assert (worked_q == (!peek_fresh_q || peek_part_q) && (!worked_q || (waits_q && !peek_full_q[write_q])));
      steps_left : assert (peek_fresh_q || (peek_left_q != 8'd0 && (peek_left_q & ~waited_q[7:0]) == 8'd0));
      row_at_hand : assert (peek_fresh_q
                    || hit1 == ({waited_q[11] ? 3'd4 : {1'b0, waited_q[9:8]}, peek_part_q} == watched));
      exactly_once : assert (low == low_q + {3'd0, here_done && !write_q} && high == high_q + {3'd0, here_done && write_q});
      loads : assert (peek_load_q == load_q && (!load_q[0] || !op1) && (!load_q[1] || !op2));
      load_begun : assert (!load_q[0] || !wanted_q[0] || (peek_load1_step_q == step && place1 == {slot_q[0], low_place[2:0]}
                   && wanted1_q == (!begun1 ? 4'd0 : slot_q[0] ? high2 : low2)));
      load_read : assert (!load_q[1] || !wanted_q[1] || (peek_load2_step_q == step && place2 == {slot_q[1], low_place[2:0]}
                  && wanted2_q == (!begun2 ? 4'd0 : slot_q[1] ? bank[7:4] : bank[3:0])));
      loaded : assert (!known_q || sums == wanted3_q);
      row_read_once : assert (row == row_q && bias_row == bias_row_q && (!row || fired == fired_q));
      idle_is_idle : assert (!idle || (full_q == 2'd0 && !worked_q && !row && !bias_row && !busy));
    end
  end
endmodule

`default_nettype wire
