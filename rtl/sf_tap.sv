// The tap, for verification: one beat per spiking layer and step, one per sample of D2 and C3, which wait for a cycle without
// another. sf_top says what a beat shows.
`default_nettype none

module sf_tap #(
    parameter LANES = 128,
    parameter NEURONS = 16,
    parameter GROUP_BITS = 3
) (
    input  wire                  clk_i,
    input  wire                  rst_ni,
    input  wire                  clear_i,
    // spikes and membranes of a group
    input  wire                  spikes_valid_i,
    input  wire [           1:0] spikes_layer_i,
    input  wire [           2:0] spikes_step_i,
    input  wire [GROUP_BITS-1:0] spikes_group_i,
    input  wire                  spikes_last_i,    // the layer's last group
    input  wire [   NEURONS-1:0] spikes_i,
    input  wire [24*NEURONS-1:0] membrane_i,
    // rows that were added up: of C2 a cycle after a step's first load, of D2 and C3 per sample
    input  wire                  c2_load_i,
    input  wire [     LANES-1:0] c2_rows_i,
    input  wire                  d2_valid_i,
    input  wire [     LANES-1:0] d2_rows_i,
    input  wire                  c3_valid_i,
    input  wire [     LANES-1:0] c3_rows_i,
    output wire                  valid_o,
    output wire [           2:0] layer_o,
    output wire [           2:0] step_o,
    output wire [     LANES-1:0] spikes_o,
    output wire [     LANES-1:0] rows_o,
    output wire [  24*LANES-1:0] membrane_o
);
  reg [LANES-1:0] spikes_all_q;
  reg [24*LANES-1:0] membrane_all_q;
  reg valid_q, beat_q;
  reg [2:0] layer_q, beat_layer_q;
  reg [2:0] step_q, beat_step_q;
  reg [LANES-1:0] spikes_q, rows_q;
  reg [24*LANES-1:0] membrane_q;
  // rows behind the steps of C2 on their way through the neurons; behind the samples of D2 and C3
  reg [LANES-1:0] c2_rows_q[0:15], d2_rows_q[0:15], c3_rows_q[0:15];
  reg [3:0] c2_write_q, c2_read_q, d2_write_q, d2_read_q, c3_write_q, c3_read_q;
  reg c2_loaded_q;
  wire send_d2 = !beat_q && d2_read_q != d2_write_q;
  wire send_c3 = !beat_q && !send_d2 && c3_read_q != c3_write_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {valid_q, beat_q, c2_loaded_q} <= 3'd0;
      {c2_write_q, c2_read_q, d2_write_q, d2_read_q, c3_write_q, c3_read_q} <= 24'd0;
    end else if (clear_i) begin
      {valid_q, beat_q, c2_loaded_q} <= 3'd0;
      {c2_write_q, c2_read_q, d2_write_q, d2_read_q, c3_write_q, c3_read_q} <= 24'd0;
    end else begin
      c2_loaded_q <= c2_load_i;
      if (c2_loaded_q) c2_write_q <= c2_write_q + 4'd1;
      beat_q <= spikes_valid_i && spikes_last_i;
      if (beat_q && beat_layer_q == sf_op_pkg::C2) c2_read_q <= c2_read_q + 4'd1;
      if (d2_valid_i) d2_write_q <= d2_write_q + 4'd1;
      if (c3_valid_i) c3_write_q <= c3_write_q + 4'd1;
      if (send_d2) d2_read_q <= d2_read_q + 4'd1;
      if (send_c3) c3_read_q <= c3_read_q + 4'd1;
      valid_q <= beat_q || send_d2 || send_c3;
    end
  end
  always_ff @(posedge clk_i) begin
    if (c2_loaded_q) c2_rows_q[c2_write_q] <= c2_rows_i;
    if (d2_valid_i) d2_rows_q[d2_write_q] <= d2_rows_i;
    if (c3_valid_i) c3_rows_q[c3_write_q] <= c3_rows_i;
    if (spikes_valid_i) begin
      if (spikes_group_i == {GROUP_BITS{1'b0}}) begin
        spikes_all_q <= LANES'(spikes_i);
      end else spikes_all_q[NEURONS*spikes_group_i+:NEURONS] <= spikes_i;
      membrane_all_q[24*NEURONS*spikes_group_i+:24*NEURONS] <= membrane_i;
    end
    beat_layer_q <= spikes_layer_i == sf_op_pkg::SPIKING_C2 ? sf_op_pkg::C2
                  : spikes_layer_i == sf_op_pkg::SPIKING_C1 ? sf_op_pkg::C1 : sf_op_pkg::D1;
    beat_step_q <= spikes_step_i;
    layer_q <= beat_q ? beat_layer_q : send_d2 ? sf_op_pkg::D2 : sf_op_pkg::C3;
    step_q <= beat_q ? beat_step_q : 3'd0;
    spikes_q <= beat_q ? spikes_all_q : {LANES{1'b0}};
    if (beat_q) membrane_q <= membrane_all_q;
    rows_q <= send_d2 ? d2_rows_q[d2_read_q] : send_c3 ? c3_rows_q[c3_read_q]
            : beat_layer_q == sf_op_pkg::C2 ? c2_rows_q[c2_read_q] : {LANES{1'b0}};
  end
  assign valid_o = valid_q;
  assign layer_o = layer_q;
  assign step_o = step_q;
  assign spikes_o = spikes_q;
  assign rows_o = rows_q;
  assign membrane_o = membrane_q;
endmodule

`default_nettype wire
