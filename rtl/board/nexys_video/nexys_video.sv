// Nexys Video with an XC7A200T, for Vivado: 100 MHz in, 50 MHz from an MMCM, reset while it has not locked or while button
// CPU_RESETN is pressed, the host behind the board's FT232R. Nothing of this board was run: see docs/board.md.
// Lamps, from 0: the board is alive; sample or pixel waiting, command at work, damaged frame, interrupt; 7: reset.
`default_nettype none

module nexys_video (
    input  wire       clk_100mhz,
    input  wire       cpu_resetn,
    input  wire       uart_tx_in,   // names of the board's: the host's output
    output wire       uart_rx_out,
    output wire [7:0] led
);
  localparam integer CLOCK_HZ = 50000000;
  localparam integer ALIVE = 25;

  // 100 MHz x 10 = 1000 MHz / 20 = 50 MHz.
  wire feedback, fast, clock, locked;
  MMCME2_BASE #(
      .CLKIN1_PERIOD   (10.0),
      .CLKFBOUT_MULT_F (10.0),
      .CLKOUT0_DIVIDE_F(20.0)
  ) u_mmcm (
      .CLKIN1  (clk_100mhz),
      .CLKFBIN (feedback),
      .CLKFBOUT(feedback),
      .CLKOUT0 (fast),
      .LOCKED  (locked),
      .PWRDWN  (1'b0),
      .RST     (1'b0)
  );
  BUFG u_clock (
      .I(fast),
      .O(clock)
  );

  // Reset comes at once and goes with the clock, some cycles after the cause has gone.
  wire well = locked && cpu_resetn;
  reg [3:0] reset_q;
  always_ff @(posedge clock or negedge well) begin
    if (!well) reset_q <= 4'd0;
    else reset_q <= {reset_q[2:0], 1'b1};
  end

  reg [ALIVE-1:0] alive_q;
  always_ff @(posedge clock) alive_q <= alive_q + 1'b1;

  wire [3:0] lamps;
  reg [3:0] lamps_q;
  always_ff @(posedge clock) lamps_q <= lamps;
  sf_board #(
      .CLOCK_HZ(CLOCK_HZ),
      .BAUD    (3000000),
      .BANKS   (8),
      .MACS    (128),
      .NEURONS (16)
  ) u_board (
      .clk_i  (clock),
      .rst_ni (reset_q[3]),
      .rx_i   (uart_tx_in),
      .tx_o   (uart_rx_out),
      .lamps_o(lamps)
  );
  assign led = {!reset_q[3], 2'd0, lamps_q, alive_q[ALIVE-1]};
endmodule

`default_nettype wire
