#!/usr/bin/env python3
"""The energy of a known sequence of edges in a netlist of three cells (tiny.lib), against the sum made by hand.

usage: by_hand.py LIBERTY FOLDER

    a -> INV -> n1 -> NAND(n1, b) -> n2 -> DFF(n2, clk) -> q"""
import json
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tools"))
from asic import bench, energy, liberty, netlist, pieces, record  # noqa: E402

A, B, CLK, N1, N2, Q = 2, 3, 4, 5, 6, 7
# Eight cycles: b rises (n2 falls), q falls; a rises (n1 falls, n2 rises), q rises; b falls; a falls (n1 rises).
SEQUENCE_A, SEQUENCE_B, SEQUENCE_Q = "00011000", "01110000", "11001111"


def write_netlist(path):
    def cell(kind, outputs, **pins):
        return {"type": kind, "connections": {pin: [net] for pin, net in pins.items()},
                "port_directions": {pin: "output" if pin in outputs else "input" for pin in pins}}
    module = {"ports": {"a": {"direction": "input", "bits": [A]}, "b": {"direction": "input", "bits": [B]},
                        "clk_i": {"direction": "input", "bits": [CLK]}, "q": {"direction": "output", "bits": [Q]}},
              "cells": {"x": cell("INV", "Y", A=A, Y=N1), "y": cell("NAND", "Y", A=N1, B=B, Y=N2), "z": cell("DFF", "Q", D=N2, CLK=CLK, Q=Q)}}
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"modules": {"probe": module}}, file)


def by_hand():
    """Voltage 2 V: an edge of a net costs 2 C. Wire of a pin: 4 widths of a cell of 16 um2, 0.2 fF/um: 3.2 fF."""
    load = {"a": 2 + 3.2, "b": 4 + 3.2, "n1": 3 + 3.2, "n2": 5 + 3.2, "clk": 6 + 3.2, "q": 3.2}
    slew_n1 = (40 + 20) / 2  # of the inputs 100
    nets = 2 * (2 * (load["a"] + load["b"] + load["n1"] + load["n2"] + load["q"]) + 16 * load["clk"])
    inverter = (10 + 0.5 * load["n1"] + 0.1 * 100) + (6 + 0.25 * load["n1"] + 0.05 * 100)
    # Pin A of the NAND: falls while b is 1, rises while b is 0. Its output falls by b, rises by A.
    nand = 2 + (3 + 2 * slew_n1 / 200) + (5 + 0.1 * load["n2"] + 0.01 * 100) + (8 + 0.2 * load["n2"])
    register = 8 * (12 + 4) + (20 + 0.5 * load["q"]) + 18
    return {"net_fj": nets, "internal_fj": inverter + nand + register, "leakage_nw": 1.5 + 2 + 4}


def main():
    library, folder = liberty.Library(sys.argv[1]), sys.argv[2]
    write_netlist(os.path.join(folder, "netlist.json"))
    made = netlist.Netlist(os.path.join(folder, "netlist.json"), pieces.Piece("probe", "probe", "", []), library)
    made.propagate()

    def stream(first, text):
        return [first] * bench.WARM_UP + list(text)
    inputs = {"a": stream("0", SEQUENCE_A), "b": stream("0", SEQUENCE_B)}
    cycles = bench.WARM_UP + 8
    taken = record.Record(inputs, {"q": stream("1", SEQUENCE_Q)}, [1] * cycles, cycles)
    busy, idle, compared = bench.run(made, taken, "clk_i", (), 20000, folder)
    found = dict(energy.sum_up(made, busy, 8), leakage_nw=energy.leakage_nw(made))
    wrong = [f"{name}: {found[name]!r}, by hand {value!r}" for name, value in by_hand().items() if abs(found[name] - value) > 1e-9 * value]
    idle_fj = energy.sum_up(made, idle, bench.IDLE)["fj"]
    if abs(idle_fj - bench.IDLE * (12 + 4 + 2 * 2 * 9.2)) > 1e-9 * idle_fj:
        wrong.append(f"idle: {idle_fj!r}, by hand {bench.IDLE * (12 + 4 + 2 * 2 * 9.2)!r}")
    if compared != 1.0:
        wrong.append(f"{compared} of the outputs are compared")
    # A netlist that computes something else is found.
    try:
        taken.outputs["q"] = stream("1", "11011111")
        bench.run(made, taken, "clk_i", (), 20000, folder)
        wrong.append("an output that differs is not found")
    except bench.BenchError as error:
        if "differ in 1 cycles, first in cycle 259: q[0]" not in str(error):
            wrong.append(f"another difference is found: {error}")
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{found['fj']:.3f} fJ, as by hand")


if __name__ == "__main__":
    main()
