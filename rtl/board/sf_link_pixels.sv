// The pixels that wait for the host: a queue of words, whole pixels in and out.
`default_nettype none

module sf_link_pixels #(
    parameter integer PIXELS = 42  // room for, up to 42
) (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         forget_i,
    input  wire         s_axis_tvalid_i,
    output wire         s_axis_tready_o,
    input  wire [383:0] s_axis_tdata_i,
    output wire [  5:0] pixels_o,         // whole ones that wait
    output wire         full_o,
    output wire [ 31:0] word_o,           // the next one, two cycles after next_i
    input  wire         next_i,
    input  wire         last_i            // with next_i: the last word of a pixel
);
  localparam [8:0] RING_LAST = 9'(PIXELS * 12 - 1);
  reg [3:0] pixel_word_q;
  reg [5:0] pixels_q;
  reg [8:0] in_q, out_q;
  reg queue_we_q, pixel_ready_q;
  reg [8:0] queue_at_q;
  reg [31:0] queue_data_q, queue_word_q;
  (* no_rw_check *) reg [31:0] queue_mem_q[0:511];
  assign full_o = pixels_q == PIXELS[5:0];
  wire pixel_store = s_axis_tvalid_i && !pixel_ready_q && !full_o;
  wire pixel_stored = pixel_store && pixel_word_q == 4'd11;
  assign s_axis_tready_o = pixel_ready_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {queue_we_q, pixel_ready_q} <= 2'd0;
      pixel_word_q <= '0;
      pixels_q <= '0;
      in_q <= '0;
      out_q <= '0;
    end else begin
      queue_we_q <= pixel_store;
      pixel_ready_q <= pixel_stored;
      if (pixel_store) begin
        pixel_word_q <= pixel_stored ? '0 : pixel_word_q + 1'b1;
        in_q <= in_q == RING_LAST ? '0 : in_q + 1'b1;
      end
      if (next_i) out_q <= out_q == RING_LAST ? '0 : out_q + 1'b1;
      if (pixel_stored != last_i) pixels_q <= pixel_stored ? pixels_q + 1'b1 : pixels_q - 1'b1;
      if (forget_i) begin
        {queue_we_q, pixel_ready_q} <= 2'd0;
        pixel_word_q <= '0;
        pixels_q <= '0;
        in_q <= '0;
        out_q <= '0;
      end
    end
  end
  always_ff @(posedge clk_i) begin
    queue_at_q <= in_q;
    queue_data_q <= s_axis_tdata_i[32*pixel_word_q+:32];
    if (queue_we_q) queue_mem_q[queue_at_q] <= queue_data_q;
    queue_word_q <= queue_mem_q[out_q];
  end
  assign pixels_o = pixels_q;
  assign word_o = queue_word_q;
endmodule

`default_nettype wire
