// Bytes to a serial line: one start bit, eight data bits, one stop bit. See sf_uart_rx for the length of a bit.
`default_nettype none
`include "sf_refuse.svh"

module sf_uart_tx #(
    parameter integer CLOCK_HZ = 50000000,
    parameter integer BAUD = 3000000
) (
    input  wire       clk_i,
    input  wire       rst_ni,
    input  wire       valid_i,
    output wire       ready_o,
    input  wire [7:0] data_i,
    output wire       tx_o
);
  localparam integer BIT = (CLOCK_HZ / 100) * 256 / (BAUD / 100);  // in 1/256 cycles
  localparam integer WIDTH = $clog2(BIT) + 2;
  localparam [WIDTH-1:0] PERIOD = BIT[WIDTH-1:0], CYCLE = 256;

  reg [9:0] shift_q;  // the bit on the line is the lowest
  reg [3:0] bits_q;   // left, with it
  reg [WIDTH-1:0] timer_q;
  wire now = timer_q < CYCLE;
  assign ready_o = bits_q == 4'd0;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      shift_q <= '1;
      bits_q <= '0;
      timer_q <= '0;
    end else if (ready_o) begin
      timer_q <= PERIOD - CYCLE;
      if (valid_i) begin
        shift_q <= {1'b1, data_i, 1'b0};
        bits_q <= 4'd10;
      end
    end else begin
      timer_q <= now ? timer_q + PERIOD - CYCLE : timer_q - CYCLE;
      if (now) begin
        shift_q <= {1'b1, shift_q[9:1]};
        bits_q <= bits_q - 1'b1;
      end
    end
  end
  assign tx_o = shift_q[0];
  `SF_REFUSE(BIT < 4 * 256, "a bit takes fewer than four cycles: CLOCK_HZ, BAUD")
endmodule

`default_nettype wire
