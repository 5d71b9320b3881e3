// Reset and lamps of a board's top. Lamps, from 0: the board is alive; sample or pixel waiting, command at work, damaged frame,
// interrupt; 7: reset.
`default_nettype none

module sf_board_start (
    input  wire       clk_i,
    input  wire       well_i,    // the clock has locked and no button is pressed
    output wire       rst_no,    // comes at once and goes with the clock, some cycles after the cause has gone
    input  wire [3:0] lamps_i,   // of sf_board
    output wire [7:0] led_o
);
  localparam integer ALIVE = 25;

  reg [3:0] reset_q;
  always_ff @(posedge clk_i or negedge well_i) begin
    if (!well_i) reset_q <= 4'd0;
    else reset_q <= {reset_q[2:0], 1'b1};
  end

  reg [ALIVE-1:0] alive_q;
  reg [3:0] lamps_q;
  always_ff @(posedge clk_i) begin
    alive_q <= alive_q + 1'b1;
    lamps_q <= lamps_i;
  end
  assign rst_no = reset_q[3];
  assign led_o = {!reset_q[3], 2'd0, lamps_q, alive_q[ALIVE-1]};
endmodule

`default_nettype wire
