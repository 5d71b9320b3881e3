// Bytes from a serial line: one start bit, eight data bits, one stop bit, each read in its middle. A bit may last any number
// of cycles and 1/256 of them, so that a clock need not be a multiple of the rate.
`default_nettype none
`include "sf_refuse.svh"

module sf_uart_rx #(
    parameter integer CLOCK_HZ = 50000000,
    parameter integer BAUD = 3000000
) (
    input  wire       clk_i,
    input  wire       rst_ni,
    input  wire       rx_i,
    output wire       valid_o,  // for one cycle
    output wire [7:0] data_o,
    output wire       broken_o  // with it: the stop bit was not there
);
  localparam integer BIT = (CLOCK_HZ / 100) * 256 / (BAUD / 100);  // in 1/256 cycles
  localparam integer WIDTH = $clog2(BIT) + 2;
  localparam [WIDTH-1:0] PERIOD = BIT[WIDTH-1:0], HALF = PERIOD / 2, CYCLE = 256;

  reg [2:0] line_q;
  reg active_q, valid_q, broken_q;
  reg [3:0] bit_q;
  reg [7:0] data_q;
  reg [WIDTH-1:0] timer_q;
  wire line = line_q[2];
  wire now = timer_q < CYCLE;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      line_q <= 3'b111;
      {active_q, valid_q, broken_q} <= 3'b000;
      bit_q <= '0;
      timer_q <= '0;
    end else begin
      line_q <= {line_q[1:0], rx_i};
      valid_q <= 1'b0;
      timer_q <= now ? timer_q + PERIOD - CYCLE : timer_q - CYCLE;
      if (!active_q) begin
        timer_q <= HALF;
        bit_q <= '0;
        active_q <= !line && !broken_q;  // after a broken byte the line has to come to rest
        if (line) broken_q <= 1'b0;
      end else if (now) begin
        bit_q <= bit_q + 1'b1;
        if (bit_q == 4'd0) active_q <= !line;
        if (bit_q == 4'd9) begin
          {active_q, valid_q} <= 2'b01;
          broken_q <= !line;
        end
      end
    end
  end
  always_ff @(posedge clk_i) if (active_q && now && bit_q != 4'd9) data_q <= {line, data_q[7:1]};

  assign valid_o = valid_q;
  assign data_o = data_q;
  assign broken_o = broken_q;
  `SF_REFUSE(BIT < 4 * 256, "a bit takes fewer than four cycles: CLOCK_HZ, BAUD")
endmodule

`default_nettype wire
