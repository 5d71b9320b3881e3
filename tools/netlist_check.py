#!/usr/bin/env python3
"""Does the netlist still compute what the fixed-point core computes? The vector kit's vectors through the mapped netlist.

usage: netlist_check.py BUILD [options]      `make netlist-check` calls it; --help has examples"""
import argparse
import json
import os
import re
import shutil
import subprocess
import sys

from asic import defaults, liberty
from asic.flow import FlowError
from asic.netlist import NetlistError
from hdl_flow import Spent, Stop, alone, digest, run, sources_of, write
from netlist import kit, mapped, models, plant, shell

TOP = "sf_top"
SMALL = f"{TOP}:LANES=32,MACS=8,NEURONS=4"
HERE = os.path.dirname(os.path.abspath(__file__))


def parse_arguments():
    parser = argparse.ArgumentParser(
        prog="netlist_check.py", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Maps the accelerator to cells (Yosys), runs the vector kit's vectors through the netlist, and compares results, spikes,\n"
        "membranes, rows and counters with the fixed-point core. Then plants errors in the netlist. Ends with status 1 when the\n"
        "netlist differs, or when none of the planted errors is found.\n"
        "Writes BUILD/netlist/netlist.json, netlist.md and a folder per netlist. A finished mapping is kept.",
        epilog=f"""examples:
  make netlist-check                                        a neuron unit in ECP5 cells and in Debian's osu018
  make netlist-check CELLS=ecp5 MODULES="sf_plif sf_readout"       some modules, the rest of the block as RTL
  make netlist-check LIBERTY=../shared/data/liberty/sky130hd_tt.lib.gz CELLS=liberty
  tools/netlist_check.py build --cells ecp5 --scene scene.snn --data data --modules "sf_top:TAP=0" --json""")
    parser.add_argument("build", help="build folder")
    parser.add_argument("--cells", default="ecp5 liberty", metavar="\"ecp5 liberty\"", help="what to map to (default both)")
    parser.add_argument("--modules", default=SMALL, metavar="\"NAME[:PARAMETER=N,...] ...\"",
                        help=f"netlists of these; around one that is not {TOP} stands the block as RTL (default {SMALL}; make netlist-check: sf_plif)")
    parser.add_argument("--block", default=SMALL.partition(":")[2], metavar="PARAMETER=N,...", help="the block around a module (default that of the small one)")
    parser.add_argument("--liberty", default=defaults.LIBERTY, metavar="FILE", help=f"standard cells: .lib or .lib.gz (default {defaults.LIBERTY})")
    parser.add_argument("--models", metavar="FILE", help="Verilog models of the standard cells (default: the functions in the liberty file)")
    parser.add_argument("--debian", action="store_true", help="map to ECP5 with the installed yosys, not with the one of make fpga")
    parser.add_argument("--venv", metavar="DIR", help="environment of make fpga's tools (default BUILD/fpga/venv)")
    parser.add_argument("--scene", metavar="FILE.snn", help="scene of the vectors (default: one of 32 neurons a layer is trained)")
    parser.add_argument("--data", metavar="FOLDER", help="the scene's data set")
    parser.add_argument("--samples", type=int, default=2000, metavar="N", help="samples to compare (default 2000)")
    parser.add_argument("--simulator", choices=["verilator", "icarus"], default="verilator", help="default verilator")
    parser.add_argument("--plant", type=int, default=2, metavar="N", help="errors to plant, one after another (default 2)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="which registers get a planted error (default 1)")
    parser.add_argument("--rtl", default=os.path.join(HERE, ".."), metavar="DIR", help="folder that holds rtl/ (default: the project's)")
    parser.add_argument("--json", action="store_true", help="print the JSON instead of the table")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    arguments = parser.parse_args()
    if bool(arguments.scene) != bool(arguments.data):
        parser.error("--scene and --data go together")
    if not 1 <= arguments.samples <= 100000 or not 0 <= arguments.plant <= 1000:
        parser.error("--samples: 1 to 100000; --plant: 0 to 1000")
    for cells in arguments.cells.split():
        if cells not in ("ecp5", "liberty"):
            parser.error(f"--cells: '{cells}' is neither ecp5 nor liberty")
    return arguments


class Work:
    """Folders and options of a run."""

    def __init__(self, arguments):
        self.arguments, self.root = arguments, os.path.abspath(arguments.rtl)
        self.folder = os.path.join(os.path.abspath(arguments.build), "netlist")
        self.programs = os.path.join(os.path.abspath(arguments.build), "bin")
        self.sources = sources_of(self.root)
        alone(self.folder)

    def say(self, text):
        if not self.arguments.quiet:
            print("netlist: " + text, file=sys.stderr, flush=True)

    def mapper(self, cells):
        if cells == "ecp5":
            return mapped.Ecp5(self)
        return mapped.Liberty(self)


class Check:
    """One netlist: its folder, and the sources that put it into the block."""

    def __init__(self, work, mapper, text):
        self.work, self.mapper, self.text = work, mapper, text
        self.module, self.parameters = shell.module_of(text, work.root)
        self.folder = os.path.join(work.folder, mapper.name, re.sub(r"[^A-Za-z0-9_]+", "-", text))
        self.with_tap = self.module != TOP or self.parameters.get("TAP") != "0"
        self.block = self.parameters if self.module == TOP else dict(part.split("=", 1) for part in work.arguments.block.split(",") if "=" in part)

    def key(self):
        recipe = [os.path.join(HERE, name) for name in ("netlist_check.py", "netlist/mapped.py", "netlist/shell.py", "netlist/models.py", "netlist/ecp5_cells.v")]
        rtl = [os.path.join(self.work.root, name) for name in self.work.sources]
        return digest(self.text, str(self.block), self.mapper.key(), *(open(path, encoding="utf-8").read() for path in recipe + rtl))

    def make(self):
        """netlist.v, cells.v, the shell with the module's name and ports, and the list of all sources."""
        key_path, key = os.path.join(self.folder, "key"), self.key()
        try:
            with open(key_path, encoding="utf-8") as file:
                if file.read() == key:
                    self.work.say(f"{self.text} in {self.mapper.name}: the netlist is kept")
                    return
        except OSError:
            pass
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(os.path.join(self.work.root, "rtl"), os.path.join(self.folder, "rtl"))
        spent = Spent()
        self.work.say(f"{self.text} in {self.mapper.name}: mapping")
        ports = self.mapper.map(self.module, self.parameters, self.folder)
        self.work.say(f"{self.text} in {self.mapper.name}: mapping took {spent}")
        shell.write_shell(self.module, self.parameters, ports, self.folder)
        write(os.path.join(self.folder, "netlist.f"), "\n".join(shell.listed(self, TOP)) + "\n")
        write(key_path, key)

    def sources(self, swapped=None):
        """Absolute names in the order of compilation; the netlist's may be another."""
        with open(os.path.join(self.folder, "netlist.f"), encoding="utf-8") as file:
            names = [line for line in file.read().split("\n") if line and not line.startswith("+")]
        return [swapped if swapped and name == "netlist.v" else os.path.join(self.folder, name) for name in names]

    def simulate(self, where, simulator, swapped=None, build="sim", argument=""):
        """(passed, the bench's line, samples, seconds of processor time) of the kit on this netlist."""
        return kit.simulate(where, simulator, self.sources(swapped), os.path.join(self.folder, "rtl"), os.path.join(self.folder, build),
                            self.block.get("LANES"), self.with_tap, self.whole(), argument)

    def whole(self):
        """The accelerator itself: its cells take minutes to build, and too long in Icarus."""
        return self.module == TOP


def planted(check, kits):
    """Errors in the netlist, one at a time: a register takes the inverse of its next state. [{register, found, said}]

    What the first samples do not show, all of them may: a bit that is rounded away in most of them."""
    found, pins, wanted = [], check.mapper.data_pins(check.folder), check.work.arguments
    with open(os.path.join(check.folder, "netlist.v"), encoding="utf-8") as file:
        text = file.read()
    places = plant.choose(plant.registers(text, pins), plant.States(check.folder, pins).own, wanted.plant, wanted.seed)
    path = os.path.join(check.folder, "planted.v")
    write(path, plant.plant(text, places))
    simulator = "icarus" if shutil.which("iverilog") and not check.whole() else wanted.simulator
    for number, (name, _, _) in enumerate(places, 1):
        check.work.say(f"{check.text} in {check.mapper.name}: planted error {number} of {len(places)}, {name} takes the inverse")
        argument = f"+{plant.CHOICE}={number}"
        passed, said, _, _ = check.simulate(kits.short(), simulator, swapped=path, build="planted", argument=argument)
        if passed and kits.whole() != kits.short():
            check.work.say(f"{check.text} in {check.mapper.name}: the first samples do not show it: all of them")
            passed, said, _, _ = check.simulate(kits.whole(), wanted.simulator, swapped=path, build="planted-whole", argument=argument)
        found.append({"register": name, "found": not passed, "said": said})
    return found


def measure(check, kits):
    """Build and simulate one netlist against the kit, and with planted errors; returns its result."""
    check.make()
    arguments = check.work.arguments
    check.work.say(f"{check.text} in {check.mapper.name}: {arguments.samples} samples in {arguments.simulator}")
    passed, said, samples, seconds = check.simulate(kits.whole(), arguments.simulator)
    result = {"cells": check.mapper.name, "module": check.module, "parameters": check.parameters, "counts": models.counts_of(check.folder),
              "simulator": arguments.simulator, "tap": check.with_tap, "passed": passed, "said": said, "samples": samples if passed else 0,
              "seconds": seconds, "list": os.path.join(check.folder, "netlist.f"), "planted": []}
    if passed and arguments.plant:
        result["planted"] = planted(check, kits)
    return result


def failed(result):
    """A netlist that differs; or a check that finds none of the planted errors: it is blind."""
    return not result["passed"] or (result["planted"] != [] and not any(error["found"] for error in result["planted"]))


def table_of(results):
    """The results as Markdown, with a note for each netlist."""
    lines = ["| netlist | cells of | cells | registers | samples compared | differences | s of processor time | planted errors found |", "|---|---|---|---|---|---|---|---|"]
    notes = []
    for name, result in results.items():
        hits = sum(error["found"] for error in result["planted"])
        lines.append(f"| `{name.split(' ', 1)[1]}` | {result['cells']} | {result['counts']['cells']} | {result['counts']['registers']} | {result['samples']}"
                     f" | {0 if result['passed'] else 'yes'} | {result['seconds']:.0f} | {hits} of {len(result['planted'])} |")
        notes.append(f"`{name}`: {result['said']}")
        notes += [f"`{name}`: {error['register']} inverted: {error['said'] if error['found'] else 'NOT FOUND, no sample shows it'}" for error in result["planted"]]
        if result["tap"]:
            notes.append(f"`{name}`: sf_cosim SCENE DATA --dut \"-F {result['list']}\"")
    return "\n".join(lines + [""] + notes) + "\n"


def main():
    arguments = parse_arguments()
    if not os.path.exists(os.path.join(arguments.rtl, "rtl", TOP + ".sv")):
        raise Stop(f"{arguments.rtl}/rtl/{TOP}.sv is not there")
    work = Work(arguments)
    kits = kit.Kits(work)
    results = {}
    for cells in arguments.cells.split():
        mapper = work.mapper(cells)
        for text in arguments.modules.split():
            results[f"{mapper.name} {text}"] = measure(Check(work, mapper, text), kits)
            write(os.path.join(work.folder, "netlist.json"), json.dumps(results, indent=2) + "\n")
            write(os.path.join(work.folder, "netlist.md"), table_of(results))
    print(json.dumps(results, indent=2) if arguments.json else table_of(results), end="\n" if arguments.json else "")
    return 1 if any(failed(result) for result in results.values()) else 0


if __name__ == "__main__":
    run("netlist", main, (liberty.LibertyError, NetlistError, FlowError))
