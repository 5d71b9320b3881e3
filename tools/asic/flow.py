"""A netlist with its hierarchy, and what OpenSTA says of it."""
import json
import os
import re
import subprocess

from asic import netlist, repair
from asic.cells import Cell

BOX_BITS = 2048  # memories with a registered read port and at least so many bits are boxes
IO_SHARE = 0.0   # of the period, outside the block


class FlowError(Exception):
    """A tool failed."""


def with_parameters(module, parameters, sources, folder):
    """The sources, with a copy of the module's in which its parameters have other defaults."""
    if not parameters:
        return sources
    source = next(name for name in sources if os.path.basename(name) == module + ".sv")
    with open(os.path.join(folder, source), encoding="utf-8") as file:
        text = file.read()
    for name, value in parameters.items():
        text, found = re.subn(rf"(\bparameter\s+(?:integer\s+|int\s+)?{re.escape(name)}\s*=\s*)[^,/\n)]+", rf"\g<1>{value}", text)
        if not found:
            raise FlowError(f"{source}: the module has no parameter {name}")
    with open(os.path.join(folder, module + ".sv"), "w", encoding="utf-8") as file:
        file.write(text)
    return [module + ".sv" if name == source else name for name in sources]


def script_of(module, sources, tap, period_ps, gating):
    """Yosys' script from sources to netlist.json, memories kept as black boxes."""
    define = "" if tap else "-D SF_NO_TAP "  # a build without the tap has no ports for it
    lines = ["read_liberty -lib -ignore_miss_func cells.lib", "read_verilog -sv memory_box.v",
             f"read_verilog -sv -defer {define}-Irtl {' '.join(sources)}", f"hierarchy -check -top {module}",
             f"synth -top {module} -run begin:fine", "techmap -map memory.v", "opt -fast -full -nosdff", "memory_map", "opt -undriven -fine -nosdff"]
    lines += ["techmap -map gate.v", "opt -nodffe -nosdff"] * gating
    lines += ["techmap", "opt -fast -nodffe -nosdff", "dfflibmap -liberty cells.lib",
              f"abc -liberty cells.lib -constr abc.constr -script map.abc -D {period_ps}", "opt_clean -purge", "setundef -zero", "splitnets", "autoname",
              "write_json netlist.json"]
    return "\n".join(lines) + "\n"


def synthesise(module, parameters, sources, library, folder, period_ps, gating, skipped):
    """Writes folder/netlist.v and netlist.json; module names without the parameters that Yosys puts into them."""
    names = netlist.write_library(library, folder, period_ps, gating, skipped)
    with open(os.path.join(folder, "memory.v"), "w", encoding="utf-8") as file:
        file.write(netlist.MEMORY_MAP.replace("!RD_CLK_ENABLE;", f"!RD_CLK_ENABLE || SIZE * WIDTH < {BOX_BITS};"))
    with open(os.path.join(folder, "synth.ys"), "w", encoding="utf-8") as file:
        file.write(script_of(module, with_parameters(module, parameters, sources, folder), parameters.get("TAP") != "0", period_ps, gating))
    netlist.run_yosys(module, folder)
    repair.repair_file(os.path.join(folder, "netlist.json"), library, names)
    with open(os.path.join(folder, "synth.ys"), "w", encoding="utf-8") as file:
        file.write("read_json netlist.json\nwrite_verilog -noattr -noexpr -nohex -nodec -simple-lhs netlist.v\n")
    netlist.run_yosys(module, folder, "write.log")
    with open(os.path.join(folder, "netlist.v"), encoding="utf-8") as file:
        text = file.read()
    text = re.sub(r"\bsf_memory #\((.*?)\n\s*\) ", memory_kind, text, flags=re.S)
    plain = plain_names(text)
    for long, short in plain.items():
        text = text.replace("\\" + long + " ", short + " ")
    with open(os.path.join(folder, "netlist.v"), "w", encoding="utf-8") as file:
        file.write(text)
    return plain, names


def memory_kind(found):
    """A box's kind by its size: sf_memory_256x16."""
    size = {name: int(value, 2) for name, value in re.findall(r"\.(\w+)\(32'b(\d+)\)", found.group(1))}
    return f"{box_name(size['SIZE'], size['WIDTH'])} "


def box_name(words, width):
    return f"sf_memory_{words}x{width}"


def boxes_of(memories):
    """Verilog of the boxes, one module per size."""
    text = ""
    for words, width in sorted({(memory["words"], memory["width"]) for memory in memories}):
        abits = max(1, (words - 1).bit_length())
        text += (f"(* blackbox *)\nmodule {box_name(words, width)} (input clk, input re, input [{abits - 1}:0] raddr, output [{width - 1}:0] rdata, input we, "
                 f"input [{abits - 1}:0] waddr, input [{width - 1}:0] wdata);\nendmodule\n")
    return text


def plain_names(text):
    """{name of a module with parameters, as Yosys writes it: sf_sums, sf_sums_2, ...}"""
    taken, found = set(re.findall(r"^module (\w+)", text, re.M)), {}
    for long in re.findall(r"^module \\(\$paramod\S+)", text, re.M):
        base = re.search(r"\\(\w+)", long).group(1)
        name, number = base, 1
        while name in taken:
            number += 1
            name = f"{base}_{number}"
        taken.add(name)
        found[long] = name
    return found


class Design:
    """Modules of the netlist: cells, area, memories, and whom they use."""

    def __init__(self, folder, top, plain, library):
        with open(os.path.join(folder, "netlist.json"), encoding="utf-8") as file:
            modules = json.load(file)["modules"]
        self.top, self.library, self.plain = top, library, plain
        self.modules = {plain.get(name, name): module for name, module in modules.items()
                        if (plain.get(name, name) == top or name in plain or name.startswith("sf_")) and name != "sf_memory"}
        self.kinds = {}
        self.own = {name: self.own_of(module) for name, module in self.modules.items()}

    def kind(self, name):
        if name not in self.kinds:
            self.kinds[name] = Cell(self.library, name)
        return self.kinds[name]

    def own_of(self, module):
        """Cells, registers, area and memories of a module itself, and how often it uses each other module."""
        result = {"cells": 0, "registers": 0, "area_um2": 0.0, "uses": {}, "memories": []}
        for name, cell in module["cells"].items():
            kind = cell["type"]
            if kind in self.library.cells:
                result["cells"] += 1
                result["registers"] += self.kind(kind).state is not None
                result["area_um2"] += self.kind(kind).area
            elif kind == "sf_memory":
                ports = {pin: {"direction": cell["port_directions"][pin], "bits": len(bits)} for pin, bits in cell["connections"].items()}
                words = int(cell["parameters"]["SIZE"], 2)
                result["memories"].append({"name": name, "words": words, "width": ports["rdata"]["bits"], "bits": words * ports["rdata"]["bits"],
                                           "ports": ports})
            else:
                used = self.plain.get(kind, kind)
                result["uses"][used] = result["uses"].get(used, 0) + 1
        return result

    def whole(self, name):
        """A module with all that it uses."""
        own = self.own[name]
        result = {field: own[field] for field in ("cells", "registers", "area_um2")}
        result["memory_bits"] = sum(memory["bits"] for memory in own["memories"])
        for used, times in own["uses"].items():
            inside = self.whole(used)
            for field in result:
                result[field] += times * inside[field]
        return result

    def instances(self):
        """{module: how often it is in the top}"""
        found = {}

        def visit(name, times):
            found[name] = found.get(name, 0) + times
            for used, n in self.own[name]["uses"].items():
                visit(used, times * n)
        visit(self.top, 1)
        return found

    def memories(self):
        """Each kind of memory once: where, how often, words, width, ports."""
        times, found = self.instances(), {}
        for name, own in self.own.items():
            for memory in own["memories"]:
                key = (name, memory["words"], memory["width"])
                entry = found.setdefault(key, {"module": name, "count": 0, "words": memory["words"], "width": memory["width"],
                                               "bits": memory["bits"], "ports": memory["ports"]})
                entry["count"] += times.get(name, 0)
        return [entry for entry in found.values() if entry["count"]]

    def signal_of(self, path):
        """The RTL's name of what a cell drives: u_scale/_4887_/Q or u_scale/_4887_ is u_scale.product_q[3]."""
        parts, name, scope = path.split("/"), self.top, []
        while parts:
            module = self.modules.get(name)
            cell = module["cells"].get(parts[0]) if module else None
            if cell is None:
                return path
            if cell["type"] in self.library.cells:
                outputs = [bits[0] for pin, bits in cell["connections"].items() if cell_output(self.kind(cell["type"]), pin)]
                nets = [(net, info["bits"].index(bit)) for bit in outputs for net, info in module["netnames"].items() if bit in info["bits"]]
                nets.sort(key=lambda found: (found[0].startswith(("$", "_")), len(found[0])))
                return ".".join(scope + [nets[0][0]]) if nets else path
            scope.append(parts[0])
            name, parts = self.plain.get(cell["type"], cell["type"]), parts[1:]
        return path


def cell_output(kind, pin):
    return pin in kind.outputs


def sdc_of(clocked, period, unit_ps):
    """Constraints: inputs come with the clock's edge and outputs are needed by the next. Times are in the library's unit."""
    lines = [f"# times in {unit_ps:g} ps", f"create_clock -name clk -period {period:g}" + (" [get_ports clk_i]" if clocked else "")]
    lines += [f"set_input_delay {IO_SHARE * period:g} -clock clk [all_inputs]", f"set_output_delay {IO_SHARE * period:g} -clock clk [all_outputs]"]
    if clocked:
        lines.insert(2, "set_false_path -from [get_ports rst_ni]" if clocked == "reset" else "")
    return "\n".join(line for line in lines if line) + "\n"


def sta(module, clocked, period_ps, unit_ps, folder, paths=1):
    """The longest paths of a module. OpenSTA counts time in the library's unit."""
    with open(os.path.join(folder, f"{module}.sdc"), "w", encoding="utf-8") as file:
        file.write(sdc_of(clocked, period_ps / unit_ps, unit_ps))
    script = (f"read_liberty cells.lib\nread_verilog netlist.v\nlink_design {module}\nread_sdc {module}.sdc\n"
              f"report_checks -path_delay max -group_count {paths} -digits 3\nexit\n")
    with open(os.path.join(folder, f"{module}.tcl"), "w", encoding="utf-8") as file:
        file.write(script)
    done = subprocess.run(["nice", "-n", "10", "sta", "-exit", f"{module}.tcl"], cwd=folder, capture_output=True, text=True, check=False,
                          stdin=subprocess.DEVNULL)
    output = done.stdout + done.stderr
    errors = [line for line in output.splitlines() if line.startswith("Error")]
    if done.returncode != 0 or errors:
        raise FlowError(f"sta: {module}: {(errors or output.strip().splitlines()[-1:] or ['no output'])[0]}, see {folder}/{module}.tcl")
    with open(os.path.join(folder, f"{module}.rpt"), "w", encoding="utf-8") as file:
        file.write(output)
    return paths_of(output, period_ps / unit_ps, unit_ps / 1000)


def paths_of(output, period, unit_ns):
    """[{start, end, ns, slack_ns, levels}] of a report, the longest first; recovery of a reset is none."""
    found = []
    for block in re.split(r"(?=^Startpoint: )", output, flags=re.M)[1:]:
        group = re.search(r"^Path Group: (\S+)", block, re.M)
        slack = re.search(r"^\s*(-?[\d.]+)\s+slack", block, re.M)
        if not slack or not group or group.group(1).startswith("**"):
            continue
        start, end = (re.search(rf"^{word}: (\S+)", block, re.M).group(1) for word in ("Startpoint", "Endpoint"))
        levels = len(set(re.findall(r" [v^] (\S+)/\S+ \(", block.split("data arrival time")[0])) - {end})
        left = float(slack.group(1))
        found.append({"start": start, "end": end, "slack_ns": left * unit_ns, "ns": round((period - left) * unit_ns, 3), "levels": levels})
    return sorted(found, key=lambda path: path["slack_ns"])
