// Registers of the rays over AXI4-Lite: words for the encoder pass through, the compositor's programming is kept and
// checked at start. Offsets and fields: include/spikefield/csr.def. One write and one read at a time, as sf_csr.
`default_nettype none

module sf_ray_csr #(
    parameter integer CACHE_BYTES = sf_arch_pkg::CACHE_BYTES,
    parameter integer CACHE_WAYS = sf_arch_pkg::CACHE_WAYS,
    parameter integer GRID = 1,
    parameter integer PLANES = 1
) (
    input  wire        clk_i,
    input  wire        rst_ni,
    // AXI4-Lite; address and data of a write come together
    input  wire        wvalid_i,
    output wire        wready_o,
    input  wire [12:0] waddr_i,
    input  wire [31:0] wdata_i,
    input  wire [ 3:0] wstrb_i,
    output wire        bvalid_o,
    input  wire        bready_i,
    output wire [ 1:0] bresp_o,
    input  wire        arvalid_i,
    output wire        arready_o,
    input  wire [12:0] araddr_i,
    output wire        rvalid_o,
    input  wire        rready_i,
    output wire [31:0] rdata_o,
    output wire        irq_o,
    // programming
    output wire        cfg_we_o,
    output wire [11:0] cfg_addr_o,
    output wire [31:0] cfg_data_o,
    output wire [19:0] trans_stop_o,
    output wire [10:0] max_samples_o,
    output wire [50:0] background_o,
    output wire [31:0] base_o,
    // commands and state
    output wire        running_o,
    input  wire        soft_reset_i,
    input  wire        active_i,
    input  wire        error_order_i,
    input  wire        bad_field_i,    // the field's programming does not fit
    // events of the field
    input  wire        error_memory_i,
    input  wire [ 1:0] lookups_i,
    input  wire [ 1:0] misses_i,
    input  wire        filled_i,
    input  wire        waits_i
);
  localparam [1:0] OKAY = 2'd0;
  localparam [1:0] SLVERR = 2'd2;
  localparam [31:0] CACHE = 32'(CACHE_BYTES) << sf_csr_pkg::FIELD_CACHE_BYTES | 32'(CACHE_WAYS) << sf_csr_pkg::FIELD_CACHE_WAYS;

  reg running_q, bvalid_q;
  reg [1:0] bresp_q;
  reg [4:0] error_q, irq_enable_q;
  // Values that do not fit are stored as an illegal value, so that the check at start sees them.
  reg [20:0] trans_stop_q;
  reg [10:0] max_samples_q;
  reg [17:0] red_q, green_q, blue_q;
  reg [11:0] encoder_address_q;
  reg [31:0] base_q;

  // ---- write channel
  wire write = wvalid_i && !bvalid_q;
  assign wready_o = write;
  assign bvalid_o = bvalid_q;
  assign bresp_o = bresp_q;
  wire [12:0] wa = {waddr_i[12:2], 2'b00};
  wire word_write = write && wstrb_i == 4'hf;
  wire to_encoder = wa == sf_csr_pkg::ENCODER_DATA;
  wire to_ctrl = wa == sf_csr_pkg::RAY_CTRL;
  wire to_error = wa == sf_csr_pkg::RAY_ERROR;
  wire to_irq_enable = wa == sf_csr_pkg::RAY_IRQ_ENABLE;
  wire to_config = wa >= sf_csr_pkg::RAY_TRANS_STOP && wa <= sf_csr_pkg::FIELD_BASE;
  wire config_write = word_write && to_config && !running_q;
  wire start = word_write && to_ctrl && wdata_i[sf_csr_pkg::RAY_CTRL_START];
  wire clear = word_write && to_ctrl && wdata_i[sf_csr_pkg::RAY_CTRL_CLEAR];

  wire bad_value = trans_stop_q[20] || max_samples_q == 11'd0 || max_samples_q > 11'd1024 || red_q > 18'd65536
      || green_q > 18'd65536 || blue_q > 18'd65536 || base_q[3:0] != 4'd0 || bad_field_i;
  wire bad_start = start && !running_q && bad_value;
  wire bad_busy = word_write && running_q && (to_config || start);
  wire bad_address = write && (!(to_config || to_ctrl || to_error || to_irq_enable) || wstrb_i != 4'hf);
  wire [4:0] error_keep = soft_reset_i ? 5'd0 : word_write && to_error ? error_q & ~wdata_i[4:0] : error_q;
  wire [17:0] colour_w = |wdata_i[31:17] ? 18'h3ffff : wdata_i[17:0];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      running_q <= 1'b0;
      error_q <= 5'd0;
      irq_enable_q <= 5'd0;
      bvalid_q <= 1'b0;
      bresp_q <= OKAY;
      trans_stop_q <= 21'd0;
      max_samples_q <= 11'd0;
      {red_q, green_q, blue_q} <= 54'd0;
      encoder_address_q <= 12'd0;
      base_q <= 32'd0;
    end else begin
      if (soft_reset_i) running_q <= 1'b0;
      else if (start) running_q <= running_q || !bad_value;
      error_q <= error_keep | {error_memory_i, error_order_i && !soft_reset_i, bad_address, bad_busy, bad_start};
      if (word_write && to_irq_enable) irq_enable_q <= wdata_i[4:0];
      if (write) begin
        bvalid_q <= 1'b1;
        bresp_q <= bad_start || bad_busy || bad_address ? SLVERR : OKAY;
      end else if (bready_i) bvalid_q <= 1'b0;
      if (config_write) begin
        case (wa)
          sf_csr_pkg::RAY_TRANS_STOP: trans_stop_q <= |wdata_i[31:20] ? 21'h1fffff : wdata_i[20:0];
          sf_csr_pkg::RAY_MAX_SAMPLES: max_samples_q <= |wdata_i[31:11] ? 11'd0 : wdata_i[10:0];
          sf_csr_pkg::RAY_BACKGROUND_R: red_q <= colour_w;
          sf_csr_pkg::RAY_BACKGROUND_G: green_q <= colour_w;
          sf_csr_pkg::RAY_BACKGROUND_B: blue_q <= colour_w;
          sf_csr_pkg::ENCODER_ADDRESS: encoder_address_q <= wdata_i[11:0];
          sf_csr_pkg::FIELD_BASE: base_q <= wdata_i;
          default: encoder_address_q <= encoder_address_q + 12'd1;  // ENCODER_DATA
        endcase
      end
    end
  end
  assign cfg_we_o = config_write && to_encoder;
  assign cfg_addr_o = encoder_address_q;
  assign cfg_data_o = wdata_i;

  // ---- counters of the field
  reg [63:0] lookups_q, misses_q, fills_q, stalls_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      lookups_q <= 64'd0;
      misses_q <= 64'd0;
      fills_q <= 64'd0;
      stalls_q <= 64'd0;
    end else if (clear) begin
      lookups_q <= 64'd0;
      misses_q <= 64'd0;
      fills_q <= 64'd0;
      stalls_q <= 64'd0;
    end else begin
      lookups_q <= lookups_q + {62'd0, lookups_i};
      misses_q <= misses_q + {62'd0, misses_i};
      fills_q <= fills_q + {63'd0, filled_i};
      stalls_q <= stalls_q + {63'd0, waits_i};
    end
  end
  wire [31:0] lookups_low, lookups_high, misses_low, misses_high, fills_low, fills_high, stalls_low, stalls_high;
  assign {lookups_high, lookups_low} = lookups_q;
  assign {misses_high, misses_low} = misses_q;
  assign {fills_high, fills_low} = fills_q;
  assign {stalls_high, stalls_low} = stalls_q;

  // ---- read channel
  reg rvalid_q;
  reg [31:0] rdata_q, rdata_d;
  wire read = arvalid_i && !rvalid_q;
  wire [12:0] ra = {araddr_i[12:2], 2'b00};
  always_comb begin
    case (ra)
      sf_csr_pkg::RAY_STATUS: rdata_d = {29'd0, |error_q, active_i, running_q};
      sf_csr_pkg::RAY_ERROR: rdata_d = {27'd0, error_q};
      sf_csr_pkg::RAY_IRQ_ENABLE: rdata_d = {27'd0, irq_enable_q};
      sf_csr_pkg::RAY_TRANS_STOP: rdata_d = {11'd0, trans_stop_q};
      sf_csr_pkg::RAY_MAX_SAMPLES: rdata_d = {21'd0, max_samples_q};
      sf_csr_pkg::RAY_BACKGROUND_R: rdata_d = {14'd0, red_q};
      sf_csr_pkg::RAY_BACKGROUND_G: rdata_d = {14'd0, green_q};
      sf_csr_pkg::RAY_BACKGROUND_B: rdata_d = {14'd0, blue_q};
      sf_csr_pkg::ENCODER_ADDRESS: rdata_d = {20'd0, encoder_address_q};
      sf_csr_pkg::FIELD_BASE: rdata_d = base_q;
      sf_csr_pkg::FIELD_CACHE: rdata_d = CACHE;
      sf_csr_pkg::FIELD_KINDS: rdata_d = {30'd0, PLANES != 0, GRID != 0};
      sf_csr_pkg::FIELD_LOOKUPS: rdata_d = lookups_low;
      sf_csr_pkg::FIELD_LOOKUPS_HIGH: rdata_d = lookups_high;
      sf_csr_pkg::FIELD_MISSES: rdata_d = misses_low;
      sf_csr_pkg::FIELD_MISSES_HIGH: rdata_d = misses_high;
      sf_csr_pkg::FIELD_FILLS: rdata_d = fills_low;
      sf_csr_pkg::FIELD_FILLS_HIGH: rdata_d = fills_high;
      sf_csr_pkg::FIELD_STALLS: rdata_d = stalls_low;
      sf_csr_pkg::FIELD_STALLS_HIGH: rdata_d = stalls_high;
      default: rdata_d = 32'd0;
    endcase
  end
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) rvalid_q <= 1'b0;
    else if (read) rvalid_q <= 1'b1;
    else if (rready_i) rvalid_q <= 1'b0;
  end
  always_ff @(posedge clk_i) if (read) rdata_q <= rdata_d;
  assign arready_o = read;
  assign rvalid_o = rvalid_q;
  assign rdata_o = rdata_q;

  assign irq_o = |(error_q & irq_enable_q);
  assign trans_stop_o = trans_stop_q[19:0];
  assign max_samples_o = max_samples_q;
  assign background_o = {blue_q[16:0], green_q[16:0], red_q[16:0]};
  assign base_o = base_q;
  assign running_o = running_q;
  wire unused_ok = &{1'b0, waddr_i[1:0], araddr_i[1:0]};
endmodule

`default_nettype wire
