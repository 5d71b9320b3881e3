// D2 or C3: a layer of at most 16 neurons, fed by spikes (sf_fed). Its sums of a sample leave, a step per cycle, when
// the readout is ready and there is room for what else they go to. Its time: src/cycles/engine.c
`default_nettype none

module sf_narrow #(
    parameter LANES = 128,      // these as sf_fed's
    parameter NEURONS = 16,
    parameter GROUP_BITS = 3,
    parameter TAP = 1
) (
    input  wire                  clk_i,
    input  wire                  rst_ni,
    input  wire                  clear_i,
    input  wire                  has_bias_i,
    input  wire [           3:0] steps_i,
    input  wire [GROUP_BITS-1:0] last_group_i,    // of the layer before
    // weights
    input  wire                  we_i,
    input  wire [           8:0] wrow_i,
    input  wire [           1:0] wword_i,
    input  wire [          31:0] wdata_i,
    // spikes of the layer before; a place is taken before they come
    input  wire                  take_i,
    output wire                  space_o,
    input  wire                  spikes_valid_i,
    input  wire [           2:0] spikes_step_i,
    input  wire [GROUP_BITS-1:0] spikes_group_i,
    input  wire [   NEURONS-1:0] spikes_i,
    // sums of a sample: once begun, all steps come
    input  wire                  ready_i,         // the readout
    input  wire                  room_i,
    output wire                  begin_o,
    output wire                  valid_o,
    output wire [           2:0] step_o,
    output wire                  last_o,
    output wire [         255:0] sums_o,
    output wire                  stall_o,         // they wait for the readout
    // events, in the cycle in which they happen
    output wire                  row_o,           // a row is read,
    output wire [           7:0] fired_o,         // and the steps at which its neuron fired
    output wire                  bias_row_o,
    output wire                  busy_o,
    output wire                  idle_o,
    // rows that a sample added up
    output wire                  tap_valid_o,
    output wire [     LANES-1:0] tap_rows_o
);
  wire full, fed_idle;
  wire [LANES-1:0] rows;
  reg reading_q;
  reg [2:0] next_q;
  wire begins = !reading_q && full && ready_i && room_i;
  wire load = begins || reading_q;
  wire last = load && {1'b0, next_q} == steps_i - 4'd1;
  sf_fed #(
      .LANES     (LANES),
      .NEURONS   (NEURONS),
      .GROUP_BITS(GROUP_BITS),
      .OUTS      (16),
      .ADDERS    (16),
      .PART_BITS (1),
      .BANKS     (4),
      .TAP       (TAP)
  ) u_fed (
      .clk_i         (clk_i),
      .rst_ni        (rst_ni),
      .clear_i       (clear_i),
      .has_bias_i    (has_bias_i),
      .steps_i       (steps_i),
      .last_group_i  (last_group_i),
      .last_part_i   (1'b0),
      .we_i          (we_i),
      .wrow_i        (wrow_i),
      .wword_i       (wword_i),
      .wdata_i       (wdata_i),
      .take_i        (take_i),
      .space_o       (space_o),
      .spikes_valid_i(spikes_valid_i),
      .spikes_step_i (spikes_step_i),
      .spikes_group_i(spikes_group_i),
      .spikes_i      (spikes_i),
      .full_o        (full),
      .load_i        (load),
      .load_step_i   (next_q),
      .load_part_i   (1'b0),
      .release_i     (last),
      .sums_o        (sums_o),
      .row_o         (row_o),
      .fired_o       (fired_o),
      .bias_row_o    (bias_row_o),
      .busy_o        (busy_o),
      .idle_o        (fed_idle),
      .tap_rows_o    (rows)
  );

  reg [2:0] way_q;  // a step's sums are there in three cycles, in two, in one
  reg [8:0] way_step_q;
  reg [2:0] way_last_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {reading_q, next_q, way_q} <= 7'd0;
    else if (clear_i) {reading_q, next_q, way_q} <= 7'd0;
    else begin
      reading_q <= load && !last;
      if (load) next_q <= last ? 3'd0 : next_q + 3'd1;
      way_q <= {way_q[1:0], load};
    end
  end
  always_ff @(posedge clk_i) begin
    way_step_q <= {way_step_q[5:0], next_q};
    way_last_q <= {way_last_q[1:0], last};
  end
  assign begin_o = begins;
  assign valid_o = way_q[2];
  assign step_o = way_step_q[8:6];
  assign last_o = way_last_q[2];
  assign stall_o = full && !reading_q && !ready_i;
  assign idle_o = fed_idle && way_q == 3'd0;

  generate
    if (TAP != 0) begin : g_tap
      reg [LANES-1:0] rows_q;
      always_ff @(posedge clk_i) if (way_q[0]) rows_q <= way_step_q[2:0] == 3'd0 ? rows : rows_q | rows;
      assign tap_valid_o = way_q[1] && way_last_q[1];
      assign tap_rows_o = rows_q;
    end else begin : g_no_tap
      assign tap_valid_o = 1'b0;
      assign tap_rows_o = {LANES{1'b0}};
      wire unused_ok = &{1'b0, rows};
    end
  endgenerate
endmodule

`default_nettype wire
