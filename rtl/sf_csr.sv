// Registers over AXI4-Lite. Offsets and fields: include/spikefield/csr.def. One write and one read at a time.
`default_nettype none

module sf_csr #(
    parameter LANES = sf_arch_pkg::LANES,
    parameter MACS = sf_arch_pkg::MACS,
    parameter NEURONS = sf_arch_pkg::NEURONS,
    parameter STEPS_AT_ONCE = sf_arch_pkg::STEPS_AT_ONCE
) (
    input  wire         clk_i,
    input  wire         rst_ni,
    // AXI4-Lite
    input  wire         awvalid_i,
    output wire         awready_o,
    input  wire [ 12:0] awaddr_i,
    input  wire         wvalid_i,
    output wire         wready_o,
    input  wire [ 31:0] wdata_i,
    input  wire [  3:0] wstrb_i,
    output wire         bvalid_o,
    input  wire         bready_i,
    output wire [  1:0] bresp_o,
    input  wire         arvalid_i,
    output wire         arready_o,
    input  wire [ 12:0] araddr_i,
    output wire         rvalid_o,
    input  wire         rready_i,
    output wire [ 31:0] rdata_o,
    output wire [  1:0] rresp_o,
    output wire         irq_o,
    // programming
    output wire [  1:0] mode_o,
    output wire [  3:0] steps_o,
    output wire [ 15:0] exp_mul_o,
    output wire [  4:0] exp_shift_o,
    output wire [ 31:0] exp_bias_o,
    output wire [ 15:0] sigmoid_mul_o,
    output wire [  4:0] sigmoid_shift_o,
    output wire [ 31:0] sigmoid_bias_o,
    output wire [ 44:0] n_in_o,         // 9 bits a layer, D1 in the lowest
    output wire [ 44:0] n_out_o,
    output wire [ 64:0] k_o,
    output wire [119:0] theta_o,
    output wire [ 12:0] bias_o,         // C3, C2, value of C1's
    output wire         we_o,
    output wire [  2:0] wlayer_o,
    output wire [  8:0] wrow_o,
    output wire [  5:0] wword_o,
    output wire [ 31:0] wweights_o,
    // commands and state
    output wire         running_o,
    output wire         soft_reset_o,
    output wire         clear_o,
    output wire         snapshot_o,
    input  wire         active_i,
    input  wire         counters_busy_i,
    input  wire         error_packet_i,
    input  wire         error_value_i,
    output wire [  8:0] counter_index_o,
    input  wire [ 63:0] counter_i
);
  localparam [1:0] OKAY = 2'd0;
  localparam [1:0] SLVERR = 2'd2;

  reg running_q, counters_busy_q;
  reg [10:0] error_q;
  reg [1:0] irq_enable_q, irq_pending_q;
  reg [1:0] mode_q;
  reg [3:0] steps_q;
  reg [16:0] exp_mul_q, sigmoid_mul_q;
  reg [5:0] exp_shift_q, sigmoid_shift_q;
  reg [31:0] exp_bias_q, sigmoid_bias_q;
  // One entry per layer, 9 bits per size, 13 per leak, 24 per threshold.
  reg [44:0] n_in_q, n_out_q;
  reg [64:0] k_q;
  reg [119:0] theta_q;
  reg [13:0] bias_q;
  reg [17:0] weight_address_q;

  // ---- write channel: address and data are taken together
  reg bvalid_q;
  reg [1:0] bresp_q;
  wire write = awvalid_i && wvalid_i && !bvalid_q;
  assign awready_o = write;
  assign wready_o = write;
  assign bvalid_o = bvalid_q;
  assign bresp_o = bresp_q;

  wire [12:0] wa = {awaddr_i[12:2], 2'b00};
  wire word_write = write && wstrb_i == 4'hf;
  wire to_ctrl = wa == sf_csr_pkg::CTRL;
  wire to_error = wa == sf_csr_pkg::ERROR;
  wire to_irq_enable = wa == sf_csr_pkg::IRQ_ENABLE;
  wire to_irq_pending = wa == sf_csr_pkg::IRQ_PENDING;
  wire to_table = wa >= sf_csr_pkg::D1_N_IN && wa <= sf_csr_pkg::C3_THETA;
  wire to_weight = wa == sf_csr_pkg::WEIGHT_DATA;
  wire to_config = wa >= sf_csr_pkg::MODE && wa <= sf_csr_pkg::BIAS;
  wire known = to_ctrl || to_error || to_irq_enable || to_irq_pending || to_config;
  wire config_write = word_write && to_config && !running_q;
  wire table_write = config_write && to_table;
  wire [1:0] table_field = wa[3:2];
  wire [12:0] table_offset = wa - sf_csr_pkg::D1_N_IN;
  wire [2:0] table_layer = table_offset[6:4];

  // Values that do not fit are stored as an illegal value, so that the check at start sees them.
  wire [8:0] size_w = |wdata_i[31:9] ? 9'h1ff : wdata_i[8:0];
  wire [12:0] k_w = |wdata_i[31:13] ? 13'h1fff : wdata_i[12:0];
  wire [23:0] theta_w = |wdata_i[31:23] ? 24'd0 : wdata_i[23:0];
  wire [13:0] bias_w = {|{wdata_i[31:18], wdata_i[15:11]}, wdata_i[17:16], wdata_i[10:0]};
  wire [16:0] mul_w = |wdata_i[31:16] ? 17'h10000 : wdata_i[16:0];
  wire [5:0] shift_w = |wdata_i[31:5] ? 6'h20 : wdata_i[5:0];

  // ---- weights
  wire [2:0] wlayer = weight_address_q[17:15];
  wire [8:0] wrow = weight_address_q[14:6];
  wire [5:0] wword = weight_address_q[5:0];
  wire wnarrow = wlayer == sf_op_pkg::D2 || wlayer == sf_op_pkg::C3;
  reg wrow_bad;
  always_comb begin
    case (wlayer)
      sf_op_pkg::D1: wrow_bad = wrow >= 9'(sf_arch_pkg::FEATURE_MAX);
      sf_op_pkg::D2: wrow_bad = wrow >= 9'(LANES);
      sf_op_pkg::C1: wrow_bad = wrow >= 9'(sf_arch_pkg::DIR_MAX) && wrow != 9'(sf_arch_pkg::BIAS_ROW);
      default: wrow_bad = wrow >= 9'(LANES) && wrow != 9'(sf_arch_pkg::BIAS_ROW);
    endcase
  end
  wire minus_128 = wdata_i[7:0] == 8'h80 || wdata_i[15:8] == 8'h80 || wdata_i[23:16] == 8'h80
      || wdata_i[31:24] == 8'h80;
  wire weight_bad = wlayer > sf_op_pkg::C3 || (wnarrow && wword > 6'd3) || (!wnarrow && {1'b0, wword} >= 7'(LANES / 4))
      || wrow_bad || minus_128;
  assign we_o = config_write && to_weight && !weight_bad;
  assign wlayer_o = wlayer;
  assign wrow_o = wrow;
  assign wword_o = wword;
  assign wweights_o = wdata_i;

  // ---- check at start
  wire [8:0] d1_in = n_in_q[8:0];
  wire [8:0] d1_out = n_out_q[8:0];
  wire [8:0] d2_in = n_in_q[17:9];
  wire [8:0] d2_out = n_out_q[17:9];
  wire [8:0] c1_in = n_in_q[26:18];
  wire [8:0] c1_out = n_out_q[26:18];
  wire [8:0] c2_in = n_in_q[35:27];
  wire [8:0] c2_out = n_out_q[35:27];
  wire [8:0] c3_in = n_in_q[44:36];
  wire [8:0] c3_out = n_out_q[44:36];
  wire [8:0] n_h = d2_out - 9'd1;
  wire decodes = d1_out == 9'd0;
  wire bad_density = d1_in == 9'd0 || d1_in > 9'd32 || d1_out > 9'(LANES) || d2_in != d1_out || d2_out == 9'd0
      || d2_out > 9'd16 || c1_in < n_h || c1_in > n_h + 9'd16;
  wire bad_decoder = d1_in != 9'd0 || d2_in != 9'd0 || d2_out != 9'd0 || c1_in > 9'(sf_arch_pkg::DIR_MAX);
  wire bad_size = (decodes ? bad_decoder : bad_density) || bias_q[13] || c1_in == 9'd0 || c1_out == 9'd0 || c1_out > 9'(LANES) || c2_in != c1_out || c2_out == 9'd0 || c2_out > 9'(LANES)
      || c3_in != c2_out || c3_out != 9'd3;
  wire bad_steps = steps_q == 4'd0 || steps_q > 4'd8;
  localparam [12:0] LEAK_ONE = 13'd1 << sf_arch_pkg::LEAK_FRAC;
  wire bad_leak = k_q[12:0] > LEAK_ONE || k_q[25:13] > LEAK_ONE || k_q[38:26] > LEAK_ONE || k_q[51:39] > LEAK_ONE
      || k_q[64:52] > LEAK_ONE;
  wire bad_theta = (!decodes && theta_q[23:0] == 24'd0) || theta_q[71:48] == 24'd0 || theta_q[95:72] == 24'd0;
  wire bad_mode = mode_q == 2'd3;
  wire bad_scale = exp_mul_q[16] || sigmoid_mul_q[16] || exp_shift_q[5] || sigmoid_shift_q[5];
  wire bad_config = bad_size || bad_steps || bad_leak || bad_theta || bad_mode || bad_scale;

  // ---- commands
  wire command = word_write && to_ctrl;
  wire soft_reset = command && wdata_i[sf_csr_pkg::CTRL_SOFT_RESET];
  wire start = command && wdata_i[sf_csr_pkg::CTRL_START];
  wire start_busy = start && running_q && !soft_reset;
  wire start_check = start && !start_busy;
  assign soft_reset_o = soft_reset;
  assign clear_o = command && wdata_i[sf_csr_pkg::CTRL_CLEAR];
  assign snapshot_o = command && wdata_i[sf_csr_pkg::CTRL_SNAPSHOT];
  assign running_o = running_q;

  wire bad_busy = start_busy || (word_write && to_config && running_q);
  wire bad_address = write && (!known || wstrb_i != 4'hf);
  wire bad_weight = config_write && to_weight && weight_bad;
  // A soft reset drops a beat that comes beside it.
  wire [10:0] error_set = {error_value_i && !soft_reset, error_packet_i && !soft_reset, bad_weight, bad_address, bad_busy,
                           start_check ? {bad_scale, bad_mode, bad_theta, bad_leak, bad_steps, bad_size} : 6'd0};
  wire [10:0] error_keep = soft_reset ? 11'd0 : word_write && to_error ? error_q & ~wdata_i[10:0] : error_q;
  wire [1:0] pending_keep = word_write && to_irq_pending ? irq_pending_q & ~wdata_i[1:0] : irq_pending_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      running_q <= 1'b0;
      counters_busy_q <= 1'b0;
      error_q <= 11'd0;
      irq_enable_q <= 2'd0;
      irq_pending_q <= 2'd0;
      bvalid_q <= 1'b0;
      bresp_q <= OKAY;
    end else begin
      if (start_check) running_q <= !bad_config;
      else if (soft_reset) running_q <= 1'b0;
      counters_busy_q <= counters_busy_i;
      error_q <= error_keep | error_set;
      if (word_write && to_irq_enable) irq_enable_q <= wdata_i[1:0];
      irq_pending_q <= pending_keep | {counters_busy_q && !counters_busy_i, |error_set};
      if (write) begin
        bvalid_q <= 1'b1;
        bresp_q <= bad_busy || bad_address || bad_weight || (start_check && bad_config) ? SLVERR : OKAY;
      end else if (bready_i) bvalid_q <= 1'b0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      mode_q <= 2'd0;
      steps_q <= 4'd0;
      {exp_mul_q, sigmoid_mul_q} <= 34'd0;
      {exp_shift_q, sigmoid_shift_q} <= 12'd0;
      {exp_bias_q, sigmoid_bias_q} <= 64'd0;
      n_in_q <= 45'd0;
      n_out_q <= 45'd0;
      k_q <= 65'd0;
      theta_q <= 120'd0;
      bias_q <= 14'd0;
      weight_address_q <= 18'd0;
    end else if (table_write) begin
      case (table_field)
        2'd0: n_in_q[9*table_layer+:9] <= size_w;
        2'd1: n_out_q[9*table_layer+:9] <= size_w;
        2'd2: k_q[13*table_layer+:13] <= k_w;
        default: theta_q[24*table_layer+:24] <= theta_w;
      endcase
    end else if (config_write) begin
      case (wa)
        sf_csr_pkg::MODE: mode_q <= |wdata_i[31:2] ? 2'd3 : wdata_i[1:0];
        sf_csr_pkg::STEPS: steps_q <= |wdata_i[31:4] ? 4'd15 : wdata_i[3:0];
        sf_csr_pkg::EXP_MUL: exp_mul_q <= mul_w;
        sf_csr_pkg::EXP_SHIFT: exp_shift_q <= shift_w;
        sf_csr_pkg::EXP_BIAS: exp_bias_q <= wdata_i;
        sf_csr_pkg::SIGMOID_MUL: sigmoid_mul_q <= mul_w;
        sf_csr_pkg::SIGMOID_SHIFT: sigmoid_shift_q <= shift_w;
        sf_csr_pkg::SIGMOID_BIAS: sigmoid_bias_q <= wdata_i;
        sf_csr_pkg::WEIGHT_ADDRESS: weight_address_q <= |wdata_i[31:18] ? 18'h3ffff : wdata_i[17:0];
        sf_csr_pkg::BIAS: bias_q <= bias_w;
        default: if (!weight_bad) weight_address_q <= weight_address_q + 18'd1;  // WEIGHT_DATA
      endcase
    end
  end

  // ---- read channel: one cycle for the registers and for the snapshot memory
  reg rvalid_q, counter_q, high_q;
  reg [31:0] rdata_q;
  wire read = arvalid_i && !rvalid_q;
  wire [12:0] ra = {araddr_i[12:2], 2'b00};
  wire [12:0] rtable_offset = ra - sf_csr_pkg::D1_N_IN;
  wire [2:0] rlayer = rtable_offset[6:4];
  wire [1:0] rfield = ra[3:2];
  wire [31:0] bias_r = {13'd0, bias_q[13:11], 5'd0, bias_q[10:0]};
  reg [31:0] rdata_d;
  always_comb begin
    case (ra)
      sf_csr_pkg::ID: rdata_d = sf_csr_pkg::ID_RESET;
      sf_csr_pkg::VERSION: rdata_d = sf_csr_pkg::VERSION_RESET;
      sf_csr_pkg::CONFIG: rdata_d = {sf_csr_pkg::CONFIG_RESET[31:8], 8'(LANES - 1)};
      sf_csr_pkg::ENGINE: rdata_d = {13'd0, 3'(STEPS_AT_ONCE - 1), 8'(NEURONS - 1), 8'(MACS - 1)};
      sf_csr_pkg::STATUS: rdata_d = {28'd0, |error_q, counters_busy_i, active_i, running_q};
      sf_csr_pkg::ERROR: rdata_d = {21'd0, error_q};
      sf_csr_pkg::IRQ_ENABLE: rdata_d = {30'd0, irq_enable_q};
      sf_csr_pkg::IRQ_PENDING: rdata_d = {30'd0, irq_pending_q};
      sf_csr_pkg::MODE: rdata_d = {30'd0, mode_q};
      sf_csr_pkg::STEPS: rdata_d = {28'd0, steps_q};
      sf_csr_pkg::EXP_MUL: rdata_d = {15'd0, exp_mul_q};
      sf_csr_pkg::EXP_SHIFT: rdata_d = {26'd0, exp_shift_q};
      sf_csr_pkg::EXP_BIAS: rdata_d = exp_bias_q;
      sf_csr_pkg::SIGMOID_MUL: rdata_d = {15'd0, sigmoid_mul_q};
      sf_csr_pkg::SIGMOID_SHIFT: rdata_d = {26'd0, sigmoid_shift_q};
      sf_csr_pkg::SIGMOID_BIAS: rdata_d = sigmoid_bias_q;
      sf_csr_pkg::WEIGHT_ADDRESS: rdata_d = {14'd0, weight_address_q};
      sf_csr_pkg::BIAS: rdata_d = bias_r;
      default: begin
        rdata_d = 32'd0;
        if (ra >= sf_csr_pkg::D1_N_IN && ra <= sf_csr_pkg::C3_THETA) begin
          case (rfield)
            2'd0: rdata_d = {23'd0, n_in_q[9*rlayer+:9]};
            2'd1: rdata_d = {23'd0, n_out_q[9*rlayer+:9]};
            2'd2: rdata_d = {19'd0, k_q[13*rlayer+:13]};
            default: rdata_d = {8'd0, theta_q[24*rlayer+:24]};
          endcase
        end
      end
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      rvalid_q <= 1'b0;
    end else begin
      if (read) rvalid_q <= 1'b1;
      else if (rready_i) rvalid_q <= 1'b0;
    end
  end
  always_ff @(posedge clk_i) begin
    if (read) begin
      rdata_q <= rdata_d;
      counter_q <= araddr_i[12];
      high_q <= araddr_i[2];
    end else begin
      // A response that waits must not follow the snapshot memory, which a walk may write meanwhile.
      rdata_q <= rdata_o;
      counter_q <= 1'b0;
    end
  end
  assign counter_index_o = araddr_i[11:3];
  assign arready_o = read;
  assign rvalid_o = rvalid_q;
  assign rdata_o = !counter_q ? rdata_q : high_q ? counter_i[63:32] : counter_i[31:0];
  assign rresp_o = OKAY;

  assign irq_o = |(irq_pending_q & irq_enable_q);
  assign mode_o = mode_q;
  assign steps_o = steps_q;
  assign exp_mul_o = exp_mul_q[15:0];
  assign exp_shift_o = exp_shift_q[4:0];
  assign exp_bias_o = exp_bias_q;
  assign sigmoid_mul_o = sigmoid_mul_q[15:0];
  assign sigmoid_shift_o = sigmoid_shift_q[4:0];
  assign sigmoid_bias_o = sigmoid_bias_q;
  assign n_in_o = n_in_q;
  assign n_out_o = n_out_q;
  assign k_o = k_q;
  assign theta_o = theta_q;
  assign bias_o = bias_q[12:0];
  wire unused_ok = &{1'b0, awaddr_i[1:0], araddr_i[1:0], table_offset[12:7], table_offset[3:0], rtable_offset[12:7],
                     rtable_offset[3:0]};
endmodule

`default_nettype wire
