// The field's table in block RAM, behind the AXI4 read port of sf_ray_top: bursts of two beats of eight bytes, answered in order
// after a fixed number of cycles. Banks of 32 KiB lie all over the chip, so each has registers of its own for what it is given
// and for what it gives.
// A read beyond the end is answered with SLVERR.
`default_nettype none
`include "sf_refuse.svh"

module sf_board_memory #(
    parameter integer BANKS = 4  // 1 to 8
) (
    input  wire        clk_i,
    input  wire        rst_ni,
    // words of eight bytes in
    input  wire        we_i,
    input  wire [14:0] waddress_i,
    input  wire [63:0] wdata_i,
    // AXI4
    input  wire        arvalid_i,
    output wire        arready_o,
    input  wire [31:0] araddr_i,
    output wire        rvalid_o,
    output wire [63:0] rdata_o,
    output wire [ 1:0] rresp_o,
    output wire        rlast_o
);
  localparam integer DEPTH = 4096;
  localparam [3:0] FIRST_MISSING = BANKS[3:0];

  // A: the words of a burst
  reg ready_q, second_q, a_valid_q, a_outside_q;
  reg [14:0] a_word_q;
  wire take = arvalid_i && ready_q;
  // B to F: address at a bank, its word, the same in a register, pairs of banks, all of them
  reg [3:0] valid_q, last_q, outside_q;
  reg [2:0] b_bank_q, c_bank_q, d_bank_q;
  reg [1:0] e_pair_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {ready_q, second_q, a_valid_q} <= 3'd0;
      valid_q <= '0;
    end else begin
      ready_q <= !take;
      second_q <= take;
      a_valid_q <= take || second_q;
      valid_q <= {valid_q[2:0], a_valid_q};
    end
  end
  reg a_last_q;
  always_ff @(posedge clk_i) begin
    if (take) begin
      a_word_q <= araddr_i[17:3];
      a_outside_q <= araddr_i[31:18] != '0 || {1'b0, araddr_i[17:15]} + 4'd1 > FIRST_MISSING;
    end else if (second_q) a_word_q <= a_word_q + 1'b1;
    a_last_q <= second_q;
    last_q <= {last_q[2:0], a_last_q};
    outside_q <= {outside_q[2:0], a_outside_q};
    b_bank_q <= a_word_q[14:12];
    c_bank_q <= b_bank_q;
    d_bank_q <= c_bank_q;
    e_pair_q <= d_bank_q[2:1];
  end

  reg w_valid_q;
  reg [14:0] w_address_q;
  reg [63:0] w_data_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) w_valid_q <= 1'b0;
    else w_valid_q <= we_i;
  end
  always_ff @(posedge clk_i) {w_address_q, w_data_q} <= {waddress_i, wdata_i};

  wire [64*8-1:0] banks;
  genvar b;
  generate
    for (b = 0; b < 8; b = b + 1) begin : g_bank
      if (b < BANKS) begin : g_there
        (* no_rw_check *) reg [63:0] word_q[0:DEPTH-1];
        // They move for their own bank alone: so they stay apart from the others' and beside it.
        reg [11:0] address_q, write_address_q;
        reg write_q;
        reg [63:0] write_data_q, read_q, out_q;
        always_ff @(posedge clk_i) begin
          if (a_valid_q && a_word_q[14:12] == b[2:0]) address_q <= a_word_q[11:0];
          write_q <= w_valid_q && w_address_q[14:12] == b[2:0];
          if (w_address_q[14:12] == b[2:0]) {write_address_q, write_data_q} <= {w_address_q[11:0], w_data_q};
          if (write_q) word_q[write_address_q] <= write_data_q;
          read_q <= word_q[address_q];
          out_q <= read_q;
        end
        assign banks[64*b+:64] = out_q;
      end else begin : g_missing
        assign banks[64*b+:64] = 64'd0;
      end
    end
  endgenerate
  wire [64*4-1:0] pairs;
  genvar p;
  generate
    for (p = 0; p < 4; p = p + 1) begin : g_pair
      reg [63:0] pair_q;
      always_ff @(posedge clk_i) pair_q <= d_bank_q[0] ? banks[128*p+64+:64] : banks[128*p+:64];
      assign pairs[64*p+:64] = pair_q;
    end
  endgenerate
  reg [63:0] data_q;
  reg f_valid_q, f_last_q, f_outside_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) f_valid_q <= 1'b0;
    else f_valid_q <= valid_q[3];
  end
  always_ff @(posedge clk_i) begin
    case (e_pair_q)
      2'd0: data_q <= pairs[63:0];
      2'd1: data_q <= pairs[127:64];
      2'd2: data_q <= pairs[191:128];
      default: data_q <= pairs[255:192];
    endcase
    {f_last_q, f_outside_q} <= {last_q[3], outside_q[3]};
  end
  assign arready_o = ready_q;
  assign rvalid_o = f_valid_q;
  assign rdata_o = data_q;
  assign rlast_o = f_last_q;
  assign rresp_o = {f_outside_q, 1'b0};
  `SF_REFUSE(BANKS < 1 || BANKS > 8, "BANKS is not 1 to 8")
  wire unused_ok = &{1'b0, araddr_i[2:0]};
endmodule

`default_nettype wire
