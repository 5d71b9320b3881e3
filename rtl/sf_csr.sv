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
    // programming: it changes only while nothing runs
    output wire [  1:0] mode_o,
    output wire [  3:0] steps_o,
    output wire [ 15:0] exp_mul_o,
    output wire [  4:0] exp_shift_o,
    output wire [ 31:0] exp_bias_o,
    output wire [ 15:0] sigmoid_mul_o,
    output wire [  4:0] sigmoid_shift_o,
    output wire [ 31:0] sigmoid_bias_o,
    output wire [  8:0] d1_in_o,        // inputs of a layer
    output wire [  8:0] c1_in_o,
    output wire [  8:0] d1_out_o,       // neurons of a layer; 0: the net has no D1 and D2
    output wire [  8:0] d2_out_o,
    output wire [  8:0] c1_out_o,
    output wire [  8:0] c2_out_o,
    output wire [  8:0] c3_out_o,
    output wire [ 12:0] d1_k_o,         // leaks
    output wire [ 12:0] d2_k_o,
    output wire [ 12:0] c1_k_o,
    output wire [ 12:0] c2_k_o,
    output wire [ 12:0] c3_k_o,
    output wire [ 23:0] d1_theta_o,     // thresholds
    output wire [ 23:0] c1_theta_o,
    output wire [ 23:0] c2_theta_o,
    output wire [ 10:0] c1_bias_o,      // value that C1's biases are multiplied by; 0: none
    output wire         c2_bias_o,      // the layer has biases
    output wire         c3_bias_o,
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

  localparam LAYERS = sf_arch_pkg::LAYERS;

  reg running_q, counters_busy_q;
  reg [10:0] error_q;
  reg [1:0] irq_enable_q, irq_pending_q, stream_error_q;  // the last: value, packet
  reg [2:0] mode_q;
  reg [3:0] steps_q;
  reg [16:0] exp_mul_q, sigmoid_mul_q;
  reg [5:0] exp_shift_q, sigmoid_shift_q;
  reg [31:0] exp_bias_q, sigmoid_bias_q;
  reg [8:0] n_in_q[0:LAYERS-1];
  reg [8:0] n_out_q[0:LAYERS-1];
  reg [12:0] k_q[0:LAYERS-1];
  reg [23:0] theta_q[0:LAYERS-1];
  reg [13:0] bias_q;  // illegal, C3, C2, value of C1's
  reg [17:0] weight_address_q;

  // ---- a write, address and data together: taken, looked at, done, answered, a cycle each
  reg taken_q, done_q, bvalid_q;
  reg [1:0] bresp_q;
  reg [12:0] wa_q;
  reg [31:0] wdata_q;
  reg whole_q;  // every byte of the word is written
  wire take = awvalid_i && wvalid_i && !taken_q && !done_q && !bvalid_q;
  assign awready_o = take;
  assign wready_o = take;
  assign bvalid_o = bvalid_q;
  assign bresp_o = bresp_q;
  always_ff @(posedge clk_i) begin
    if (take) begin
      wa_q <= {awaddr_i[12:2], 2'b00};
      wdata_q <= wdata_i;
      whole_q <= wstrb_i == 4'hf;
    end
  end

  // Looked at: which register it is, and whether it is in its range.
  wire of_table = wa_q >= sf_csr_pkg::D1_N_IN && wa_q <= sf_csr_pkg::C3_THETA;
  wire of_config = wa_q >= sf_csr_pkg::MODE && wa_q <= sf_csr_pkg::BIAS;
  wire of_ctrl = wa_q == sf_csr_pkg::CTRL;
  wire of_error = wa_q == sf_csr_pkg::ERROR;
  wire of_irq_enable = wa_q == sf_csr_pkg::IRQ_ENABLE;
  wire of_irq_pending = wa_q == sf_csr_pkg::IRQ_PENDING;
  wire [12:0] table_offset = wa_q - sf_csr_pkg::D1_N_IN;
  reg to_table_q, to_config_q, to_error_q, to_irq_enable_q, to_irq_pending_q, to_weight_q, known_q;
  reg start_q, soft_reset_q, clear_q, snapshot_q;  // commands
  reg [2:0] table_layer_q;
  wire looks_at_command = taken_q && whole_q && of_ctrl;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {start_q, soft_reset_q, clear_q, snapshot_q} <= 4'd0;
    else begin
      start_q <= looks_at_command && wdata_q[sf_csr_pkg::CTRL_START];
      soft_reset_q <= looks_at_command && wdata_q[sf_csr_pkg::CTRL_SOFT_RESET];
      clear_q <= looks_at_command && wdata_q[sf_csr_pkg::CTRL_CLEAR];
      snapshot_q <= looks_at_command && wdata_q[sf_csr_pkg::CTRL_SNAPSHOT];
    end
  end
  always_ff @(posedge clk_i) begin
    to_table_q <= of_table;
    to_config_q <= of_config;
    to_error_q <= of_error;
    to_irq_enable_q <= of_irq_enable;
    to_irq_pending_q <= of_irq_pending;
    to_weight_q <= wa_q == sf_csr_pkg::WEIGHT_DATA;
    known_q <= of_config || of_ctrl || of_error || of_irq_enable || of_irq_pending;
    table_layer_q <= table_offset[6:4];
  end

  // Values that do not fit are stored as an illegal value, so that the check at start sees them.
  wire [8:0] size_w = |wdata_q[31:9] ? 9'h1ff : wdata_q[8:0];
  wire [12:0] k_w = |wdata_q[31:13] ? 13'h1fff : wdata_q[12:0];
  wire [23:0] theta_w = |wdata_q[31:23] ? 24'd0 : wdata_q[23:0];
  wire [13:0] bias_w = {|{wdata_q[31:18], wdata_q[15:11]}, wdata_q[17:16], wdata_q[10:0]};
  wire [16:0] mul_w = |wdata_q[31:16] ? 17'h10000 : wdata_q[16:0];
  wire [5:0] shift_w = |wdata_q[31:5] ? 6'h20 : wdata_q[5:0];

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
  wire minus_128 = wdata_q[7:0] == 8'h80 || wdata_q[15:8] == 8'h80 || wdata_q[23:16] == 8'h80 || wdata_q[31:24] == 8'h80;
  reg weight_bad_q;
  always_ff @(posedge clk_i)
    weight_bad_q <= wlayer > sf_op_pkg::C3 || (wnarrow && wword > 6'd3) || (!wnarrow && {1'b0, wword} >= 7'(LANES / 4))
        || wrow_bad || minus_128;

  // ---- check at start, of a programming that has stood for two cycles at the least
  wire [8:0] d1_in = n_in_q[sf_op_pkg::D1], d1_out = n_out_q[sf_op_pkg::D1];
  wire [8:0] d2_in = n_in_q[sf_op_pkg::D2], d2_out = n_out_q[sf_op_pkg::D2];
  wire [8:0] c1_in = n_in_q[sf_op_pkg::C1], c1_out = n_out_q[sf_op_pkg::C1];
  wire [8:0] c2_in = n_in_q[sf_op_pkg::C2], c2_out = n_out_q[sf_op_pkg::C2];
  wire [8:0] c3_in = n_in_q[sf_op_pkg::C3], c3_out = n_out_q[sf_op_pkg::C3];
  wire [8:0] n_h = d2_out - 9'd1;
  wire decodes = d1_out == 9'd0;
  wire bad_density = d1_in == 9'd0 || d1_in > 9'd32 || d1_out > 9'(LANES) || d2_in != d1_out || d2_out == 9'd0
      || d2_out > 9'd16 || c1_in < n_h || c1_in > n_h + 9'd16;
  wire bad_decoder = d1_in != 9'd0 || d2_in != 9'd0 || d2_out != 9'd0 || c1_in > 9'(sf_arch_pkg::DIR_MAX);
  wire bad_size = (decodes ? bad_decoder : bad_density) || bias_q[13] || c1_in == 9'd0 || c1_out == 9'd0 || c1_out > 9'(LANES)
      || c2_in != c1_out || c2_out == 9'd0 || c2_out > 9'(LANES) || c3_in != c2_out || c3_out != 9'd3;
  wire bad_steps = steps_q == 4'd0 || steps_q > 4'd8;
  localparam [12:0] LEAK_ONE = 13'd1 << sf_arch_pkg::LEAK_FRAC;
  wire bad_leak = k_q[sf_op_pkg::D1] > LEAK_ONE || k_q[sf_op_pkg::D2] > LEAK_ONE || k_q[sf_op_pkg::C1] > LEAK_ONE
      || k_q[sf_op_pkg::C2] > LEAK_ONE || k_q[sf_op_pkg::C3] > LEAK_ONE;
  wire bad_theta = (!decodes && theta_q[sf_op_pkg::D1] == 24'd0) || theta_q[sf_op_pkg::C1] == 24'd0
      || theta_q[sf_op_pkg::C2] == 24'd0;
  // A membrane at its upper rail goes on firing, as it would without the rail.
  wire bad_radix = mode_q == {1'b0, sf_op_pkg::RADIX} && ((!decodes && |theta_q[sf_op_pkg::D1][23:22])
      || |theta_q[sf_op_pkg::C1][23:22] || |theta_q[sf_op_pkg::C2][23:22]);
  wire bad_mode = mode_q[2];
  wire bad_scale = exp_mul_q[16] || sigmoid_mul_q[16] || exp_shift_q[5] || sigmoid_shift_q[5];
  reg [5:0] bad_q;
  always_ff @(posedge clk_i) bad_q <= {bad_scale, bad_mode, bad_theta || bad_radix, bad_leak, bad_steps, bad_size};

  // ---- done
  wire word_write = done_q && whole_q;
  wire config_write = word_write && to_config_q && !running_q;
  wire table_write = config_write && to_table_q;
  wire weight_write = config_write && to_weight_q;
  wire start_busy = start_q && running_q && !soft_reset_q;
  wire start_check = start_q && !start_busy;
  wire bad_busy = start_busy || (word_write && to_config_q && running_q);
  wire bad_address = done_q && (!known_q || !whole_q);
  wire bad_weight = weight_write && weight_bad_q;
  wire bad_config = start_check && bad_q != 6'd0;
  assign soft_reset_o = soft_reset_q;
  assign clear_o = clear_q;
  assign snapshot_o = snapshot_q;
  assign running_o = running_q;

  // A soft reset drops a beat that comes beside it, and one a cycle before.
  wire [10:0] error_set = {stream_error_q & {2{!soft_reset_q}}, bad_weight, bad_address, bad_busy, start_check ? bad_q : 6'd0};
  wire [10:0] error_keep = soft_reset_q ? 11'd0 : word_write && to_error_q ? error_q & ~wdata_q[10:0] : error_q;
  wire [1:0] pending_keep = word_write && to_irq_pending_q ? irq_pending_q & ~wdata_q[1:0] : irq_pending_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {taken_q, done_q} <= 2'd0;
      running_q <= 1'b0;
      counters_busy_q <= 1'b0;
      stream_error_q <= 2'd0;
      error_q <= 11'd0;
      irq_enable_q <= 2'd0;
      irq_pending_q <= 2'd0;
      bvalid_q <= 1'b0;
      bresp_q <= OKAY;
    end else begin
      taken_q <= take;
      done_q <= taken_q;
      if (start_check) running_q <= !bad_config;
      else if (soft_reset_q) running_q <= 1'b0;
      counters_busy_q <= counters_busy_i;
      stream_error_q <= {error_value_i, error_packet_i} & {2{!soft_reset_q}};
      error_q <= error_keep | error_set;
      if (word_write && to_irq_enable_q) irq_enable_q <= wdata_q[1:0];
      irq_pending_q <= pending_keep | {counters_busy_q && !counters_busy_i, |error_set};
      if (done_q) begin
        bvalid_q <= 1'b1;
        bresp_q <= bad_busy || bad_address || bad_weight || bad_config ? SLVERR : OKAY;
      end else if (bready_i) bvalid_q <= 1'b0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      mode_q <= 3'd0;
      steps_q <= 4'd0;
      {exp_mul_q, sigmoid_mul_q} <= 34'd0;
      {exp_shift_q, sigmoid_shift_q} <= 12'd0;
      {exp_bias_q, sigmoid_bias_q} <= 64'd0;
      bias_q <= 14'd0;
      weight_address_q <= 18'd0;
    end else if (config_write && !to_table_q) begin
      case (wa_q)
        sf_csr_pkg::MODE: mode_q <= |wdata_q[31:2] ? 3'd4 : wdata_q[2:0];
        sf_csr_pkg::STEPS: steps_q <= |wdata_q[31:4] ? 4'd15 : wdata_q[3:0];
        sf_csr_pkg::EXP_MUL: exp_mul_q <= mul_w;
        sf_csr_pkg::EXP_SHIFT: exp_shift_q <= shift_w;
        sf_csr_pkg::EXP_BIAS: exp_bias_q <= wdata_q;
        sf_csr_pkg::SIGMOID_MUL: sigmoid_mul_q <= mul_w;
        sf_csr_pkg::SIGMOID_SHIFT: sigmoid_shift_q <= shift_w;
        sf_csr_pkg::SIGMOID_BIAS: sigmoid_bias_q <= wdata_q;
        sf_csr_pkg::WEIGHT_ADDRESS: weight_address_q <= |wdata_q[31:18] ? 18'h3ffff : wdata_q[17:0];
        sf_csr_pkg::BIAS: bias_q <= bias_w;
        default: if (!weight_bad_q) weight_address_q <= weight_address_q + 18'd1;  // WEIGHT_DATA
      endcase
    end
  end
  genvar l;
  generate
    for (l = 0; l < LAYERS; l = l + 1) begin : g_layer
      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          {n_in_q[l], n_out_q[l]} <= 18'd0;
          k_q[l] <= 13'd0;
          theta_q[l] <= 24'd0;
        end else if (table_write && table_layer_q == 3'(l)) begin
          case (wa_q[3:2])
            2'd0: n_in_q[l] <= size_w;
            2'd1: n_out_q[l] <= size_w;
            2'd2: k_q[l] <= k_w;
            default: theta_q[l] <= theta_w;
          endcase
        end
      end
    end
  endgenerate

  // The weights reach their memory a cycle after the write is done.
  reg we_q;
  reg [17:0] waddress_q;
  reg [31:0] wweights_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) we_q <= 1'b0;
    else we_q <= weight_write && !weight_bad_q;
  end
  always_ff @(posedge clk_i) begin
    waddress_q <= weight_address_q;
    wweights_q <= wdata_q;
  end
  assign we_o = we_q;
  assign {wlayer_o, wrow_o, wword_o} = waddress_q;
  assign wweights_o = wweights_q;

  // ---- a read: taken; a cycle for the registers and for the snapshot memory; answered
  reg read_q, rvalid_q, counter_q, high_q;
  reg [12:0] ra_q;
  reg [31:0] rdata_q;
  wire read = arvalid_i && !read_q && !rvalid_q;
  wire [12:0] rtable_offset = ra_q - sf_csr_pkg::D1_N_IN;
  wire [31:0] bias_r = {13'd0, bias_q[13:11], 5'd0, bias_q[10:0]};
  wire [2:0] rlayer = rtable_offset[6:4];
  wire [31:0] table_r = ra_q[3:2] == 2'd0 ? {23'd0, n_in_q[rlayer]}
                      : ra_q[3:2] == 2'd1 ? {23'd0, n_out_q[rlayer]}
                      : ra_q[3:2] == 2'd2 ? {19'd0, k_q[rlayer]} : {8'd0, theta_q[rlayer]};
  reg [31:0] rdata_d;
  always_comb begin
    case (ra_q)
      sf_csr_pkg::ID: rdata_d = sf_csr_pkg::ID_RESET;
      sf_csr_pkg::VERSION: rdata_d = sf_csr_pkg::VERSION_RESET;
      sf_csr_pkg::CONFIG: rdata_d = {sf_csr_pkg::CONFIG_RESET[31:8], 8'(LANES - 1)};
      sf_csr_pkg::ENGINE: rdata_d = {13'd0, 3'(STEPS_AT_ONCE - 1), 8'(NEURONS - 1), 8'(MACS - 1)};
      sf_csr_pkg::STATUS: rdata_d = {28'd0, |error_q, counters_busy_i, active_i, running_q};
      sf_csr_pkg::ERROR: rdata_d = {21'd0, error_q};
      sf_csr_pkg::IRQ_ENABLE: rdata_d = {30'd0, irq_enable_q};
      sf_csr_pkg::IRQ_PENDING: rdata_d = {30'd0, irq_pending_q};
      sf_csr_pkg::MODE: rdata_d = {29'd0, mode_q};
      sf_csr_pkg::STEPS: rdata_d = {28'd0, steps_q};
      sf_csr_pkg::EXP_MUL: rdata_d = {15'd0, exp_mul_q};
      sf_csr_pkg::EXP_SHIFT: rdata_d = {26'd0, exp_shift_q};
      sf_csr_pkg::EXP_BIAS: rdata_d = exp_bias_q;
      sf_csr_pkg::SIGMOID_MUL: rdata_d = {15'd0, sigmoid_mul_q};
      sf_csr_pkg::SIGMOID_SHIFT: rdata_d = {26'd0, sigmoid_shift_q};
      sf_csr_pkg::SIGMOID_BIAS: rdata_d = sigmoid_bias_q;
      sf_csr_pkg::WEIGHT_ADDRESS: rdata_d = {14'd0, weight_address_q};
      sf_csr_pkg::BIAS: rdata_d = bias_r;
      default: rdata_d = ra_q >= sf_csr_pkg::D1_N_IN && ra_q <= sf_csr_pkg::C3_THETA ? table_r : 32'd0;
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) {read_q, rvalid_q} <= 2'd0;
    else begin
      read_q <= read;
      if (read_q) rvalid_q <= 1'b1;
      else if (rready_i) rvalid_q <= 1'b0;
    end
  end
  always_ff @(posedge clk_i) begin
    if (read) ra_q <= {araddr_i[12:2], 2'b00};
    if (read_q) begin
      rdata_q <= rdata_d;
      counter_q <= ra_q[12];
      high_q <= ra_q[2];
    end else begin
      // A response that waits must not follow the snapshot memory, which a walk may write meanwhile.
      rdata_q <= rdata_o;
      counter_q <= 1'b0;
    end
  end
  assign counter_index_o = ra_q[11:3];
  assign arready_o = read;
  assign rvalid_o = rvalid_q;
  assign rdata_o = !counter_q ? rdata_q : high_q ? counter_i[63:32] : counter_i[31:0];
  assign rresp_o = OKAY;

  assign irq_o = |(irq_pending_q & irq_enable_q);
  assign mode_o = mode_q[1:0];
  assign steps_o = steps_q;
  assign exp_mul_o = exp_mul_q[15:0];
  assign exp_shift_o = exp_shift_q[4:0];
  assign exp_bias_o = exp_bias_q;
  assign sigmoid_mul_o = sigmoid_mul_q[15:0];
  assign sigmoid_shift_o = sigmoid_shift_q[4:0];
  assign sigmoid_bias_o = sigmoid_bias_q;
  assign d1_in_o = d1_in;
  assign c1_in_o = c1_in;
  assign d1_out_o = d1_out;
  assign d2_out_o = d2_out;
  assign c1_out_o = c1_out;
  assign c2_out_o = c2_out;
  assign c3_out_o = c3_out;
  assign d1_k_o = k_q[sf_op_pkg::D1];
  assign d2_k_o = k_q[sf_op_pkg::D2];
  assign c1_k_o = k_q[sf_op_pkg::C1];
  assign c2_k_o = k_q[sf_op_pkg::C2];
  assign c3_k_o = k_q[sf_op_pkg::C3];
  assign d1_theta_o = theta_q[sf_op_pkg::D1];
  assign c1_theta_o = theta_q[sf_op_pkg::C1];
  assign c2_theta_o = theta_q[sf_op_pkg::C2];
  assign {c3_bias_o, c2_bias_o, c1_bias_o} = bias_q[12:0];
  wire unused_ok = &{1'b0, awaddr_i[1:0], araddr_i[1:0], table_offset[12:7], table_offset[3:0], rtable_offset[12:7],
                     rtable_offset[3:0]};
endmodule

`default_nettype wire
