// A bench of one's own beside the golden model: random samples into the accelerator, every accepted beat into the
// model, results and tap beats compared with what it says. The block is programmed from the program.hex of a vector kit
// of the same scene. How it is built and run: docs/kit.md.
// Plusargs: +scene=FILE +program=FILE +samples=N

module golden_tb;
  localparam int DEPTH = 64;  // samples between input and result, at most
  localparam int WRITES_MAX = 65536;
  localparam int LANES = 256;  // of the golden model, however many the block has
  localparam int D1 = 0, D2 = 1, C1 = 2, C2 = 3, C3 = 4;

  // ---- the golden model, and what it said of the last samples
  chandle golden;
  int steps;
  longint unsigned result[0:2*DEPTH-1];
  bit [LANES-1:0] spikes[0:5*8*DEPTH-1], rows[0:5*8*DEPTH-1];
  bit [24*LANES-1:0] membranes[0:5*8*DEPTH-1];
  int modelled = 0;  // samples

  function automatic int at(int sample, int layer, int step);
    return ((sample % DEPTH) * 5 + layer) * 8 + step;
  endfunction

  task automatic remember;
    for (int layer = D1; layer <= C3; layer++)
      for (int step = 0; step < steps; step++) begin
        sf_golden_dpi::sf_golden_spikes(golden, layer, step, spikes[at(modelled, layer, step)]);
        sf_golden_dpi::sf_golden_rows(golden, layer, step, rows[at(modelled, layer, step)]);
        for (int n = 0; n < sf_golden_dpi::sf_golden_outputs(golden, layer); n++)
          membranes[at(modelled, layer, step)][24*n+:24] =
              24'(sf_golden_dpi::sf_golden_membrane(golden, layer, step, n));
      end
    result[2*(modelled%DEPTH)] =
        {sf_golden_dpi::sf_golden_colour(golden, 0), sf_golden_dpi::sf_golden_density(golden)};
    result[2*(modelled%DEPTH)+1] =
        {sf_golden_dpi::sf_golden_colour(golden, 2), sf_golden_dpi::sf_golden_colour(golden, 1)};
    modelled++;
  endtask

  // ---- pins
  logic clk = 0, rst_n = 0, awvalid = 0, wvalid = 0, s_valid = 0, s_user = 0, s_last = 0;
  logic [12:0] awaddr = 0;
  logic [31:0] wdata = 0;
  logic [63:0] s_data = 0;
  wire awready, wready, s_ready, m_valid, m_last, irq, tap_valid;
  wire [63:0] m_data;
  wire [2:0] tap_layer, tap_step;
  wire [sf_arch_pkg::LANES-1:0] tap_spikes, tap_rows;
  wire [24*sf_arch_pkg::LANES-1:0] tap_membrane;
  always #5 clk = !clk;

  sf_top u_dut (
      .clk_i(clk), .rst_ni(rst_n),
      .s_axil_awvalid_i(awvalid), .s_axil_awready_o(awready), .s_axil_awaddr_i(awaddr),
      .s_axil_wvalid_i(wvalid), .s_axil_wready_o(wready), .s_axil_wdata_i(wdata), .s_axil_wstrb_i(4'hf),
      .s_axil_bvalid_o(), .s_axil_bready_i(1'b1), .s_axil_bresp_o(),
      .s_axil_arvalid_i(1'b0), .s_axil_arready_o(), .s_axil_araddr_i(13'd0),
      .s_axil_rvalid_o(), .s_axil_rready_i(1'b1), .s_axil_rdata_o(), .s_axil_rresp_o(),
      .s_axis_tvalid_i(s_valid), .s_axis_tready_o(s_ready), .s_axis_tdata_i(s_data), .s_axis_tuser_i(s_user),
      .s_axis_tlast_i(s_last),
      .m_axis_tvalid_o(m_valid), .m_axis_tready_i(1'b1), .m_axis_tdata_o(m_data), .m_axis_tlast_o(m_last),
      .irq_o(irq), .tap_valid_o(tap_valid), .tap_layer_o(tap_layer), .tap_step_o(tap_step),
      .tap_spikes_o(tap_spikes), .tap_rows_o(tap_rows), .tap_membrane_o(tap_membrane)
  );

  task automatic differ(int sample, int layer, int step, string what);
    $display("DIFFERENCE sample %0d layer %0d step %0d: %s", sample, layer, step, what);
    $fatal(1, "the block differs from the golden model");
  endtask

  // ---- programming: one word at a time
  logic [47:0] image[0:WRITES_MAX-1];
  int writes = 0, written = 0;
  task automatic program_cycle;
    if (awvalid && awready) written++;
    awvalid <= written < writes && !(awvalid && awready);
    wvalid <= written < writes && !(awvalid && awready);
    {awaddr, wdata} <= image[written][44:0];
  endtask

  // ---- random samples; a new ray now and then
  int samples = 100, sent = 0, beat = 0, features, directions;  // of a sample, of a ray
  bit first = 1;
  function automatic bit [15:0] draw;
    return 16'(int'($urandom_range(4094)) - 2047);
  endfunction
  // A beat, its padding 0.
  function automatic bit [63:0] draw_beat(int from, int n);
    bit [63:0] data = 0;
    for (int i = 0; i < 4; i++) if (from + i < n) data[16*i+:16] = draw();
    return data;
  endfunction
  task automatic offer;
    int of_direction;
    int of_sample;
    of_direction = first ? (directions + 3) / 4 : 0;
    of_sample = of_direction + (features + 3) / 4;
    s_valid <= sent < samples;
    if (sent < samples) begin
      s_data <= beat < of_direction ? draw_beat(4 * beat, directions) : draw_beat(4 * (beat - of_direction), features);
      s_user <= first && beat == 0;
      s_last <= beat == of_sample - 1;
      beat++;
      if (beat == of_sample) begin
        beat = 0;
        sent++;
        first = features == 0 || $urandom_range(5) == 0;
      end
    end
  endtask

  // ---- monitors
  int received = 0, tapped[0:4];
  task automatic accept;
    int whole;
    whole = sf_golden_dpi::sf_golden_beat(golden, s_data, 32'(s_user), 32'(s_last));
    if (whole < 0) $fatal(1, "golden model: %s", sf_golden_dpi::sf_golden_error(golden));
    if (whole == 1) remember;
  endtask
  task automatic take_result;
    if (received == 2 * modelled) differ(received / 2, D2, 0, "surplus result");
    if (m_last !== (received % 2 == 1)) differ(received / 2, D2, 0, "tlast");
    if (m_data !== result[received%(2*DEPTH)]) differ(received / 2, m_last ? C3 : D2, steps - 1, "result");
    received++;
  endtask
  task automatic take_tap;
    int layer, sample, step, place;
    bit spiking;
    layer = 32'(tap_layer);
    if (tap_layer > 3'(C3) || $isunknown(tap_layer)) differ(0, layer, 0, "no such layer");
    spiking = layer == D1 || layer == C1 || layer == C2;
    sample = spiking ? tapped[layer] / steps : tapped[layer];
    step = spiking ? tapped[layer] % steps : 0;
    place = at(sample, layer, step);
    if (sample >= modelled) differ(sample, layer, step, "surplus tap beat");
    if (tap_step !== 3'(step)) differ(sample, layer, step, $sformatf("step %0d", tap_step));
    if (!(spiking && layer != C2) && tap_rows !== rows[place]) differ(sample, layer, step, "rows");
    if (spiking && tap_spikes !== spikes[place]) differ(sample, layer, step, "spikes");
    for (int n = 0; spiking && n < sf_golden_dpi::sf_golden_outputs(golden, layer); n++)
      if (tap_membrane[24*n+:24] !== membranes[place][24*n+:24])
        differ(sample, layer, step, $sformatf("membrane of neuron %0d", n));
    tapped[layer]++;
  endtask

  // Of a net without a density, D1 and D2 have no outputs and no beats.
  task automatic expect_all_taps;
    int beats;
    for (int layer = D1; layer <= C3; layer++) begin
      beats = layer == D2 || layer == C3 ? samples : steps * samples;
      if (sf_golden_dpi::sf_golden_outputs(golden, layer) == 0) beats = 0;
      if (tapped[layer] != beats)
        differ(samples, layer, 0, $sformatf("%0d tap beats, expected %0d", tapped[layer], beats));
    end
  endtask

  int cycle = 0, drained = 0;
  always @(posedge clk) begin
    cycle++;
    rst_n <= cycle > 4;
    if (rst_n && written < writes) program_cycle;
    if (rst_n && written == writes) begin
      awvalid <= 0;
      wvalid <= 0;
      if (s_valid && s_ready) accept;
      if (!s_valid || s_ready) offer;
      if (m_valid !== 1'b0) take_result;
      if (tap_valid !== 1'b0) take_tap;
      if (irq !== 1'b0) differ(received / 2, D1, 0, "interrupt");
      if (received == 2 * samples) drained++;
      if (drained == 16) begin  // what comes too late, or is too much, has come
        expect_all_taps;
        $display("PASS %0d random samples of %0d rays beside the golden model, %0d cycles", samples,
                 sf_golden_dpi::sf_golden_counter(golden, 57), cycle);
        sf_golden_dpi::sf_golden_close(golden);
        $finish;
      end
    end
    if (cycle > 100000 + 10000 * samples) differ(received / 2, D1, 0, "no sign of life");
  end

  string scene, program_file;
  initial begin
    if ($value$plusargs("scene=%s", scene) == 0) $fatal(1, "+scene=FILE is missing");
    if ($value$plusargs("program=%s", program_file) == 0) $fatal(1, "+program=FILE is missing");
    void'($value$plusargs("samples=%d", samples));
    golden = sf_golden_dpi::sf_golden_open(scene, 0);
    if (sf_golden_dpi::sf_golden_error(golden) != "") $fatal(1, "%s", sf_golden_dpi::sf_golden_error(golden));
    steps = sf_golden_dpi::sf_golden_steps(golden);
    features = sf_golden_dpi::sf_golden_inputs(golden, D1);
    directions = sf_golden_dpi::sf_golden_inputs(golden, C1);  // of a decoder all inputs, with every sample
    if (features > 0) directions = directions - (sf_golden_dpi::sf_golden_outputs(golden, D2) - 1);
    for (int i = 0; i < 5; i++) tapped[i] = 0;
    for (int i = 0; i < WRITES_MAX; i++) image[i] = 48'hffff_0000_0000;  // no register: the end
    $readmemh(program_file, image);
    while (writes < WRITES_MAX && image[writes][47:32] != 16'hffff) writes++;
  end
endmodule
