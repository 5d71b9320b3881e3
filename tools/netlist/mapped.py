"""A module as a netlist of cells, by Yosys."""
import json
import os
import re
import shutil

import fpga
from asic import defaults, flow, liberty, tech
from asic.cells import Cell
from hdl_flow import Stop, hash_of, sources_of, write
from netlist import models
from netlist.shell import SUFFIX

PERIOD_PS = 20000  # what a library's mapping aims at


def finish(modules, module, registers, folder):
    """Counts beside the netlist; returns the names of its ports."""
    write(os.path.join(folder, "counts.json"), json.dumps(dict(models.count(modules, module, registers), pins=registers)) + "\n")
    return list(modules[module]["ports"])


class Ecp5:
    """LUTs, carry cells, multipliers, flip-flops, LUT RAM and block RAM of an ECP5."""
    name = "ecp5"

    def __init__(self, work):
        self.tools = fpga.Tools(work.arguments.venv or os.path.join(work.arguments.build, "fpga", "venv"), work.say, work.arguments.debian)

    def key(self):
        return self.tools.versions()[0]

    def map(self, module, parameters, folder):
        """Map the module with its parameters into `folder`: netlist.v, the models of its cells; returns its ports."""
        define = "-D SF_NO_TAP " if parameters.get("TAP") == "0" else ""
        chosen = "".join(f" -chparam {name} {value}" for name, value in parameters.items())
        script = (f"read_verilog -sv -defer {define}-Irtl {' '.join(sources_of(folder))}; hierarchy -check -top {module}{chosen}; rename -top {module}{SUFFIX}; "
                  f"synth_ecp5 -top {module}{SUFFIX}; check -assert; write_json netlist.json; "
                  "write_verilog -noattr -noexpr -nohex -nodec netlist.v")
        self.tools.run("yosys", ["-p", script], os.path.join(folder, "yosys.log"), folder)
        write(os.path.join(folder, "cells.v"), models.ecp5(self.tools.share()))
        with open(os.path.join(folder, "netlist.json"), encoding="utf-8") as file:
            return finish(json.load(file)["modules"], module + SUFFIX, {"TRELLIS_FF": "DI"}, folder)

    @staticmethod
    def data_pins(folder):
        return models.counts_of(folder)["pins"]


class Liberty:
    """Standard cells; memories with a registered read port are boxes, as in make asic."""

    def __init__(self, work):
        self.work, path = work, work.arguments.liberty
        if not shutil.which("yosys"):
            raise Stop("yosys is not installed (make deps)", 77)
        defaults.must_exist(path)
        self.library = liberty.Library(path, power=False)
        self.name = tech.name_of(self.library.name)

    def key(self):
        own = self.work.arguments.models
        return hash_of(self.work.arguments.liberty) + (hash_of(own) if own else "")

    def map(self, module, parameters, folder):
        """Map the module with its parameters into `folder`: netlist.v, the models of its cells; returns its ports."""
        gating = any(cell.get("clock_gating_integrated_cell") == "latch_posedge" for cell in self.library.cells.values())
        plain, _ = flow.synthesise(module, parameters, sources_of(folder), self.library, folder, PERIOD_PS, gating, defaults.SKIPPED)
        design = flow.Design(folder, module, plain, self.library)
        path = os.path.join(folder, "netlist.v")
        with open(path, encoding="utf-8") as file:
            text = file.read()
        for name in re.findall(r"^module (sf_\w+)", text, re.M):
            text = re.sub(rf"^((?:module|\s+)\s*){name}(?=[ (])", rf"\g<1>{name}{SUFFIX}", text, flags=re.M)
        write(path, models.TIMESCALE + text)
        kinds = {name: kind for name, kind in design.kinds.items()}
        write(os.path.join(folder, "cells.v"), self.models_of(kinds, design))
        registers = {name: pin for name, kind in kinds.items() for pin in [data_pin(kind)] if pin}
        whole = design.whole(module)
        write(os.path.join(folder, "counts.json"), json.dumps({"cells": whole["cells"], "registers": whole["registers"], "pins": registers}) + "\n")
        return list(design.modules[module]["ports"])

    def models_of(self, kinds, design):
        """The liberty file's functions, or the models that the user named; and the memories."""
        text = models.TIMESCALE + "".join(models.memory(*size) for size in sorted({(memory["words"], memory["width"]) for memory in design.memories()}))
        if self.work.arguments.models:
            with open(self.work.arguments.models, encoding="utf-8") as file:
                return text + file.read()
        return text + "".join(models.cell(kind) for kind in kinds.values())

    @staticmethod
    def data_pins(folder):
        return models.counts_of(folder)["pins"]


def data_pin(kind):
    """The one pin that a flip-flop takes; None for what is no flip-flop, or takes a function of several."""
    if kind.state is None or kind.state.name != "ff":
        return None
    names = kind.expression(kind.state, kind.state.get("next_state"), "next_state").names
    return next(iter(names)) if len(names) == 1 and names <= set(kind.inputs) else None
