"""Simulation models of the cells that a netlist is made of."""
import json
import os
import re

from asic import bench
from asic.flow import box_name
from hdl_flow import Stop

ECP5 = ["LUT2", "LUT4", "PFUMX", "L6MUX21", "CCU2C", "TRELLIS_DPR16X4", "TRELLIS_FF"]
OWN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "ecp5_cells.v")  # of cells that Yosys has no model of
TIMESCALE = "`timescale 1ns / 1ps\n"


def ecp5(share):
    """Yosys' models of the cells that its mapping uses, without their delays, and our two. share: Yosys' folder ecp5."""
    def included(found):
        path = os.path.join(share, found.group(1))
        return open(path, encoding="utf-8").read() if found.group(1).endswith("_sim.vh") else ""
    path = os.path.join(share, "cells_sim.v")
    if not os.path.exists(path):
        raise Stop(f"{path} is not there: Yosys' models of ECP5's cells")
    with open(path, encoding="utf-8") as file:
        text = re.sub(r'^`include "(.*)"', included, file.read(), flags=re.M)
    models = ""
    for name in ECP5:
        found = re.search(rf"^module {name}\b.*?^endmodule", text, re.M | re.S)
        if not found:
            raise Stop(f"{path}: module {name} is not there")
        models += re.sub(r"^\s*specify\b.*?\bendspecify\b", "", found.group(0), flags=re.M | re.S) + "\n"
    with open(OWN, encoding="utf-8") as file:
        return TIMESCALE + models + file.read()


def cell(kind):
    """A standard cell as its functions in the liberty file say."""
    outputs, body = bench.body_of(kind)
    ports = ", ".join([f"input {pin}" for pin in kind.inputs] + [f"output {pin}" for pin in kind.outputs])
    return f"module \\{kind.name} ({ports});\n{body}" + "".join(f"  assign {pin} = {text};\n" for pin, text in outputs.items()) + "endmodule\n"


def memory(words, width):
    """A memory with a registered read port. A word that is read while it is written is unknown."""
    abits = max(1, (words - 1).bit_length())
    return (f"module {box_name(words, width)} (input clk, input re, input [{abits - 1}:0] raddr, output reg [{width - 1}:0] rdata, input we, "
            f"input [{abits - 1}:0] waddr, input [{width - 1}:0] wdata);\n  reg [{width - 1}:0] mem[0:{words - 1}];\n  always @(posedge clk) begin\n"
            f"    if (we) mem[waddr] <= wdata;\n    if (re) rdata <= we && raddr == waddr ? {width}'bx : mem[raddr];\n  end\nendmodule\n")


def count(modules, top, registers):
    """Cells and registers of a netlist's JSON, instances of modules counted through."""
    own = {"cells": 0, "registers": 0}
    for cell_of in modules[top]["cells"].values():
        kind = cell_of["type"]
        if kind in modules and modules[kind]["cells"]:
            inside = count(modules, kind, registers)
            own = {name: own[name] + inside[name] for name in own}
        elif not kind.startswith("$"):
            own["cells"] += 1
            own["registers"] += kind in registers
    return own


def counts_of(folder):
    with open(os.path.join(folder, "counts.json"), encoding="utf-8") as file:
        return json.load(file)
