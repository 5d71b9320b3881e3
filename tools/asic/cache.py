"""Operands of the field's cache: its RTL in Icarus, asked for the entries that rays of a scene need."""
import os
import subprocess

from asic.bench import BenchError
from asic.record import Record

LATENCY = 64  # cycles from a request to the first half of its line
PORTS_IN = ["rst_ni", "clear_i", "go_i", "enter_i", "used_i", "line_i", "leave_i", "empty_i", "empty_set_i", "b_list_q"]
PORTS_OUT = ["busy_o", "used_o", "miss_o", "line_o", "place_o"]


def bench_of(cycles, pairs):
    """The cache with default size, pairs of entries as fast as it takes them, a memory that answers in order."""
    ports = [f"dut.u_even.{name}" for name in PORTS_IN + PORTS_OUT]
    return f"""`default_nettype none
`timescale 1ns / 1ns
module asic_cache_bench;
  reg clk = 1, rst_n = 0;
  reg [64:0] pairs[0:{pairs - 1}];
  int next = 0, sent = 0, due[0:1023], file, head = 0, tail = 0, half = 0, now = 0;
  wire ready, arvalid;
  wire valid = rst_n && next < {pairs};
  wire [64:0] pair = pairs[next];
  reg rvalid = 0;
  sf_cache dut (.clk_i(clk), .rst_ni(rst_n), .clear_i(1'b0), .base_i(32'd0), .s_valid_i(valid), .s_ready_o(ready), .s_empty_i(pair[64]),
      .s_entry0_i(pair[63:32]), .s_entry1_i(pair[31:0]), .m_axi_arvalid_o(arvalid), .m_axi_arready_i(1'b1), .m_axi_rvalid_i(rvalid),
      .m_axi_rdata_i(64'd0), .m_axi_rresp_i(2'd0));
  always #5 clk = !clk;
  always @(posedge clk) begin
    now <= now + 1;
    if (valid && ready) next <= next + 1;
    if (arvalid && rst_n) begin
      due[tail % 1024] <= now + {LATENCY};
      tail <= tail + 1;
    end
    rvalid <= 0;
    if (head != tail && now >= due[head % 1024]) begin
      rvalid <= 1;
      half <= 1 - half;
      if (half == 1) head <= head + 1;
    end
  end
  initial begin
    $readmemh("pairs.txt", pairs);
    file = $fopen("ports.txt", "w");
    #42 rst_n = 1;
    repeat ({cycles}) begin
      @(negedge clk) #4;
      $fdisplay(file, "{' '.join(['%b'] * len(ports))}", {', '.join(ports)});
    end
    $finish(0);
  end
endmodule
"""


def run(command, folder, name):
    done = subprocess.run(["nice", "-n", "10"] + command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BenchError(f"{name}: {' '.join((done.stderr or done.stdout).strip().splitlines()[:1])}, see {folder}")
    return done.stdout


def record(lookups, scene, data, root, sources, folder, cycles):
    """Ports of the even bank's tags in each cycle; an event is a look-up that leaves them."""
    text = run([lookups, scene, data, str(cycles)], folder, "lookups")
    rows = [line.split() for line in text.splitlines()]
    with open(os.path.join(folder, "pairs.txt"), "w", encoding="ascii") as file:
        file.writelines(f"{empty}{a}{b}\n" for empty, a, b in rows)
    with open(os.path.join(folder, "cache_bench.sv"), "w", encoding="utf-8") as file:
        file.write(bench_of(cycles, len(rows)))
    run(["iverilog", "-g2012", "-I", os.path.join(root, "rtl"), "-s", "asic_cache_bench", "-o", "cache.vvp", "cache_bench.sv"] +
        [os.path.join(root, name) for name in sources if os.path.basename(name) in ("sf_cache.sv", "sf_cache_tags.sv", "sf_fetch.sv", "sf_fifo.sv")],
        folder, "iverilog")
    run(["vvp", "-n", "cache.vvp"], folder, "vvp")
    with open(os.path.join(folder, "ports.txt"), encoding="ascii") as file:
        values = list(zip(*(line.split() for line in file)))
    names = PORTS_IN + PORTS_OUT
    ports = dict(zip(names, (list(column) for column in values)))
    events = [int(leave == "1" and used == "1") for leave, used in zip(ports["leave_i"], ports["used_o"])]
    inputs = {("list_q.rdata" if name == "b_list_q" else name): ports[name] for name in PORTS_IN}
    return Record(inputs, {name: ports[name] for name in PORTS_OUT}, events, len(events))
