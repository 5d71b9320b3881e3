// ULX3S with an LFE5U-85F: 25 MHz in, 50 MHz from the PLL, reset while it has not locked or while button PWR is pressed, the
// host behind the board's FT231X. Lamps, from 0: the board is alive; sample or pixel waiting, command at work, damaged frame,
// interrupt; 7: reset.
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
  localparam integer ALIVE = 25;

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

  // Reset comes at once and goes with the clock, some cycles after the cause has gone.
  wire well = locked && btn[0];
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
      .BAUD    (3000000)
  ) u_board (
      .clk_i  (clock),
      .rst_ni (reset_q[3]),
      .rx_i   (ftdi_txd),
      .tx_o   (ftdi_rxd),
      .lamps_o(lamps)
  );
  assign led = {!reset_q[3], 2'd0, lamps_q, alive_q[ALIVE-1]};
  wire unused_ok = &{1'b0, inner};
  assign wifi_gpio0 = 1'b1;  // low would make the ESP32 take over the board
endmodule

`default_nettype wire
