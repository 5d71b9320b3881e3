// ULX3S with an LFE5U-85F: 25 MHz in, 50 MHz from the PLL, reset while it has not locked or while button PWR is pressed, the
// host behind the board's FT231X.
`default_nettype none

module ulx3s (
    input  wire       clk_25mhz,
    input  wire [0:0] btn,       // PWR: low while it is pressed
    input  wire       ftdi_txd,  // names of the FT231X's pins
    output wire       ftdi_rxd,
    output wire [7:0] led,
    output wire       wifi_gpio0
);
  localparam integer CLOCK_HZ = 50000000;

  // 25 MHz / 1 x 24 = 600 MHz / 12 = 50 MHz: the feedback is CLKOP, so that CLKFB_DIV = 2 gives twice the input.
  wire clock, locked, inner;
  (* FREQUENCY_PIN_CLKI = "25", FREQUENCY_PIN_CLKOP = "50" *)
  EHXPLLL #(
      .PLLRST_ENA     ("DISABLED"),
      .INTFB_WAKE     ("DISABLED"),
      .STDBY_ENABLE   ("DISABLED"),
      .DPHASE_SOURCE  ("DISABLED"),
      .OUTDIVIDER_MUXA("DIVA"),
      .OUTDIVIDER_MUXB("DIVB"),
      .OUTDIVIDER_MUXC("DIVC"),
      .OUTDIVIDER_MUXD("DIVD"),
      .CLKI_DIV       (1),
      .CLKOP_ENABLE   ("ENABLED"),
      .CLKOP_DIV      (12),
      .CLKOP_CPHASE   (5),
      .CLKOP_FPHASE   (0),
      .FEEDBK_PATH    ("CLKOP"),
      .CLKFB_DIV      (2)
  ) u_pll (
      .RST         (1'b0),
      .STDBY       (1'b0),
      .CLKI        (clk_25mhz),
      .CLKOP       (clock),
      .CLKFB       (clock),
      .CLKINTFB    (inner),
      .PHASESEL0   (1'b0),
      .PHASESEL1   (1'b0),
      .PHASEDIR    (1'b1),
      .PHASESTEP   (1'b1),
      .PHASELOADREG(1'b1),
      .PLLWAKESYNC (1'b0),
      .ENCLKOP     (1'b0),
      .LOCK        (locked)
  );

  wire reset_n;
  wire [3:0] lamps;
  sf_board_start u_start (
      .clk_i  (clock),
      .well_i (locked && btn[0]),
      .rst_no (reset_n),
      .lamps_i(lamps),
      .led_o  (led)
  );
  sf_board #(
      .CLOCK_HZ(CLOCK_HZ),
      .BAUD    (3000000)
  ) u_board (
      .clk_i  (clock),
      .rst_ni (reset_n),
      .rx_i   (ftdi_txd),
      .tx_o   (ftdi_rxd),
      .lamps_o(lamps)
  );
  wire unused_ok = &{1'b0, inner};
  assign wifi_gpio0 = 1'b1;  // low would make the ESP32 take over the board
endmodule

`default_nettype wire
