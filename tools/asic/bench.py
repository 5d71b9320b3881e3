"""Runs a netlist on recorded operands in Icarus, with cells made of the library's functions, and counts every edge of every pin.

An edge is counted with the values of all pins of its cell after it, of an output also with the input that changed last."""
import os
import re
import subprocess

WARM_UP = 256  # cycles before counting: what was unknown at power-on is known
RESET = 4
DRAIN = 48
IDLE = 64     # cycles in which nothing is asked of the block


class BenchError(Exception):
    """The netlist does not compute what the RTL did, or a tool failed."""


def events_of(cell):
    """[(pin, related or None)]: edges of inputs, then of each output by the input that changed last."""
    return [(pin, None) for pin in cell.inputs] + [(output, pin) for output in cell.outputs for pin in cell.inputs]


def pins_of(cell):
    """In the order of the bits of a counted state."""
    return cell.inputs + cell.outputs


def body_of(cell):
    """Verilog of what the outputs are before their delay: {output: expression}, and the statements behind them."""
    if cell.gate:
        roles = {role: next(n for n, pin in cell.pins.items() if pin.get(f"clock_gate_{role}_pin") == "true") for role in ("clock", "enable", "out")}
        if cell.gate != "latch_posedge":
            raise BenchError(f"{cell.library.path}:{cell.group.line}: cell '{cell.name}' is a clock gate of kind '{cell.gate}', not latch_posedge")
        return {roles["out"]: f"{roles['clock']} & held"}, f"  reg held;\n  always @* if (!{roles['clock']}) held = {roles['enable']};\n"
    outputs = {output: function.verilog() for output, function in cell.functions.items()}
    if cell.state is None:
        return outputs, ""
    state, not_state = (cell.state.arguments + ["state_n"])[:2]
    clear, preset = (cell.state.get(name) for name in ("clear", "preset"))

    def verilog(name, text):
        return cell.expression(cell.state, text, name).verilog()
    lines = f"  reg {state};\n  wire {not_state} = ~{state};\n"
    if cell.state.name == "latch":
        body = f"if ({verilog('enable', cell.state.get('enable'))}) {state} = {verilog('data_in', cell.state.get('data_in'))};"
        if clear:
            body = f"if ({verilog('clear', clear)}) {state} = 1'b0; else " + body
        return outputs, lines + f"  always @* {body}\n"
    body, edges = f"{state} <= {verilog('next_state', cell.state.get('next_state'))};", "posedge clocked"
    lines += f"  wire clocked = {verilog('clocked_on', cell.state.get('clocked_on'))};\n"
    for name, text, value in (("preset", preset, 1), ("clear", clear, 0)):
        if text:
            lines += f"  wire is_{name} = {verilog(name, text)};\n"
            edges += f" or posedge is_{name}"
            body = f"if (is_{name}) {state} <= 1'b{value}; else " + body
    return outputs, lines + f"  always @({edges}) {body}\n"


def model_of(cell):
    """A module with the cell's function, its delays as parameters, and the counts of its edges."""
    outputs, body = body_of(cell)
    pins, events = pins_of(cell), events_of(cell)
    size = len(events) << len(pins)
    state = "{" + ", ".join(reversed(pins)) + "}"
    text = f"module \\{cell.name}_m #(parameter " + ", ".join(f"R{i} = 1, F{i} = 1" for i in range(len(cell.outputs)) or [0]) + ") ("
    text += ", ".join([f"input wire {pin}" for pin in cell.inputs] + [f"output wire {pin}" for pin in cell.outputs]) + ");\n" + body
    for i, output in enumerate(cell.outputs):
        if output in outputs:
            text += f"  assign #(R{i}, F{i}) {output} = {outputs[output]};\n"
    text += f"  int n[0:{2 * size - 1}];\n  int last = 0;\n"
    for i, pin in enumerate(cell.inputs):
        text += f"  always @({pin}) begin last = {i}; if (asic_bench.bank >= 0) n[asic_bench.bank * {size} + ({i << len(pins)} | {state})]++; end\n"
    for i, output in enumerate(cell.outputs):
        first = len(cell.inputs) * (1 + i)
        text += (f"  always @({output}) if (asic_bench.bank >= 0) n[asic_bench.bank * {size} + ((({first} + last) << {len(pins)}) | {state})]++;\n")
    text += f"  int k_n;\n  always @(asic_bench.dump) for (k_n = 0; k_n < {2 * size}; k_n = k_n + 1) if (n[k_n] != 0) $display(\"n %m %0d %0d\", k_n, n[k_n]);\nendmodule\n"
    return text


def name_of(net):
    return f"1'b{net}" if isinstance(net, str) and net in "01x" else f"n{net}"


def bits_of(netlist, signals):
    """[(signal, bit, net)] of the ports in the order of the columns, highest first."""
    return [(name, i, bits[i]) for name, bits in signals for i in reversed(range(len(bits)))]


def bench_of(netlist, clock, columns_in, columns_out, counts, period):
    """The test bench: cells and nets, operands of each cycle, the compared outputs."""
    nets = {net for instance in netlist.instances for net in instance.pins.values() if not isinstance(net, str)}
    nets |= {net for _, _, net in columns_in + columns_out if not isinstance(net, str)}
    if clock in netlist.inputs:
        nets.add(netlist.inputs[clock][0])
    wires = "".join(f"  wire n{net};\n" for net in sorted(nets))
    assigns = "".join(f"  assign {name_of(net)} = in[{len(columns_in) - 1 - i}];\n" for i, (_, _, net) in enumerate(columns_in))
    cells = ""
    for number, instance in enumerate(netlist.instances):
        delays = ", ".join(f".R{i}({rise}), .F{i}({fall})" for i, output in enumerate(instance.cell.outputs)
                           for rise, fall in [instance.delay.get(output, (1, 1))])
        pins = ", ".join(f".{pin}({name_of(net)})" for pin, net in instance.pins.items() if pin in pins_of(instance.cell))
        cells += f"  \\{instance.cell.name}_m {'#(' + delays + ') ' if delays else ''}u{number} ({pins});\n"
    out = ", ".join(name_of(net) for _, _, net in columns_out)
    clocked = f"  assign {name_of(netlist.inputs[clock][0])} = clk;\n" if clock in netlist.inputs else ""
    cycles, warm, idle_from = counts
    hold = max(1, period // 20)
    return f"""module asic_bench;
  int bank = -1;
  event dump;
  reg clk = 0;
  reg [{max(1, len(columns_in)) - 1}:0] in, operands[0:{cycles - 1}];
  reg [{max(1, len(columns_out)) - 1}:0] want[0:{cycles - 1}], care[0:{cycles - 1}];
{wires}{assigns}{clocked}{cells}  wire [{max(1, len(columns_out)) - 1}:0] out = {{{out or "1'b0"}}};
  int differences = 0, compared = 0, differs, b;
  reg [{max(1, len(columns_out)) - 1}:0] known = 0, cares, wants;
  // What was never known since power-on is not compared: the RTL's simulation began with random bits there.
  task compare(input int c);
    cares = care[c];
    wants = want[c];
    differs = 0;
    for (b = 0; b < {len(columns_out)}; b = b + 1) begin
      if (out[b] !== 1'bx) known[b] = 1;
      if (cares[b] && known[b]) begin
        compared = compared + 1;
        if (out[b] !== wants[b]) differs = 1;
      end
    end
    if (differs != 0 && differences == 0) $display("differs %0d %b", c, out);
    differences = differences + differs;
  endtask
  initial begin
    $readmemb("operands.txt", operands);
    $readmemb("want.txt", want);
    $readmemb("care.txt", care);
    for (int c = 0; c < {cycles}; c++) begin
      bank = c < {warm} ? -1 : c < {idle_from} ? 0 : c < {cycles - IDLE} ? -1 : 1;
      clk = 1;
      #{hold} in = operands[c];
      #{period // 2 - hold} clk = 0;
      #{period - period // 2 - 1} if (c >= {warm}) compare(c);
      #1;
    end
    bank = -1;
    $display("differences %0d %0d", differences, compared);
    -> dump;
    #1 $finish(0);
  end
endmodule
"""


def write_rows(path, rows):
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(rows) + "\n")


class Columns:
    """Operands and expected outputs of all cycles as rows of bits."""

    def __init__(self, netlist, record, clock, idle):
        signals = [(name, bits) for name, bits in netlist.inputs.items() if name != clock]
        boxes = [(name, bits) for name, bits in netlist.boxes.items()]
        missing = [name for name, bits in signals + boxes if name not in record.inputs and any(bit in netlist.sinks for bit in bits)]
        if missing:
            raise BenchError(f"the record lacks '{missing[0]}'")
        used = [(name, bits) for name, bits in signals + boxes if name in record.inputs]
        self.columns_in = bits_of(netlist, used)
        outputs = [(name, bits) for name, bits in netlist.outputs.items() if name in record.outputs]
        self.columns_out = bits_of(netlist, outputs)

        def row(values, names):
            return "".join(values[name][-len(bits):].rjust(len(bits), "0") for name, bits in names) or "0"

        def row_in(cycle, changes):
            values = {name: changes.get(name, record.inputs[name][cycle]) for name, _ in used}
            return row(values, used)
        reset = {name: "0" for name, _ in used if name == "rst_ni"}
        last = record.cycles - 1
        self.operands = [row_in(0, reset)] * RESET + [row_in(c, {}) for c in range(record.cycles)]
        self.operands += [row_in(last, {name: "0" * 64 for name in idle})] * (DRAIN + IDLE)
        shown = [row({name: record.outputs[name][c] for name, _ in outputs}, outputs) for c in range(record.cycles)]
        nothing = "0" * max(1, len(self.columns_out))
        self.want = [nothing] * RESET + [text.replace("x", "0") for text in shown] + [nothing] * (DRAIN + IDLE)
        self.care = [nothing] * RESET + [re.sub("[01]", "1", text).replace("x", "0") if outputs else "0" for text in shown] + [nothing] * (DRAIN + IDLE)


def run(netlist, record, clock, idle, period, folder):
    """{(instance number, event, state): count} of the record's cycles and of idle cycles, and the share of the outputs' bits
    that was compared. Raises BenchError at a difference."""
    columns = Columns(netlist, record, clock, idle)
    cycles = len(columns.operands)
    for name in ("operands", "want", "care"):
        write_rows(os.path.join(folder, name + ".txt"), getattr(columns, name))
    counts = (cycles, RESET + WARM_UP, RESET + record.cycles)
    with open(os.path.join(folder, "bench.v"), "w", encoding="utf-8") as file:
        file.write("`timescale 1ps / 1ps\n" + "".join(model_of(cell) for cell in netlist.cells.values()))
        file.write(bench_of(netlist, clock, columns.columns_in, columns.columns_out, counts, period))
    for command in (["iverilog", "-g2012", "-s", "asic_bench", "-o", "bench.vvp", "bench.v"], ["vvp", "-n", "bench.vvp"]):
        done = subprocess.run(["nice", "-n", "10"] + command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise BenchError(f"{command[0]}: {(done.stderr or done.stdout).strip().splitlines()[:1]}, see {folder}/bench.v")
    return counted(done.stdout, netlist, columns, folder)


def counted(output, netlist, columns, folder):
    """What a simulation printed: events per instance and state of its pins, differences to the recorded outputs, where the first is."""
    counts = [{}, {}]
    different, where, compared = 0, "", 0
    sizes = [(len(events_of(instance.cell)) << len(pins_of(instance.cell)), len(pins_of(instance.cell))) for instance in netlist.instances]
    for line in output.splitlines():
        word = line.split()
        if word[:1] == ["n"]:
            number = int(word[1].rsplit(".u", 1)[1])
            size, pins = sizes[number]
            bank, index = divmod(int(word[2]), size)
            counts[bank][number, index >> pins, index & ((1 << pins) - 1)] = int(word[3])
        elif word[:1] == ["differences"]:
            different, compared = int(word[1]), int(word[2])
        elif word[:1] == ["differs"]:
            cycle, got = int(word[1]), word[2]
            wrong = [(name, i) for (name, i, _), a, b, care in zip(columns.columns_out, got, columns.want[cycle], columns.care[cycle]) if care == "1" and a != b and a != "x"]
            wrong = wrong or [(name, i) for (name, i, _), a, care in zip(columns.columns_out, got, columns.care[cycle]) if care == "1" and a == "x"]
            where = f"first in cycle {cycle - RESET}: {wrong[0][0]}[{wrong[0][1]}]" if wrong else ""
    if different:
        raise BenchError(f"the netlist and the RTL differ in {different} cycles, {where} (a clock that is too fast?), see {folder}")
    return counts[0], counts[1], compared / max(1, sum(row.count("1") for row in columns.care[RESET + WARM_UP:]))
