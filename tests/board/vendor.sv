// What FPGAs have and simulators lack, as far as the tops in rtl/board use it: for lint alone.
`default_nettype none
`include "sf_refuse.svh"
/* verilator lint_off DECLFILENAME */
/* verilator lint_off UNUSEDSIGNAL */
/* verilator lint_off UNUSEDPARAM */
/* verilator lint_off UNDRIVEN */
module EHXPLLL #(
    parameter PLLRST_ENA = "", INTFB_WAKE = "", STDBY_ENABLE = "", DPHASE_SOURCE = "", OUTDIVIDER_MUXA = "", OUTDIVIDER_MUXB = "",
    parameter OUTDIVIDER_MUXC = "", OUTDIVIDER_MUXD = "", CLKOP_ENABLE = "", FEEDBK_PATH = "",
    parameter CLKI_DIV = 1, CLKOP_DIV = 1, CLKOP_CPHASE = 0, CLKOP_FPHASE = 0, CLKFB_DIV = 1
) (
    input  wire RST, STDBY, CLKI, CLKFB, PHASESEL0, PHASESEL1, PHASEDIR, PHASESTEP, PHASELOADREG, PLLWAKESYNC, ENCLKOP,
    output wire CLKOP, CLKINTFB, LOCK
);
  localparam integer VCO = 25 / CLKI_DIV * CLKFB_DIV * CLKOP_DIV;
  `SF_REFUSE(VCO < 400 || VCO > 800, "the PLL's oscillator is not at 400 to 800 MHz")
endmodule
module MMCME2_BASE #(
    parameter real CLKIN1_PERIOD = 10.0, CLKFBOUT_MULT_F = 1.0, CLKOUT0_DIVIDE_F = 1.0
) (
    input  wire CLKIN1, CLKFBIN, PWRDWN, RST,
    output wire CLKFBOUT, CLKOUT0, LOCKED
);
endmodule
module BUFG (
    input  wire I,
    output wire O
);
endmodule
`default_nettype wire
