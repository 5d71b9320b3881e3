// Of both benches: chance, one register access at a time, which counters are compared, and how a run begins.
// ---- chance: xorshift32, the same in every simulator
reg [31:0] bus_random, in_random, out_random;
integer stalls;
function automatic [31:0] next_random(input [31:0] x);
  reg [31:0] y;
  begin
    y = x ^ (x << 13);
    y = y ^ (y >> 17);
    next_random = y ^ (y << 5);
  end
endfunction
function automatic stall(input [31:0] x);
  stall = {1'b0, x[31:1]} % 100 < stalls;
endfunction

// ---- AXI4-Lite: one access at a time; address and data of a write may come in either order
reg bus_busy = 1'b0, writing, aw_left, w_left, ar_left;
reg [12:0] register;
reg [31:0] value;  // that was read
task begin_write(input [12:0] address, input [31:0] data);
  begin
    {bus_busy, writing, aw_left, w_left, ar_left} = 5'b11110;
    register = address;
    awaddr <= address;
    wdata <= data;
  end
endtask
task begin_read(input [12:0] address);
  begin
    {bus_busy, writing, aw_left, w_left, ar_left} = 5'b10001;
    register = address;
    araddr <= address;
  end
endtask
task check_asked(input asked);
  if (!asked) begin
    $display("DIFFERENCE register %03x: answered before it was asked", register);
    fail;
  end
endtask
task check_response(input [1:0] response);
  begin
    bus_busy = 1'b0;
    if (register != CSR_STATUS) quiet = 0;  // which is polled
    if (response !== 2'd0) begin
      $display("DIFFERENCE register %03x: response %0d to a %0s", register, response, writing ? "write" : "read");
      fail;
    end
  end
endtask
// What was taken is no longer on offer.
task bus_cycle;
  begin
    if (awvalid && awready) begin
      aw_left = 1'b0;
      awaddr <= ~awaddr;
    end
    if (wvalid && wready) begin
      w_left = 1'b0;
      wdata <= ~wdata;
    end
    if (arvalid && arready) begin
      ar_left = 1'b0;
      araddr <= ~araddr;
    end
    if (bvalid) check_asked(bus_busy && writing && !aw_left && !w_left);
    if (rvalid) check_asked(bus_busy && !writing && !ar_left);
    if (bvalid && bready) check_response(bresp);
    if (rvalid && rready) begin
      value = rdata;
      check_response(rresp);
    end
    awvalid <= aw_left && (awvalid || !stall(bus_random));
    wvalid <= w_left && (wvalid || !stall({bus_random[15:0], bus_random[31:16]}));
    arvalid <= ar_left && (arvalid || !stall(bus_random));
    bready <= bus_busy && writing && !stall({bus_random[7:0], bus_random[31:8]});
    rready <= bus_busy && !writing && !stall({bus_random[7:0], bus_random[31:8]});
  end
endtask

// ---- counters: layers 5 and 6 are empty; of layer 7 there are samples and rays (event 0, steps 0 and 1), the rest is the clock's
reg [8:0] counter_at = 9'd0;
function automatic is_compared(input [8:0] at);
  is_compared = at[5:3] <= 3'd4 || (at[5:3] == 3'd7 && at[8:6] == 3'd0 && at[2:0] <= 3'd1);
endfunction

// ---- plusargs
reg [31:0] seed;
string wave;  // name of a file
integer wave_file;
task begin_run;
  begin
    if ($value$plusargs("stalls=%d", stalls) == 0) stalls = 20;
    if ($value$plusargs("seed=%d", seed) == 0) seed = SEED;
    if ($value$plusargs("patience=%d", patience) == 0) patience = 100000;
    if ($value$plusargs("vcd=%s", wave) != 0) begin
`ifdef SF_KIT_NO_WAVE
      $display("FAIL: +vcd: this simulation was built without waveforms (make verilator VCD=FILE builds another)");
      $fatal(1, "no waveform");
`else
      wave_file = $fopen(wave, "w");
      if (wave_file == 0) begin
        $display("FAIL: +vcd: %s cannot be written", wave);
        $fatal(1, "no waveform");
      end
      $fclose(wave_file);
      $dumpfile(wave);
      $dumpvars(0, `SF_KIT_TB);
`endif
    end
    // xorshift stays at 0
    bus_random = seed == 32'h9e3779b9 ? 32'd1 : seed ^ 32'h9e3779b9;
    in_random = seed == 32'h7f4a7c15 ? 32'd1 : seed ^ 32'h7f4a7c15;
    out_random = seed == 32'h94d049bb ? 32'd1 : seed ^ 32'h94d049bb;
  end
endtask
