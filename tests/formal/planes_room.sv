// Appearances on their way from positions to sums, whatever light, lines and the decoder do: they are counted, and are five at
// most, so that their blocks, twelve at most for each, fit into the queue of sf_basis. One begins where light and lines both
// take it, and not without room. Each has one direction in its queue, which is taken with its sums. Densities do not wait for
// room. The queue is that of fifo_once; here it counts.
`default_nettype none

`include "tests/formal/counting_fifo.svh"

module planes_room (
    input wire clk_i,
    input wire clear_i,
    input wire read_valid,
    input wire read_appearance,
    input wire reads_ready,
    input wire sums_valid,
    input wire sums_ready
);
  localparam [6:0] BLOCKS = 7'd12, ROOM = 7'd1 << 6;  // of an appearance; of sf_basis
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire read_ready, dir_valid, begins, start;
  wire [6:0] dirs;
  sf_planes u_dut (
      .clk_i          (clk_i),
      .rst_ni         (rst_n_q),
      .clear_i        (clear_i),
      .read_valid     (read_valid),
      .read_appearance(read_appearance),
      .reads_ready    (reads_ready),
      .sums_valid     (sums_valid),
      .sums_ready     (sums_ready),
      .read_dir       (48'd0),
      .turn_q         (48'd0),
      .read_ready     (read_ready),
      .dir_valid      (dir_valid),
      .dir            (),
      .turn           (),
      .look_begins_o  (begins),
      .look_start_o   (start),
      .look_dirs_o    (dirs)
  );
  wire [2:0] peek_appearances_q;

  reg [6:0] inside_q = 7'd0;
  wire taken = read_valid && read_ready;  // by light's side
  always @(posedge clk_i) begin
    if (!rst_n_q || clear_i) inside_q <= 7'd0;
    else inside_q <= inside_q + {6'd0, taken && read_appearance} - {6'd0, sums_valid && sums_ready};
  end

  always @* begin
    assume (!sums_valid || inside_q != 7'd0);  // basis_once, planes_reads_once
    if (!rst_n_q) at_reset : assert (inside_q == 7'd0);
    else begin
      counted : assert ({4'd0, peek_appearances_q} == inside_q);
      blocks_fit : assert (inside_q * BLOCKS <= ROOM);
      five_at_most : assert (inside_q <= 7'd5);
      both_or_none : assert (taken == (start && reads_ready) && begins == (taken && read_appearance));
      a_direction_for_each : assert (dirs == inside_q && (!sums_valid || dir_valid));
      densities_do_not_wait : assert (read_appearance || read_ready == reads_ready);
      five_fit : assert (!read_appearance || inside_q == 7'd5 || read_ready == reads_ready);
    end
  end
endmodule

`default_nettype wire
