// Self-checking bench of a vector kit: programs the block over AXI4-Lite, streams the samples with random bubbles and
// back-pressure, compares results, tap beats and counters. PASS, or the first difference and a failing exit status.
// Plusargs: +stalls=PERCENT (20) +seed=N (the kit's) +notap (the block shows no tap beats) +vcd=FILE (waveform)
`default_nettype none
`define SF_KIT_TB sf_kit_tb
`ifndef SF_DUT
`define SF_DUT sf_top
`endif
`ifdef SF_DUT_LANES  // the block's parameter, at most the kit's LANES
`define SF_DUT_PARAMETERS #(.LANES(`SF_DUT_LANES))
`else
`define SF_DUT_LANES LANES
`define SF_DUT_PARAMETERS
`endif

module sf_kit_tb;
  `include "sf_kit_params.svh"
  localparam integer D1 = 0, D2 = 1, C1 = 2, C2 = 3, C3 = 4;
  localparam integer STEP_BEATS = SAMPLES * STEPS;

  // ---- the kit
  reg [47:0] program_image[0:WRITES-1];  // {offset, data}
  reg [8*LANES-1:0] weights[0:WEIGHT_ROWS-1];
  reg [67:0] stimulus[0:BEATS-1];  // {0, 0, tuser, tlast, tdata}
  reg [63:0] outputs[0:2*SAMPLES-1];
  reg [LANES-1:0] spikes_d1[0:STEP_BEATS-1], spikes_c1[0:STEP_BEATS-1], spikes_c2[0:STEP_BEATS-1];
  reg [24*LANES-1:0] membranes_d1[0:STEP_BEATS-1], membranes_c1[0:STEP_BEATS-1], membranes_c2[0:STEP_BEATS-1];
  reg [LANES-1:0] rows_d2[0:SAMPLES-1], rows_c2[0:STEP_BEATS-1], rows_c3[0:SAMPLES-1];
  reg [63:0] counters[0:511];

  // ---- pins
  `include "sf_kit_pins.svh"
  reg [63:0] s_data = 64'd0;
  wire m_last;
  wire [63:0] m_data;
  wire tap_valid;
  wire [2:0] tap_layer, tap_step;
  wire [LANES-1:0] tap_spikes, tap_rows;
  wire [24*LANES-1:0] tap_membrane;

  `SF_DUT `SF_DUT_PARAMETERS u_dut (
      `include "sf_kit_ports.svh"
      .m_axis_tlast_o  (m_last),
      .irq_o           (irq),
      .tap_valid_o     (tap_valid),
      .tap_layer_o     (tap_layer),
      .tap_step_o      (tap_step),
      .tap_spikes_o    (tap_spikes),
      .tap_rows_o      (tap_rows),
      .tap_membrane_o  (tap_membrane)
  );

  // ---- verdict
  reg with_tap = 1'b1;

  // layer, step, neuron: -1 where they do not apply. wire_name: text of up to 16 letters
  task differ(input integer sample, input integer layer, input integer step, input integer neuron,
              input [127:0] wire_name, input signed [63:0] expected, input signed [63:0] actual);
    reg [15:0] layer_name;
    begin
      case (layer)
        D1: layer_name = "D1";
        D2: layer_name = "D2";
        C1: layer_name = "C1";
        C2: layer_name = "C2";
        default: layer_name = "C3";
      endcase
      if (sample >= 0) $write("DIFFERENCE sample %0d ", sample);
      else $write("DIFFERENCE ");
      if (layer >= 0) $write("layer %0s step %0d ", layer_name, step);
      if (neuron >= 0) $write("neuron %0d ", neuron);
      $display("%0s: expected %0d, actual %0d", wire_name, expected, actual);
      fail;
    end
  endtask

  // ---- chance, register accesses, beginning
  `include "sf_kit_bus.svh"

  // ---- samples in: a beat on offer stays until it is taken
  integer sent = 0;
  task offer_beat;
    begin
      if (s_valid && s_ready) quiet = 0;
      if (!s_valid || s_ready) begin
        s_valid <= sent < BEATS && !stall(in_random);
        if (sent < BEATS && !stall(in_random)) begin
          {s_user, s_last, s_data} <= stimulus[sent][65:0];
          sent = sent + 1;
        end
      end
    end
  endtask

  // ---- results out
  integer received = 0;
  reg held = 1'b0, shy = 1'b0;  // shy: ready for the next beat only after it was seen
  reg [64:0] held_beat;
  wire [63:0] expected_output = outputs[received];
  task compare_output;
    integer sample;
    begin
      sample = received / 2;
      if (received >= 2 * SAMPLES) differ(sample, -1, -1, -1, "surplus result", 0, 1);
      if (m_last !== received[0]) differ(sample, -1, -1, -1, "tlast", {63'd0, received[0]}, {63'd0, m_last});
      if (m_data[31:0] !== expected_output[31:0])
        differ(sample, received[0] ? C3 : D2, STEPS - 1, received[0] ? 1 : 0, received[0] ? "colour" : "density",
               {32'd0, expected_output[31:0]}, {32'd0, m_data[31:0]});
      if (m_data[63:32] !== expected_output[63:32])
        differ(sample, C3, STEPS - 1, received[0] ? 2 : 0, "colour", {32'd0, expected_output[63:32]},
               {32'd0, m_data[63:32]});
    end
  endtask
  task take_output;
    begin
      if (held && {m_valid, m_last, m_data} !== {1'b1, held_beat}) begin
        $display("DIFFERENCE result %0d: changed or withdrawn while it was not taken", received / 2);
        fail;
      end
      held = m_valid && !m_ready;
      held_beat = {m_last, m_data};
      if (m_valid && m_ready) begin
        quiet = 0;
        compare_output;
        received = received + 1;
        shy = stall({out_random[15:0], out_random[31:16]});
      end
      m_ready <= !stall(out_random) && (held || !shy);
    end
  endtask

  // ---- tap: of one layer the beats come by sample, then step; layers are free among each other
  integer tapped[0:4];
  reg [LANES-1:0] want_spikes, want_rows;
  reg [24*LANES-1:0] want_membranes, has_lane, shown_membranes;
  reg spiking;
  integer place, tap_sample, lane, first_lane;
  always @* spiking = tap_layer == D1 || tap_layer == C1 || tap_layer == C2;

  task compare_tap_bits(input [LANES-1:0] expected, input [LANES-1:0] actual, input [127:0] name);
    if (expected !== actual) begin
      for (lane = LANES - 1; lane >= 0; lane = lane - 1) if (expected[lane] !== actual[lane]) first_lane = lane;
      differ(tap_sample, tap_layer, tap_step, first_lane, name, {63'd0, expected[first_lane]},
             {63'd0, actual[first_lane]});
    end
  endtask
  task compare_tap_membranes;
    begin
      has_lane = ~({(24 * LANES) {1'b1}} << (24 * N_OUT[16*tap_layer+:16]));
      shown_membranes = tap_membrane & has_lane;
      if (shown_membranes !== want_membranes) begin
        for (lane = LANES - 1; lane >= 0; lane = lane - 1)
          if (shown_membranes[24*lane+:24] !== want_membranes[24*lane+:24]) first_lane = lane;
        differ(tap_sample, tap_layer, tap_step, first_lane, "membrane",
               {{40{want_membranes[24*first_lane+23]}}, want_membranes[24*first_lane+:24]},
               {{40{shown_membranes[24*first_lane+23]}}, shown_membranes[24*first_lane+:24]});
      end
    end
  endtask
  task look_up;
    begin
      case (tap_layer)
        D1: begin
          want_spikes = spikes_d1[place];
          want_membranes = membranes_d1[place];
        end
        D2: want_rows = rows_d2[place];
        C1: begin
          want_spikes = spikes_c1[place];
          want_membranes = membranes_c1[place];
        end
        C2: begin
          want_spikes = spikes_c2[place];
          want_membranes = membranes_c2[place];
          want_rows = rows_c2[place];
        end
        default: want_rows = rows_c3[place];
      endcase
    end
  endtask
  task compare_tap;
    begin
      if (tap_layer > C3) differ(-1, -1, -1, -1, "tap layer", C3, {61'd0, tap_layer});
      place = tapped[tap_layer];
      tap_sample = spiking ? place / STEPS : place;
      if (tap_sample >= SAMPLES) differ(tap_sample, tap_layer, tap_step, -1, "surplus tap", 0, 1);
      if (tap_step !== (spiking ? place % STEPS : 0))
        differ(tap_sample, tap_layer, spiking ? place % STEPS : 0, -1, "tap step", spiking ? place % STEPS : 0,
               {61'd0, tap_step});
      quiet = 0;
      look_up;
      if (!spiking || tap_layer == C2) compare_tap_bits(want_rows, tap_rows, "row");
      if (spiking) compare_tap_bits(want_spikes, tap_spikes, "spike");
      if (spiking) compare_tap_membranes;
      tapped[tap_layer] = place + 1;
    end
  endtask
  task expect_all_taps;
    integer layer, beats;
    for (layer = D1; layer <= C3; layer = layer + 1) begin
      beats = N_OUT[16*layer+:16] == 16'd0 ? 0 : layer == D2 || layer == C3 ? SAMPLES : STEP_BEATS;
      if (tapped[layer] != beats) differ(-1, -1, -1, -1, "tap beats", beats, tapped[layer]);
    end
  endtask

  // ---- counters
  task compare_counter(input [63:0] actual);
    if (actual !== counters[counter_at]) begin
      if (counter_at[5:3] <= C3)
        differ(-1, counter_at[5:3], counter_at[2:0], -1, event_name(counter_at[8:6]), counters[counter_at], actual);
      else differ(-1, -1, -1, -1, counter_at[0] ? "rays" : "samples", counters[counter_at], actual);
    end
  endtask

  // ---- the kit itself: the weights that are written are those of the weight image; a layer's biases follow its rows
  task check_weights;
    integer i, layer, row;
    reg [17:0] at;
    begin
      at = 18'd0;
      for (i = 0; i < WRITES; i = i + 1) begin
        if (program_image[i][44:32] == CSR_WEIGHT_ADDRESS) at = program_image[i][17:0];
        if (program_image[i][44:32] == CSR_WEIGHT_DATA) begin
          row = at[14:6] == BIAS_ROW ? N_IN[16*at[17:15]+:16] : at[14:6];
          for (layer = D1; layer < at[17:15]; layer = layer + 1) row = row + N_IN[16*layer+:16] + BIASES[layer];
          if (program_image[i][31:0] !== weights[row][32*at[5:0]+:32]) begin
            $display("DIFFERENCE in the kit: program.hex line %0d is not row %0d of weights.hex", i + 1, row + 1);
            fail;
          end
          at = at + 18'd1;
        end
      end
    end
  endtask

  task read_kit;
    begin
      $readmemh("program.hex", program_image);
      $readmemh("weights.hex", weights);
      $readmemh("stimulus.hex", stimulus);
      $readmemh("expected_outputs.hex", outputs);
      $readmemh("expected_spikes_D1.hex", spikes_d1);
      $readmemh("expected_spikes_C1.hex", spikes_c1);
      $readmemh("expected_spikes_C2.hex", spikes_c2);
      $readmemh("expected_membranes_D1.hex", membranes_d1);
      $readmemh("expected_membranes_C1.hex", membranes_c1);
      $readmemh("expected_membranes_C2.hex", membranes_c2);
      $readmemh("expected_rows_D2.hex", rows_d2);
      $readmemh("expected_rows_C2.hex", rows_c2);
      $readmemh("expected_rows_C3.hex", rows_c3);
      $readmemh("expected_counters.hex", counters);
    end
  endtask

  // ---- what happens when: each phase begins when its predecessor's last register access is done
  localparam [3:0] BEGIN = 4'd0, SEEN_ID = 4'd1, SEEN_CONFIG = 4'd2, PROGRAM = 4'd3, CLEARING = 4'd4, CLEAN = 4'd5,
                   RUN = 4'd6, DRAIN = 4'd7, SNAPSHOT = 4'd8, COUNT_LOW = 4'd9, COUNT_HIGH = 4'd10, LAST = 4'd11;
  reg [3:0] phase = BEGIN;
  integer written = 0, drained = 0;
  reg [31:0] low;
  task expect_value(input [31:0] expected, input [127:0] name);
    if (value !== expected) differ(-1, -1, -1, -1, name, {32'd0, expected}, {32'd0, value});
  endtask
  task go(input [3:0] next_phase, input [12:0] address);
    begin
      phase = next_phase;
      begin_read(address);
    end
  endtask

  task program_cycle;
    if (written < WRITES) begin
      begin_write(program_image[written][44:32], program_image[written][31:0]);
      written = written + 1;
    end else go(CLEARING, CSR_STATUS);
  endtask
  task run_cycle;
    begin
      offer_beat;
      take_output;
      if (with_tap && tap_valid === 1'b1) compare_tap;
      if (irq !== 1'b0) begin
        $display("DIFFERENCE interrupt: the block reports an error");
        fail;
      end
      if (received == 2 * SAMPLES) drained = drained + 1;
      if (drained == 16) begin
        if (with_tap) expect_all_taps;
        phase = DRAIN;
      end
    end
  endtask
  task next_counter;
    begin
      while (counter_at != 9'd511 && !is_compared(counter_at)) counter_at = counter_at + 9'd1;
      if (counter_at == 9'd511) go(LAST, CSR_ERROR);
      else go(COUNT_LOW, CSR_COUNTERS + {1'b0, counter_at, 3'd0});
    end
  endtask
  task pass;
    begin
      $display("PASS %0d samples, %0d steps, %0d cycles, stalls %0d %%, seed %0d", SAMPLES, STEPS, cycle, stalls, seed);
      $finish(0);  // says nothing more
    end
  endtask

  task advance;
    case (phase)
      BEGIN: go(SEEN_ID, CSR_ID);
      SEEN_ID: begin
        expect_value(CSR_ID_RESET, "ID");
        go(SEEN_CONFIG, CSR_CONFIG);
      end
      SEEN_CONFIG: begin
        expect_value(CSR_CONFIG_RESET - (LANES - `SF_DUT_LANES), "CONFIG");  // its lowest byte: lanes - 1
        phase = PROGRAM;
      end
      PROGRAM: program_cycle;
      CLEARING: go((value & STATUS_COUNTERS) != 32'd0 ? CLEARING : CLEAN,
                   (value & STATUS_COUNTERS) != 32'd0 ? CSR_STATUS : CSR_ERROR);
      CLEAN: begin
        expect_value(32'd0, "ERROR");
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
      default: begin
        expect_value(32'd0, "ERROR");
        pass;
      end
    endcase
  endtask

  always @(posedge clk) begin
    cycle = cycle + 1;
    quiet = quiet + 1;
    bus_random = next_random(bus_random);
    in_random = next_random(in_random);
    out_random = next_random(out_random);
    if (rst_n && !bus_busy) advance;
    if (rst_n) bus_cycle;
    rst_n <= cycle > 4;
    if (quiet > patience) begin
      $display("DIFFERENCE no sign of life: %0d of %0d writes, %0d of %0d beats in, %0d of %0d results out", written,
               WRITES, sent, BEATS, received / 2, SAMPLES);
      fail;
    end
  end

  integer i;
  initial begin
    begin_run;
    if ($test$plusargs("notap")) with_tap = 1'b0;
    for (i = 0; i < 5; i = i + 1) tapped[i] = 0;
    read_kit;
    check_weights;
  end
endmodule

`default_nettype wire
