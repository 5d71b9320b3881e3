// Spikes of one layer over all steps of a sample, for two samples: one is filled while the other is worked on.
`default_nettype none

module sf_store #(
    parameter LANES = 128
) (
    input  wire             clk_i,
    input  wire             rst_ni,
    input  wire             clear_i,
    input  wire [      3:0] steps_i,
    // a place is taken before the spikes come
    input  wire             take_i,
    output wire             space_o,
    input  wire             we_i,
    input  wire [      2:0] wstep_i,
    input  wire [LANES-1:0] wspikes_i,
    // the oldest sample that is complete
    output wire             valid_o,
    output wire [LANES-1:0] any_o,      // neurons that fired at any step
    input  wire [LANES-1:0] even_mask_i,  // one neuron, or none
    input  wire [LANES-1:0] odd_mask_i,
    output wire [      7:0] even_fired_o,  // the steps at which it fired
    output wire [      7:0] odd_fired_o,
    input  wire             release_i,
    output wire             idle_o
);
  reg [LANES-1:0] spikes_q[0:15];
  reg [LANES-1:0] any_q[0:1];
  reg [1:0] full_q, taken_q;  // taken: how many places
  reg write_q, read_q;
  wire last = {1'b0, wstep_i} == steps_i - 4'd1;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      full_q <= 2'd0;
      {taken_q, write_q, read_q} <= 4'd0;
    end else if (clear_i) begin
      full_q <= 2'd0;
      {taken_q, write_q, read_q} <= 4'd0;
    end else begin
      taken_q <= taken_q + {1'b0, take_i} - {1'b0, release_i};
      if (we_i && last) begin
        full_q[write_q] <= 1'b1;
        write_q <= !write_q;
      end
      if (release_i) begin
        full_q[read_q] <= 1'b0;
        read_q <= !read_q;
      end
    end
  end
  always_ff @(posedge clk_i) begin
    if (we_i) begin
      spikes_q[{write_q, wstep_i}] <= wspikes_i;
      any_q[write_q] <= wstep_i == 3'd0 ? wspikes_i : any_q[write_q] | wspikes_i;
    end
  end

  assign space_o = !taken_q[1];
  assign valid_o = full_q[read_q];
  assign any_o = any_q[read_q];
  assign idle_o = taken_q == 2'd0;
  genvar t;
  generate
    for (t = 0; t < 8; t = t + 1) begin : g_fired
      assign even_fired_o[t] = t < {28'd0, steps_i} && |(spikes_q[{read_q, 3'(t)}] & even_mask_i);
      assign odd_fired_o[t] = t < {28'd0, steps_i} && |(spikes_q[{read_q, 3'(t)}] & odd_mask_i);
    end
  endgenerate
endmodule

`default_nettype wire
