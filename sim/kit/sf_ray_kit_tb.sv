// Self-checking bench of a vector kit's rays: programs sf_ray_top over AXI4-Lite, streams samples of rays with random bubbles,
// answers its reads of the field's memory late, and compares pixels, look-ups and counters. PASS, or the first difference and
// a failing exit status.
// Plusargs: +stalls=PERCENT (20) +seed=N (the kit's) +vcd=FILE (waveform)
`default_nettype none
`define SF_KIT_TB sf_ray_kit_tb
`ifndef SF_DUT
`define SF_DUT sf_ray_top
`endif
`ifdef SF_DUT_LANES  // the block's parameter, at most the kit's LANES
`define SF_DUT_PARAMETERS #(.LANES(`SF_DUT_LANES))
`else
`define SF_DUT_LANES LANES
`define SF_DUT_PARAMETERS
`endif

module sf_ray_kit_tb;
  `include "sf_kit_params.svh"
  `include "sf_kit_rays.svh"
  localparam integer ANSWERS = 64;       // requests that the memory keeps

  // ---- the kit
  reg [47:0] program_image[0:RAY_WRITES-1];  // {offset, data}
  reg [259:0] beats[0:RAY_BEATS-1];          // {0, wait for the ray's pixel, tuser, tlast, tdata}
  reg [127:0] memory[0:LINES-1];
  reg [383:0] pixels[0:RAYS-1];
  reg [63:0] counters[0:511];

  // ---- pins
  `include "sf_kit_pins.svh"
  reg [255:0] s_data = 256'd0;
  wire [383:0] m_data;
  wire line_arvalid, line_rready;
  reg line_arready = 1'b0, line_rvalid = 1'b0, line_rlast = 1'b0;
  wire [31:0] line_araddr;
  wire [7:0] line_arlen;
  wire [2:0] line_arsize, line_arprot;
  wire [1:0] line_arburst;
  reg [63:0] line_rdata = 64'd0;

  `SF_DUT `SF_DUT_PARAMETERS u_dut (
      `include "sf_kit_ports.svh"
      .m_axi_arvalid_o (line_arvalid),
      .m_axi_arready_i (line_arready),
      .m_axi_araddr_o  (line_araddr),
      .m_axi_arlen_o   (line_arlen),
      .m_axi_arsize_o  (line_arsize),
      .m_axi_arburst_o (line_arburst),
      .m_axi_arprot_o  (line_arprot),
      .m_axi_rvalid_i  (line_rvalid),
      .m_axi_rready_o  (line_rready),
      .m_axi_rdata_i   (line_rdata),
      .m_axi_rresp_i   (2'd0),
      .m_axi_rlast_i   (line_rlast),
      .irq_o           (irq)
  );

  // ---- verdict
  // of a ray, or of all where it is -1; name: text of up to 16 letters
  task differ(input integer ray, input [127:0] name, input [63:0] expected, input [63:0] actual);
    begin
      if (ray >= 0) $write("DIFFERENCE ray %0d ", ray);
      else $write("DIFFERENCE ");
      $display("%0s: expected %0d, actual %0d", name, expected, actual);
      fail;
    end
  endtask

  // ---- chance, register accesses, beginning
  reg [31:0] line_random;
  `include "sf_kit_bus.svh"

  // ---- samples in: a beat on offer stays until it is taken; one that ends a ray by force follows the ray's pixel
  integer sent = 0, rays_sent = 0, received = 0;
  wire [259:0] next_beat = beats[sent];
  task offer_beat;
    begin
      if (s_valid && s_ready) quiet = 0;
      if (!s_valid || s_ready) begin
        s_valid <= 1'b0;
        if (sent < RAY_BEATS && !stall(in_random) && (!next_beat[258] || received > rays_sent)) begin
          s_valid <= 1'b1;
          {s_user, s_last, s_data} <= next_beat[257:0];
          if (next_beat[256]) rays_sent = rays_sent + 1;
          sent = sent + 1;
        end
      end
    end
  endtask

  // ---- pixels out
  reg held = 1'b0;
  reg [383:0] held_pixel, want;
  task compare_pixel;
    begin
      if (received >= RAYS) differ(received, "surplus pixel", 0, 1);
      want = pixels[received];
      if (m_data[63:0] !== want[63:0]) differ(received, "red", want[63:0], m_data[63:0]);
      if (m_data[127:64] !== want[127:64]) differ(received, "green", want[127:64], m_data[127:64]);
      if (m_data[191:128] !== want[191:128]) differ(received, "blue", want[191:128], m_data[191:128]);
      if (m_data[255:192] !== want[255:192]) differ(received, "depth", want[255:192], m_data[255:192]);
      if (m_data[287:256] !== want[287:256]) differ(received, "weight sum", {32'd0, want[287:256]}, {32'd0, m_data[287:256]});
      if (m_data[319:288] !== want[319:288]) differ(received, "transmittance", {32'd0, want[319:288]}, {32'd0, m_data[319:288]});
      if (m_data[383:320] !== want[383:320]) differ(received, "samples", want[383:320], m_data[383:320]);
    end
  endtask
  task take_pixel;
    begin
      if (held && {m_valid, m_data} !== {1'b1, held_pixel}) begin
        $display("DIFFERENCE ray %0d: its pixel changed or was withdrawn while it was not taken", received);
        fail;
      end
      held = m_valid && !m_ready;
      held_pixel = m_data;
      if (m_valid && m_ready) begin
        quiet = 0;
        compare_pixel;
        received = received + 1;
      end
      m_ready <= !stall(out_random);
    end
  endtask

  // ---- the field's memory: lines in the order of the requests, each after a while
  reg [31:0] asked_line[0:ANSWERS-1];
  integer due[0:ANSWERS-1];
  integer asked = 0, answered = 0;
  reg second = 1'b0;
  reg [31:0] offset;
  wire [47:0] request = {line_araddr, line_arlen, line_arsize, line_arburst, line_arprot};
  reg held_line = 1'b0;
  reg [47:0] held_request;
  task take_request;
    begin
      if (held_line && {line_arvalid, request} !== {1'b1, held_request}) begin
        $display("DIFFERENCE a request of the memory changed or was withdrawn while it was not taken");
        fail;
      end
      held_line = line_arvalid && !line_arready;
      held_request = request;
      if (line_arvalid && line_arready) begin
        if (line_arprot !== 3'd0) differ(-1, "protection", 0, {61'd0, line_arprot});
        offset = line_araddr - MEMORY_BASE;
        if (offset[3:0] !== 4'd0 || offset / 16 >= LINES) differ(-1, "address", {32'd0, MEMORY_BASE}, {32'd0, line_araddr});
        if ({line_arlen, line_arsize, line_arburst} !== {8'd1, 3'd3, 2'd1}) differ(-1, "burst", 1, {56'd0, line_arlen});
        asked_line[asked % ANSWERS] = offset / 16;
        due[asked % ANSWERS] = cycle + 1 + {28'd0, line_random[11:8]};
        asked = asked + 1;
      end
      line_arready <= asked - answered < ANSWERS - 2 && !stall(line_random);
    end
  endtask
  task give_line;
    begin
      if (line_rvalid && line_rready) begin
        quiet = 0;
        if (second) answered = answered + 1;
        second = !second;
      end
      if (!line_rvalid || line_rready) begin
        line_rvalid <= asked != answered && (second || due[answered%ANSWERS] <= cycle);
        line_rlast <= second;
        line_rdata <= second ? memory[asked_line[answered%ANSWERS]][127:64] : memory[asked_line[answered%ANSWERS]][63:0];
      end
    end
  endtask

  // ---- counters
  task compare_counter(input [63:0] actual);
    if (actual !== counters[counter_at]) begin
      if (counter_at[5:3] != 3'd7) $write("DIFFERENCE layer %0d step %0d ", counter_at[5:3], counter_at[2:0]);
      if (counter_at[5:3] != 3'd7) $display("%0s: expected %0d, actual %0d", event_name(counter_at[8:6]), counters[counter_at], actual);
      if (counter_at[5:3] != 3'd7) fail;
      differ(-1, counter_at[0] ? "rays" : "samples", counters[counter_at], actual);
    end
  endtask

  // ---- what happens when: each phase begins when its predecessor's last register access is done
  localparam [3:0] BEGIN = 4'd0, PROGRAM = 4'd1, CLEARING = 4'd2, CLEAN = 4'd3, RAYS_CLEAN = 4'd4, RUN = 4'd5, DRAIN = 4'd6,
                   SNAPSHOT = 4'd7, COUNT_LOW = 4'd8, COUNT_HIGH = 4'd9, FIELD = 4'd10, MISSED = 4'd11, LAST = 4'd12;
  reg [3:0] phase = BEGIN;
  integer written = 0, drained = 0;
  reg [31:0] low;
  task expect_value(input [31:0] expected, input [127:0] name);
    if (value !== expected) differ(-1, name, {32'd0, expected}, {32'd0, value});
  endtask
  task go(input [3:0] next_phase, input [12:0] address);
    begin
      phase = next_phase;
      begin_read(address);
    end
  endtask
  task program_cycle;
    if (written < RAY_WRITES) begin
      begin_write(program_image[written][44:32], program_image[written][31:0]);
      written = written + 1;
    end else go(CLEARING, CSR_STATUS);
  endtask
  task run_cycle;
    begin
      offer_beat;
      take_pixel;
      if (irq !== 1'b0) begin
        $display("DIFFERENCE interrupt: the block reports an error");
        fail;
      end
      if (received == RAYS && sent == RAY_BEATS && !s_valid) drained = drained + 1;
      if (drained == 200) phase = DRAIN;
    end
  endtask
  task next_counter;
    begin
      while (counter_at != 9'd511 && !is_compared(counter_at)) counter_at = counter_at + 9'd1;
      if (counter_at == 9'd511) go(FIELD, CSR_FIELD_LOOKUPS);
      else go(COUNT_LOW, CSR_COUNTERS + {1'b0, counter_at, 3'd0});
    end
  endtask

  task advance;
    case (phase)
      BEGIN: go(PROGRAM, CSR_ID);
      PROGRAM: program_cycle;
      CLEARING: go((value & STATUS_COUNTERS) != 32'd0 ? CLEARING : CLEAN,
                   (value & STATUS_COUNTERS) != 32'd0 ? CSR_STATUS : CSR_ERROR);
      CLEAN: begin
        expect_value(32'd0, "ERROR");
        go(RAYS_CLEAN, CSR_RAY_ERROR);
      end
      RAYS_CLEAN: begin
        expect_value(32'd0, "RAY_ERROR");
        phase = RUN;
      end
      RUN: run_cycle;
      DRAIN: begin
        begin_write(CSR_CTRL, CTRL_SNAPSHOT);
        value = STATUS_COUNTERS;
        phase = SNAPSHOT;
      end
      SNAPSHOT: if ((value & STATUS_COUNTERS) != 32'd0) go(SNAPSHOT, CSR_STATUS); else next_counter;
      COUNT_LOW: begin
        low = value;
        go(COUNT_HIGH, CSR_COUNTERS + {1'b0, counter_at, 3'd4});
      end
      COUNT_HIGH: begin
        compare_counter({value, low});
        counter_at = counter_at + 9'd1;
        next_counter;
      end
      FIELD: begin
        expect_value(LOOKUPS, "look-ups");
        go(MISSED, CSR_FIELD_MISSES);
      end
      MISSED: begin
        expect_value(MISSES, "lines missed");
        go(LAST, CSR_RAY_ERROR);
      end
      default: begin
        expect_value(32'd0, "RAY_ERROR");
        $display("PASS %0d rays, %0d steps, %0d cycles, stalls %0d %%, seed %0d", RAYS, STEPS, cycle, stalls, seed);
        $finish(0);  // says nothing more
      end
    endcase
  endtask

  always @(posedge clk) begin
    cycle = cycle + 1;
    quiet = quiet + 1;
    bus_random = next_random(bus_random);
    in_random = next_random(in_random);
    out_random = next_random(out_random);
    line_random = next_random(line_random);
    if (rst_n && !bus_busy) advance;
    if (rst_n) bus_cycle;
    if (rst_n) take_request;
    if (rst_n) give_line;
    rst_n <= cycle > 4;
    if (quiet > patience) begin
      $display("DIFFERENCE no sign of life: %0d of %0d writes, %0d of %0d beats in, %0d of %0d pixels out", written, RAY_WRITES,
               sent, RAY_BEATS, received, RAYS);
      fail;
    end
  end

  initial begin
    begin_run;
    line_random = seed == 32'hd1b54a32 ? 32'd1 : seed ^ 32'hd1b54a32;
    $readmemh("ray_program.hex", program_image);
    $readmemh("rays.hex", beats);
    $readmemh("memory.hex", memory);
    $readmemh("expected_pixels.hex", pixels);
    $readmemh("expected_ray_counters.hex", counters);
  end
endmodule

`default_nettype wire
