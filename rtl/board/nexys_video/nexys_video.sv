// Nexys Video with an XC7A200T, for Vivado: 100 MHz in, 50 MHz from an MMCM, reset while it has not locked or while button
// CPU_RESETN is pressed, the host behind the board's FT232R. Nothing of this board was run: see docs/board.md.
`default_nettype none

module nexys_video (
    input  wire       clk_100mhz,
    input  wire       cpu_resetn,
    input  wire       uart_tx_in,   // names of the board's: the host's output
    output wire       uart_rx_out,
    output wire [7:0] led
);
  localparam integer CLOCK_HZ = 50000000;

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

  wire reset_n;
  wire [3:0] lamps;
  sf_board_start u_start (
      .clk_i  (clock),
      .well_i (locked && cpu_resetn),
      .rst_no (reset_n),
      .lamps_i(lamps),
      .led_o  (led)
  );
  sf_board #(
      .CLOCK_HZ(CLOCK_HZ),
      .BAUD    (3000000),
      .BANKS   (8),
      .MACS    (128),
      .NEURONS (16)
  ) u_board (
      .clk_i  (clock),
      .rst_ni (reset_n),
      .rx_i   (uart_tx_in),
      .tx_o   (uart_rx_out),
      .lamps_o(lamps)
  );
endmodule

`default_nettype wire
