// Results out over AXI4-Stream: two beats per sample, {colour 0, density} then {colour 2, colour 1}, 32 bits each,
// tlast on the second. Density U16.12, colours U4.16.
`default_nettype none

module sf_stream_out (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        valid_i,
    output wire        ready_o,
    input  wire [27:0] sigma_i,
    input  wire [59:0] colour_i,
    output wire        tvalid_o,
    input  wire        tready_i,
    output wire [63:0] tdata_o,
    output wire        tlast_o
);
  reg full_q, second_q;
  reg [27:0] sigma_q;
  reg [59:0] colour_q;
  assign ready_o = !full_q || (tready_i && second_q);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {full_q, second_q} <= 2'd0;
    end else if (clear_i) begin
      {full_q, second_q} <= 2'd0;
    end else begin
      if (ready_o) full_q <= valid_i;
      if (full_q && tready_i) second_q <= !second_q;
    end
  end

  always_ff @(posedge clk_i) begin
    if (ready_o && valid_i) begin
      sigma_q <= sigma_i;
      colour_q <= colour_i;
    end
  end

  assign tvalid_o = full_q;
  assign tlast_o = second_q;
  assign tdata_o = second_q ? {12'd0, colour_q[59:40], 12'd0, colour_q[39:20]} : {12'd0, colour_q[19:0], 4'd0, sigma_q};
endmodule

`default_nettype wire
