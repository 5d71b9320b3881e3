"""Buffers on nets between modules: ABC maps one module at a time and does not see what its outputs drive."""
import json

from asic.cells import Cell

GAIN = 8  # what a net may weigh, in inputs of the buffer


def buffer_of(library, names):
    """A buffer of middle strength, and the fF that it should drive."""
    found = []
    for name in names:
        cell = Cell(library, name)
        if cell.sequential() or len(cell.inputs) != 1 or len(cell.outputs) != 1 or not cell.functions or cell.truth(cell.outputs[0]) != [0, 1]:
            continue
        if "clk" not in name.lower():
            found.append((cell.area, name, cell))
    if not found:
        return None, 0.0
    cell = sorted(found)[len(found) // 2][2]
    return cell, GAIN * cell.capacitance(cell.inputs[0])


class Repair:
    """Modules of a Yosys netlist, changed in place."""

    def __init__(self, modules, library, names):
        self.modules, self.library, self.kinds, self.inside, self.added = modules, library, {}, {}, 0
        self.buffer, self.limit = buffer_of(library, names)

    def kind(self, name):
        if name not in self.kinds:
            self.kinds[name] = Cell(self.library, name)
        return self.kinds[name]

    def loads(self, name):
        """{net: [(cell's name, pin, place in the pin, fF, whether it is a module, whether it is a clock)]} of a module."""
        found = {}
        for cell_name, cell in self.modules[name]["cells"].items():
            kind = cell["type"]
            if kind in self.library.cells:
                here = self.kind(kind)
                for pin, bits in cell["connections"].items():
                    if pin in here.inputs and bits:
                        found.setdefault(bits[0], []).append((cell_name, pin, 0, here.capacitance(pin), False, pin in here.clock_pins()))
            elif kind in self.modules and kind != "sf_memory":
                inner = self.port_loads(kind)
                for pin, bits in cell["connections"].items():
                    for i, bit in enumerate(bits):
                        if (pin, i) in inner:
                            found.setdefault(bit, []).append((cell_name, pin, i, *inner[pin, i][:1], True, inner[pin, i][1]))
        return found

    def port_loads(self, name):
        """{(port, place): (fF behind it, whether clocks are)} of a module's inputs."""
        if name not in self.inside:
            loads = self.loads(name)
            self.inside[name] = {(port, i): (sum(load[3] for load in loads[bit]), any(load[5] for load in loads[bit]))
                                 for port, info in self.modules[name]["ports"].items() if info["direction"] == "input"
                                 for i, bit in enumerate(info["bits"]) if bit in loads}
        return self.inside[name]

    def run(self):
        """Modules from the innermost on, so that what a buffered input weighs is known above."""
        done = set()

        def visit(name):
            if name in done:
                return
            done.add(name)
            for cell in self.modules[name]["cells"].values():
                if cell["type"] in self.modules and cell["type"] not in self.library.cells and cell["type"] != "sf_memory":
                    visit(cell["type"])
            self.repair(name)
        for name in [name for name, module in self.modules.items() if module["cells"] and name not in self.library.cells]:
            visit(name)

    def repair(self, name):
        """Put trees of buffers where a net of the module drives more than the limit."""
        module = self.modules[name]
        fresh = 1 + max((bit for cell in module["cells"].values() for bits in cell["connections"].values() for bit in bits if isinstance(bit, int)),
                        default=0)
        fresh = max([fresh] + [bit + 1 for port in module["ports"].values() for bit in port["bits"] if isinstance(bit, int)])
        for net, sinks in self.loads(name).items():
            if isinstance(net, str) or any(sink[5] for sink in sinks) or not any(sink[4] for sink in sinks):
                continue
            while sum(sink[3] for sink in sinks) > self.limit and len(sinks) > 1:
                sinks, fresh = self.level(module, net, sinks, fresh)
        self.inside.pop(name, None)

    def level(self, module, net, sinks, fresh):
        """Groups the sinks behind buffers; returns the buffers as the net's sinks."""
        groups, total = [[]], 0.0
        for sink in sorted(sinks, key=lambda one: one[3]):
            if groups[-1] and total + sink[3] > self.limit:
                groups.append([])
                total = 0.0
            groups[-1].append(sink)
            total += sink[3]
        if len(groups) == len(sinks):  # each too heavy for company: a buffer for every second
            groups = [sinks[i:i + 2] for i in range(0, len(sinks), 2)]
        pin_in, pin_out = self.buffer.inputs[0], self.buffer.outputs[0]
        result = []
        for group in groups:
            label = f"between_{self.added}"
            self.added += 1
            module["cells"][label] = {"hide_name": 0, "type": self.buffer.name, "parameters": {}, "attributes": {},
                                      "port_directions": {pin_in: "input", pin_out: "output"}, "connections": {pin_in: [net], pin_out: [fresh]}}
            for cell_name, pin, place, *_ in group:
                module["cells"][cell_name]["connections"][pin][place] = fresh
            fresh += 1
            result.append((label, pin_in, 0, self.buffer.capacitance(pin_in), True, False))
        return result, fresh


def repair_file(path, library, names):
    """Rewrites a netlist; returns how many buffers were added."""
    with open(path, encoding="utf-8") as file:
        netlist = json.load(file)
    work = Repair(netlist["modules"], library, names)
    if work.buffer is None or work.limit <= 0:
        return 0
    work.run()
    with open(path, "w", encoding="utf-8") as file:
        json.dump(netlist, file)
    return work.added
