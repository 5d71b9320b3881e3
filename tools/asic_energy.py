#!/usr/bin/env python3
"""What an operation of the accelerator costs in standard cells: prices for energy_audit, taken from netlists.

usage: asic_energy.py BUILD [options]      `make asic-energy` calls it; --help has examples

Blocks of the RTL become netlists of a liberty file's cells (Yosys). Each netlist runs in Icarus on operands that sf_cosim
recorded from a scene, and has to compute what the RTL did. Every edge of every pin is counted and priced with the
library's own tables."""
import argparse
import glob
import json
import os
import re
import shutil
import subprocess
import sys
import time

from asic import bench, defaults, energy, liberty, netlist, pieces, record, tech
from hdl_flow import Stop, alone, digest, hash_of, run, sources_of, write

HERE = os.path.dirname(os.path.abspath(__file__))
CLOCK = "sf_top.clk_i"


def parse_arguments():
    parser = argparse.ArgumentParser(
        prog="asic_energy.py", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Energy of a MAC, a step addition (SOP), a neuron update and a special function in standard cells.\n"
        "Writes BUILD/asic/NAME/energy.json, energy.md and NAME.tech (for energy_audit --tech). A finished block is kept\n"
        "until RTL, library, scene or recipe change.",
        epilog="""examples:
  make asic-energy                                         Debian's qflow-tech-osu018, the demo's scene
  make asic-energy LIBERTY=../shared/data/liberty/sky130hd_tt.lib.gz NAME=sky130
  make asic-energy SCENE=build/lego/scene.snn DATA=../shared/data/lego
  tools/asic_energy.py build --liberty my.lib --name mine --node 65 --cycles 4000
  build/bin/energy_audit build/demo/scene.snn build/demo/scene --tech build/asic/osu018/osu018.tech""")
    parser.add_argument("build", help="build folder: bin/sf_cosim records the operands")
    parser.add_argument("--liberty", default=defaults.LIBERTY, metavar="FILE", help=f"cells: .lib or .lib.gz (default {defaults.LIBERTY})")
    parser.add_argument("--name", metavar="NAME", help="of the technology (default: the library's)")
    parser.add_argument("--node", type=float, metavar="NM", help="feature size, to which published memory prices are scaled (default: 180 of "
                        "osu018, 130 of sky130)")
    parser.add_argument("--scene", metavar="FILE.snn", help="scene whose operands are recorded (default BUILD/demo/scene.snn)")
    parser.add_argument("--data", metavar="FOLDER", help="the scene's data set (default BUILD/demo/scene)")
    parser.add_argument("--cycles", type=int, default=1500, metavar="N", help="cycles to record, from a stream's first on (default 1500)")
    parser.add_argument("--clock", type=float, default=40, metavar="MHZ", help="clock of the netlists (default 40)")
    parser.add_argument("--gating", choices=["on", "off"], default="on", help="registers with an enable: a gated clock, or a multiplexer (default on)")
    parser.add_argument("--skip", action="append", metavar="PATTERN", help=f"cells that are not used (default {' '.join(defaults.SKIPPED)})")
    parser.add_argument("--blocks", default="", metavar="\"NAME...\"", help="these alone, without a technology file")
    parser.add_argument("--rtl", default=os.path.join(HERE, ".."), metavar="DIR", help="folder that holds rtl/ (default: the project's)")
    parser.add_argument("--json", action="store_true", help="print the JSON instead of the tables")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    arguments = parser.parse_args()
    if bool(arguments.scene) != bool(arguments.data):
        parser.error("--scene and --data go together")
    if arguments.cycles < 2 * bench.WARM_UP:
        parser.error(f"--cycles: at least {2 * bench.WARM_UP}, of which {bench.WARM_UP} are not counted")
    if not 1 <= arguments.clock <= 2000:
        parser.error("--clock: 1 to 2000 MHz")
    return arguments


def version_of(tool, *options):
    if not shutil.which(tool):
        raise Stop(f"{tool} is not installed (make deps)", 77)
    done = subprocess.run([tool, *options], capture_output=True, text=True, check=False)
    return (done.stdout + done.stderr).splitlines()[0].strip()


class Work:
    """One run: library, folders, options, and what is kept."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.root = os.path.abspath(arguments.rtl)
        self.build = os.path.abspath(arguments.build)
        self.started = time.monotonic()
        self.skipped = arguments.skip or defaults.SKIPPED
        self.period = round(1e6 / arguments.clock)
        self.scene = os.path.abspath(arguments.scene or os.path.join(self.build, "demo", "scene.snn"))
        self.data = os.path.abspath(arguments.data or os.path.join(self.build, "demo", "scene"))
        self.tools = {"yosys": version_of("yosys", "-V"), "iverilog": version_of("iverilog", "-V"), "sta": shutil.which("sta")}
        if not os.path.exists(os.path.join(self.root, "rtl", "sf_top.sv")):
            raise Stop(f"{self.root}/rtl/sf_top.sv is not there")
        defaults.must_exist(arguments.liberty)
        if not os.path.exists(self.scene):
            raise Stop(f"{self.scene}: not there; make demo makes it, or name another with SCENE= and DATA=")
        self.library = liberty.Library(arguments.liberty)
        if not arguments.node and tech.node_of(self.library.name) is None:
            raise Stop(f"{arguments.liberty}: its name ('{self.library.name}') tells no feature size; say it, e.g. NODE=65 (--node 65)", 2)
        self.name = arguments.name or tech.name_of(self.library.name)
        self.folder = os.path.join(self.build, "asic", self.name)
        alone(os.path.join(self.build, "asic"))
        os.makedirs(self.folder, exist_ok=True)

    def say(self, text):
        if not self.arguments.quiet:
            print("asic-energy: " + text, file=sys.stderr, flush=True)

    def sources(self):
        """RTL files, packages first, then the wrappers of this tool."""
        return sources_of(self.root) + sorted(glob.glob(os.path.join(HERE, "asic", "*.sv")))

    def files_of(self, module):
        """Files of a module and of all that it names, in order of their names."""
        files = {os.path.splitext(os.path.basename(name))[0]: os.path.join(self.root, name) for name in self.sources()}
        found, left = set(), [module]
        while left:
            name = left.pop()
            if name in found or name not in files:
                continue
            found.add(name)
            with open(files[name], encoding="utf-8") as file:
                left += re.findall(r"\b(?:sf|asic)_\w+", file.read())
        return sorted(files[name] for name in found)

    def key(self, piece):
        """Of all that a block's result comes from: steps of this tool, the RTL that it uses, library, scene, options."""
        recipe = [hash_of(path) for path in sorted(glob.glob(os.path.join(HERE, "asic", "*.py"))) if not path.endswith(("tech.py", "pieces.py"))]
        rtl = [hash_of(path) for path in self.files_of(piece.module)]
        a = self.arguments
        return digest(*recipe, *rtl, digest(self.library.text), hash_of(self.scene), piece.words(), str(a.cycles),
                      str(a.clock), a.gating, *self.skipped, self.tools["yosys"], self.tools["iverilog"])


def kept(path, key):
    """The JSON of an earlier run, if it was made with the same `key`; None otherwise."""
    try:
        with open(path, encoding="utf-8") as file:
            found = json.load(file)
        return found if found.get("key") == key else None
    except (OSError, ValueError):
        return None


def synthesise(work, piece):
    """The piece's netlist, its slews and delays settled."""
    folder = os.path.join(work.folder, piece.name)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    os.symlink(os.path.join(work.root, "rtl"), os.path.join(folder, "rtl"))
    started = time.monotonic()
    netlist.synthesise(piece, work.sources(), work.library, folder, work.period, work.arguments.gating == "on", work.skipped)
    made = netlist.Netlist(os.path.join(folder, "netlist.json"), piece, work.library)
    made.propagate()
    work.say(f"{piece.name}: {len(made.instances)} cells, {time.monotonic() - started:.0f} s")
    return made


def record_scene(work, wanted):
    """The wanted nets of the accelerator while it works on the scene."""
    path = os.path.join(work.build, "asic", "recording.vcd")
    command = [os.path.join(work.build, "bin", "sf_cosim"), work.scene, work.data, "--rays", str(max(20, work.arguments.cycles // 10)), "--seed", "1",
               "--vcd", path, "--window", f"0,{work.arguments.cycles + 1}", "--quiet"]
    if not os.path.exists(command[0]):
        raise Stop(f"{command[0]}: not there (make all)")
    work.say(f"recording {work.arguments.cycles} cycles of {os.path.relpath(work.scene)}")
    done = subprocess.run(["nice", "-n", "10"] + command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Stop(f"sf_cosim: {(done.stderr or done.stdout).strip()}")
    values = record.read_vcd(path, wanted, CLOCK, work.arguments.cycles)
    os.remove(path)
    return values


def measure(work, piece, made, values):
    """Runs the netlist and sums up what it cost."""
    started = time.monotonic()
    piece.prepare(work, os.path.join(work.folder, piece.name))
    taken = piece.record(made, values, round(piece.share * work.arguments.cycles))
    events, active, cycles = pieces.counted_events(taken)
    if events == 0:
        raise Stop(f"{piece.name}: no event in {cycles} cycles of the scene: more --cycles?")
    folder = os.path.join(work.folder, piece.name)
    busy, idle, compared = bench.run(made, taken, piece.clock, piece.idle, work.period, folder)
    result = {"module": piece.module, "parameters": piece.parameters, "lanes": piece.lanes, "cells": len(made.instances),
              "registers": sum(one.cell.sequential() and not one.cell.gate for one in made.instances),
              "area_um2": sum(one.cell.area for one in made.instances), "wire_ff": made.wire_ff, "compared": compared, "events": events, "active": active,
              "cycles": cycles,
              "busy": energy.sum_up(made, busy, cycles), "idle_fj_per_cycle": energy.sum_up(made, idle, bench.IDLE)["fj"] / bench.IDLE,
              "leakage_nw": energy.leakage_nw(made)}
    for name in ("bench.vvp", "operands.txt", "want.txt", "care.txt"):
        os.remove(os.path.join(folder, name))
    work.say(f"{piece.name}: {events} events in {cycles} cycles, {result['busy']['fj'] / events / piece.lanes:.0f} fJ each, {time.monotonic() - started:.0f} s")
    return result


def main():
    arguments = parse_arguments()
    work = Work(arguments)
    chosen = [piece for piece in pieces.all_pieces(work.root) if not arguments.blocks or piece.name in arguments.blocks.split()]
    if not chosen:
        raise Stop(f"--blocks: none of '{arguments.blocks}' is one of {', '.join(piece.name for piece in pieces.all_pieces(work.root))}", 2)
    work.say(f"{work.library.name}: {len(work.library.cells)} cells, {work.library.voltage:g} V" +
             (f"; {work.tools['sta']} is there, but energies are added up here, edge by edge" if work.tools["sta"] else ""))
    results, left, keys = {}, [], {piece.name: work.key(piece) for piece in chosen}
    for piece in chosen:
        found = kept(os.path.join(work.folder, piece.name + ".json"), keys[piece.name])
        if found:
            results[piece.name] = found
            work.say(f"{piece.name}: kept")
        else:
            left.append(piece)
    made = [(piece, synthesise(work, piece)) for piece in left]
    wanted = {name for piece, one in made for name in piece.wanted(one)}
    values = record_scene(work, wanted) if wanted else {}
    for piece, one in made:
        result = measure(work, piece, one, values)
        result["key"] = keys[piece.name]
        write(os.path.join(work.folder, piece.name + ".json"), json.dumps(result, indent=2) + "\n")
        results[piece.name] = result
    report = tech.report_of(work, results)
    write(os.path.join(work.folder, "energy.json"), json.dumps(report, indent=2) + "\n")
    write(os.path.join(work.folder, "energy.md"), tech.table_of(report))
    if not arguments.blocks:
        write(os.path.join(work.folder, work.name + ".tech"), tech.file_of(report))
        work.say(f"{os.path.join(work.folder, work.name + '.tech')} is written")
    print(json.dumps(report, indent=2) if arguments.json else tech.table_of(report), end="\n" if arguments.json else "")
    return 0


if __name__ == "__main__":
    run("asic-energy", main, (liberty.LibertyError, netlist.NetlistError, bench.BenchError, record.RecordError))
