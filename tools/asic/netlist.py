"""From RTL to a netlist of a library's cells (Yosys), and what each net of it weighs: load, slew, delay."""
import json
import math
import os
import re
import subprocess
from collections import deque

from asic.cells import Cell

GATED_BITS = 4    # registers with an enable get a gated clock from so many bits on
GATE_FANOUT = 32  # registers behind one clock gate
WIRE_PITCHES = 4.0     # length of wire for each pin that a net drives, in widths of the mean cell
WIRE_FF_PER_UM = 0.2   # of minimum-width wire, neighbours included
INPUT_SLEW_PS = 100.0  # of the block's inputs and of its clock
# Cells as small as the clock allows, {D} of it for logic; no net drives more than 16 pins. ABC's own script is for speed.
MAPPING = ("strash", "scorr", "dc2", "&get -n", "&dch -f", "&nf", "&put", "buffer -c -N 16", "topo", "upsize -D {D}", "dnsize -D {D}", "stime -p")
LOGIC = 0.6  # of the clock's period; the rest is for wires and registers, which ABC does not see
TIMING = ("cell_rise", "cell_fall", "rise_transition", "fall_transition")


class NetlistError(Exception):
    """Synthesis failed, or its netlist is not understood."""


def reduced_text(library, skipped):
    """The library's text without the cells that match one of the patterns."""
    text, parts, at = library.text, [], 0
    for name, cell in library.cells.items():
        if cell.get("dont_use") == "true" or any(re.search(pattern, name) for pattern in skipped):
            parts.append(text[at:cell.start])
            at = cell.end
    return "".join(parts + [text[at:]])


def smallest(cells, outputs, wanted):
    """The smallest cell with so many inputs, one output and this truth table (first input lowest)."""
    inputs = int(math.log2(len(wanted)))
    fitting = [cell for cell in cells if len(cell.outputs) == outputs and len(cell.inputs) == inputs and cell.functions.keys() == set(cell.outputs)
               and not cell.sequential() and cell.truth(cell.outputs[0]) == wanted]
    return min(fitting, key=lambda cell: (cell.area, cell.name), default=None)


def clock_gate(library, names):
    """Verilog that makes `clk` of CLK and the wire `enable`: the library's own clock gate, or a latch and an AND."""
    cells = [Cell(library, name) for name in names]
    own = [cell for cell in cells if cell.gate == "latch_posedge"]
    if own:
        cell = min(own, key=lambda one: (one.area, one.name))
        pin = {role: next(name for name, group in cell.pins.items() if group.get(f"clock_gate_{role}_pin") == "true") for role in
               ("clock", "enable", "out")}
        return f"{cell.name} u_gate (.{pin['clock']}(CLK), .{pin['enable']}(enable), .{pin['out']}(clk));", cell.name
    inverter, both = smallest(cells, 1, [1, 0]), smallest(cells, 1, [0, 0, 0, 1])
    latches = [cell for cell in cells if cell.state and cell.state.name == "latch" and len(cell.inputs) == 2 and len(cell.outputs) == 1
               and cell.state.get("data_in") in cell.inputs and (cell.state.get("enable") or "").strip("!()'") in cell.inputs]
    if not (inverter and both and latches):
        raise NetlistError(f"{library.path}: no clock gate, and no latch, inverter and AND to make one of; --gating off does without")
    latch = min(latches, key=lambda cell: (cell.area, cell.name))
    enable = latch.state.get("enable")
    inverts = enable.strip("()") not in latch.inputs
    lines = [f"{latch.name} u_latch (.{latch.state.get('data_in')}(enable), .{enable.strip(chr(33) + '()' + chr(39))}({'CLK' if inverts else 'low'}), "
             f".{latch.outputs[0]}(held));",
             f"{both.name} u_and (.{both.inputs[0]}(CLK), .{both.inputs[1]}(held), .{both.outputs[0]}(clk));"]
    if not inverts:
        lines.insert(0, f"{inverter.name} u_not (.{inverter.inputs[0]}(CLK), .{inverter.outputs[0]}(low));")
    return "wire held, low;\n      " + "\n      ".join(lines), f"{latch.name} and {both.name}"


def gating_map(gate):
    """A techmap file: registers with an enable become registers with a gated clock, GATE_FANOUT bits at a time."""
    text = ""
    for kind, reset, parameters, ports in (("$dffe", "", "", ""),
                                           ("$adffe", "ARST, ", "parameter ARST_POLARITY = 1; parameter ARST_VALUE = 0;",
                                            ".ARST_POLARITY(ARST_POLARITY), .ARST_VALUE(ARST_VALUE >> i), ")):
        connect = ".ARST(ARST), " if reset else ""
        text += f"""(* techmap_celltype = "{kind}" *)
module gate{kind.strip("$")} (CLK, EN, {reset}D, Q);
  parameter WIDTH = 1; parameter CLK_POLARITY = 1; parameter EN_POLARITY = 1; {parameters}
  input CLK, EN{", ARST" if reset else ""};
  input [WIDTH-1:0] D;
  output [WIDTH-1:0] Q;
  wire _TECHMAP_FAIL_ = WIDTH < {GATED_BITS} || !CLK_POLARITY;
  wire enable = EN_POLARITY ? EN : ~EN;
  genvar i;
  generate
    for (i = 0; i < WIDTH; i = i + {GATE_FANOUT}) begin : g_part
      localparam BITS = WIDTH - i < {GATE_FANOUT} ? WIDTH - i : {GATE_FANOUT};
      wire clk;
      {gate}
      \\{kind.replace("e", "")} #(.WIDTH(BITS), .CLK_POLARITY(1), {ports}.__X(0)) u_q (.CLK(clk), {connect}.D(D[i+:BITS]), .Q(Q[i+:BITS]));
    end
  endgenerate
endmodule
""".replace(", .__X(0)", "")
    return text


# A memory with a registered read port becomes a box: its address and data are loads, what it reads comes from the recording.
MEMORY_BOX = """(* blackbox *)
module sf_memory (input clk, input re, input [ABITS-1:0] raddr, output [WIDTH-1:0] rdata, input we, input [ABITS-1:0] waddr, input [WIDTH-1:0] wdata);
  parameter ABITS = 1; parameter WIDTH = 1; parameter SIZE = 1;
endmodule
"""
MEMORY_MAP = """(* techmap_celltype = "$mem_v2" *)
module memory_box (RD_CLK, RD_EN, RD_ARST, RD_SRST, RD_ADDR, RD_DATA, WR_CLK, WR_EN, WR_ADDR, WR_DATA);
  parameter MEMID = ""; parameter SIZE = 0; parameter OFFSET = 0; parameter ABITS = 1; parameter WIDTH = 1; parameter INIT = 0;
  parameter RD_PORTS = 1; parameter RD_CLK_ENABLE = 1; parameter RD_CLK_POLARITY = 1; parameter RD_TRANSPARENCY_MASK = 0;
  parameter RD_COLLISION_X_MASK = 0; parameter RD_WIDE_CONTINUATION = 0; parameter RD_CE_OVER_SRST = 0; parameter RD_ARST_VALUE = 0;
  parameter RD_SRST_VALUE = 0; parameter RD_INIT_VALUE = 0; parameter WR_PORTS = 1; parameter WR_CLK_ENABLE = 1; parameter WR_CLK_POLARITY = 1;
  parameter WR_PRIORITY_MASK = 0; parameter WR_WIDE_CONTINUATION = 0;
  input [RD_PORTS-1:0] RD_CLK, RD_EN, RD_ARST, RD_SRST;
  input [RD_PORTS*ABITS-1:0] RD_ADDR;
  output [RD_PORTS*WIDTH-1:0] RD_DATA;
  input [WR_PORTS-1:0] WR_CLK;
  input [WR_PORTS*WIDTH-1:0] WR_EN, WR_DATA;
  input [WR_PORTS*ABITS-1:0] WR_ADDR;
  wire _TECHMAP_FAIL_ = RD_PORTS != 1 || WR_PORTS != 1 || !RD_CLK_ENABLE;
  sf_memory #(.ABITS(ABITS), .WIDTH(WIDTH), .SIZE(SIZE)) _TECHMAP_REPLACE_ (.clk(RD_CLK), .re(RD_EN), .raddr(RD_ADDR), .rdata(RD_DATA),
      .we(WR_EN[0]), .waddr(WR_ADDR), .wdata(WR_DATA));
endmodule
"""


def script_of(piece, sources, liberty, period_ps, gating):
    """Yosys' script that maps one piece of the block, flat, to the library."""
    parameters = " ".join(f"-chparam {name} {value}" for name, value in piece.parameters.items())
    lines = [f"read_liberty -lib -ignore_miss_func {liberty}"] + ["read_verilog -sv memory_box.v"] * bool(piece.memories)
    lines += [f"read_verilog -sv -defer -Irtl {' '.join(sources)}",
             f"hierarchy -check -top {piece.module} {parameters}", f"rename -top {piece.module}"]
    lines += [f"blackbox *{box}*" for box in piece.boxes]
    lines += [f"synth -top {piece.module} -flatten -run begin:fine"] + ["techmap -map memory.v"] * bool(piece.memories)
    lines += ["opt -fast -full -nosdff", "memory_map", "opt -undriven -fine -nosdff"]
    if gating:
        lines += ["techmap -map gate.v", "opt -nodffe -nosdff"]
    lines += ["techmap", "opt -fast -nodffe -nosdff", f"dfflibmap -liberty {liberty}",
              f"abc -liberty {liberty} -constr abc.constr -script map.abc -D {period_ps}", "opt_clean -purge", "setundef -zero", "check -mapped", "write_json netlist.json"]
    return "\n".join(lines) + "\n"


def write_library(library, folder, period_ps, gating, skipped):
    """What Yosys and ABC need beside the RTL: cells, memories as boxes, gated clocks, the mapping. Returns the cells' names."""
    names = [name for name, cell in library.cells.items() if cell.get("dont_use") != "true" and not any(re.search(p, name) for p in skipped)]
    inverter = smallest([Cell(library, name) for name in names], 1, [1, 0])
    if inverter is None:
        raise NetlistError(f"{library.path}: the library has no inverter")
    texts = {"cells.lib": reduced_text(library, skipped), "memory_box.v": MEMORY_BOX, "memory.v": MEMORY_MAP,
             "map.abc": "\n".join(MAPPING).replace("{D}", str(round(LOGIC * period_ps))) + "\n",
             "abc.constr": f"set_driving_cell {inverter.name}\nset_load {4 * inverter.capacitance(inverter.inputs[0]):.3f} [all_outputs]\n"}
    if gating:
        texts["gate.v"] = gating_map(clock_gate(library, names)[0])
    for name, text in texts.items():
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(text)
    return names


def run_yosys(name, folder, log="yosys.log"):
    """Runs folder/synth.ys; raises NetlistError with the tool's own words."""
    done = subprocess.run(["nice", "-n", "10", "yosys", "-q", "-l", log, "synth.ys"], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        with open(os.path.join(folder, log), encoding="utf-8", errors="replace") as file:
            errors = [line.strip() for line in file if re.match(r"ABC: (Error|Library .* cannot)", line)]
        errors += [line for line in (done.stdout + done.stderr).splitlines() if "ERROR" in line] or (done.stderr or done.stdout).splitlines()[-1:]
        raise NetlistError(f"yosys: {name}: {' '.join(errors[:1])}, see {folder}/{log}")


def synthesise(piece, sources, library, folder, period_ps, gating, skipped):
    """Writes folder/netlist.json; sources are absolute, the RTL's root is linked into the folder."""
    write_library(library, folder, period_ps, gating, skipped)
    with open(os.path.join(folder, "synth.ys"), "w", encoding="utf-8") as file:
        file.write(script_of(piece, sources, "cells.lib", period_ps, gating))
    run_yosys(piece.name, folder)


class Instance:
    """A cell of the netlist; pins: {pin: net}, where a net is a number, "0" or "1"."""

    def __init__(self, name, cell, pins):
        self.name, self.cell, self.pins = name, cell, pins
        self.delay = {}  # output -> (rise, fall) in ps


class Netlist:
    """Instances, nets, and what stands for memories: boxes, whose outputs are inputs of the netlist."""

    def __init__(self, path, piece, library):
        with open(path, encoding="utf-8") as file:
            top = json.load(file)["modules"][piece.module]
        self.library, self.cells, self.instances = library, {}, []
        self.inputs = {name: port["bits"] for name, port in top["ports"].items() if port["direction"] == "input"}
        self.outputs = {name: port["bits"] for name, port in top["ports"].items() if port["direction"] == "output"}
        self.boxes = {}  # "u_weights.row_o" -> bits
        for name, cell in top["cells"].items():
            if cell["type"] in library.cells:
                kind = self.cells.setdefault(cell["type"], Cell(library, cell["type"]))
                self.instances.append(Instance(name, kind, {pin: bits[0] for pin, bits in cell["connections"].items() if bits}))
            elif cell["type"].startswith("$") and not cell["type"].startswith("$paramod"):
                raise NetlistError(f"{path}: the library has no cell for Yosys' {cell['type']} ({name})")
            else:
                for pin, bits in cell["connections"].items():
                    if cell["port_directions"].get(pin) == "output":
                        self.boxes[f"{name}.{pin}"] = bits
        for kind in self.cells.values():
            if not any(kind.powers(pin) for pin in kind.pins):
                library.fail(kind.group, f"cell '{kind.name}' has no tables of internal power")
        missing = [name for name in piece.memories if not any(box.startswith(name + ".") for box in self.boxes)]
        if missing:
            raise NetlistError(f"{path}: the memory '{missing[0]}' is no memory with a registered read port")
        self.connect()

    def connect(self):
        """Driver and sinks of each net, and the load of each in fF, wires estimated from the mean cell."""
        self.driver, self.sinks = {}, {}
        for instance in self.instances:
            for pin, net in instance.pins.items():
                if pin in instance.cell.outputs:
                    self.driver[net] = (instance, pin)
                else:
                    self.sinks.setdefault(net, []).append((instance, pin))
        self.mean_area = sum(instance.cell.area for instance in self.instances) / max(1, len(self.instances))
        self.wire_ff = WIRE_PITCHES * math.sqrt(self.mean_area) * WIRE_FF_PER_UM
        out = [bit for bits in self.outputs.values() for bit in bits]
        self.load = {net: sum(instance.cell.capacitance(pin) for instance, pin in sinks) + self.wire_ff * len(sinks)
                     for net, sinks in self.sinks.items()}
        for net in set(self.driver) | set(out):
            self.load.setdefault(net, self.wire_ff)
        self.slew = {net: INPUT_SLEW_PS for net in self.load}

    def clock_nets(self):
        """Nets that clock a register, back through gates and logic to the input: they are as if balanced, without delay."""
        found, left = set(), deque(instance.pins[pin] for instance in self.instances for pin in instance.cell.clock_pins() if pin in instance.pins)
        while left:
            net = left.popleft()
            if net in found:
                continue
            found.add(net)
            instance, _ = self.driver.get(net, (None, None))
            if instance and (instance.cell.gate or not instance.cell.sequential()):
                left.extend(instance.pins[pin] for pin in (instance.cell.clock_pins() or instance.cell.inputs) if pin in instance.pins)
        return found

    def propagate(self):
        """Slews and delays of all outputs from the timing tables, in the order of the arcs; means over a cell's arcs."""
        ideal = self.clock_nets()
        arcs = {}  # (instance, output) -> [(pin, tables)]
        waits, readers = {}, {}
        for instance in self.instances:
            for output in instance.cell.outputs:
                if output not in instance.pins:
                    continue
                here = [(pin, tables) for related, tables in self.arcs_of(instance.cell, output) for pin in related if pin in instance.pins]
                arcs[id(instance), output] = (instance, output, here)
                nets = {instance.pins[pin] for pin, _ in here if instance.pins[pin] in self.driver}
                waits[id(instance), output] = len(nets)
                for net in nets:
                    readers.setdefault(net, []).append((id(instance), output))
        ready = deque(key for key, n in waits.items() if n == 0)
        done = 0
        while ready:
            key = ready.popleft()
            done += 1
            instance, output, here = arcs[key]
            self.settle(instance, output, here, ideal)
            for reader in readers.get(instance.pins[output], []):
                waits[reader] -= 1
                if waits[reader] == 0:
                    ready.append(reader)
        if done < len(arcs):
            raise NetlistError(f"{len(arcs) - done} cells of the netlist drive each other in a circle")

    def arcs_of(self, cell, output):
        cache = self.__dict__.setdefault("_arcs", {})
        if (cell.name, output) not in cache:
            cache[cell.name, output] = cell.arcs(output, TIMING)
        return cache[cell.name, output]

    def settle(self, instance, output, here, ideal):
        """Slew, in ps, and delay of an output, from the tables of its inputs."""
        net = instance.pins[output]
        load = self.load.get(net, 0.0)
        seen = {kind: [] for kind in TIMING}
        for pin, tables in here:
            slew = self.slew.get(instance.pins[pin], INPUT_SLEW_PS)
            for kind, table in tables.items():
                seen[kind].append(table.at(slew, load))

        def mean(kinds, default):
            values = [value for kind in kinds for value in seen[kind]]
            return sum(values) / len(values) if values else default
        self.slew[net] = max(1.0, mean(("rise_transition", "fall_transition"), INPUT_SLEW_PS))
        if net in ideal:
            self.slew[net], instance.delay[output] = INPUT_SLEW_PS, (0, 0)
        else:
            instance.delay[output] = tuple(max(1, round(mean((kind,), mean(TIMING[:2], 1.0)))) for kind in TIMING[:2])
