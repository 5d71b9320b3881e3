// Results out: every result accepted leaves as its two beats, once, in order, unchanged while they wait; a new one is
// accepted as soon as the last beat goes.
`default_nettype none

module stream_out_once (
    input wire        clk_i,
    input wire        clear_i,
    input wire        valid_i,
    input wire [27:0] sigma_i,
    input wire [59:0] colour_i,
    input wire        tready_i
);
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire ready, tvalid, tlast;
  wire [63:0] tdata;
  sf_stream_out u_dut (
      .*,
      .rst_ni  (rst_n_q),
      .ready_o (ready),
      .tvalid_o(tvalid),
      .tdata_o (tdata),
      .tlast_o (tlast)
  );

  reg [1:0] left_q = 2'd0;  // beats to come of the result inside
  reg [27:0] sigma_q;
  reg [59:0] colour_q;
  reg waits_q = 1'b0, tlast_q;
  reg [63:0] tdata_q;
  wire accept = valid_i && ready && !clear_i;
  wire beat = tvalid && tready_i;
  wire [63:0] head = {12'd0, colour_q[19:0], 4'd0, sigma_q};
  wire [63:0] tail = {12'd0, colour_q[59:40], 12'd0, colour_q[39:20]};
  always @(posedge clk_i) begin
    if (rst_n_q) begin
      left_q <= clear_i ? 2'd0 : accept ? 2'd2 : beat ? left_q - 2'd1 : left_q;
      waits_q <= tvalid && !tready_i && !clear_i;
    end
    if (accept) begin
      sigma_q <= sigma_i;
      colour_q <= colour_i;
    end
    tdata_q <= tdata;
    tlast_q <= tlast;
  end

  always @* begin
    if (rst_n_q) begin
      beats_of_what_is_inside : assert (tvalid == (left_q != 2'd0));
      two_beats : assert (left_q != 2'd3 && tlast == (left_q == 2'd1));
      data : assert (!tvalid || tdata == (tlast ? tail : head));
      waits_unchanged : assert (!waits_q || (tvalid && tdata == tdata_q && tlast == tlast_q));
      never_overwritten : assert (!accept || left_q == 2'd0 || (left_q == 2'd1 && beat));
      no_bubble : assert (ready || left_q == 2'd2 || !tready_i);
    end
  end
endmodule

`default_nettype wire
