// CRC-32 of a frame (reflected 0xedb88320), a bit per cycle: a byte on the line takes far longer. Mirror: sim/board/frame.c
`default_nettype none

module sf_link_crc (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        valid_i,  // a byte, at most every tenth cycle
    input  wire [ 7:0] data_i,
    output wire        busy_o,
    output wire [31:0] crc_o     // not inverted
);
  localparam [31:0] POLYNOMIAL = 32'hedb88320;
  reg [31:0] crc_q;
  reg [7:0] byte_q;
  reg [3:0] left_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      crc_q <= '1;
      left_q <= '0;
      byte_q <= '0;
    end else if (clear_i) begin
      crc_q <= '1;
      left_q <= '0;
    end else if (valid_i) begin
      byte_q <= data_i;
      left_q <= 4'd8;
    end else if (left_q != 4'd0) begin
      crc_q <= {1'b0, crc_q[31:1]} ^ (crc_q[0] ^ byte_q[0] ? POLYNOMIAL : 32'd0);
      byte_q <= {1'b0, byte_q[7:1]};
      left_q <= left_q - 1'b1;
    end
  end
  assign busy_o = left_q != 4'd0;
  assign crc_o = crc_q;
endmodule

`default_nettype wire
