#!/usr/bin/env python3
"""The bitstream of a board: rtl/board/NAME, its top, pins and clock, around the accelerator.

usage: board.py BUILD [options]     `make board` calls it; --help has examples

Yosys, nextpnr and ecppack come from PyPI (packages yowasp-*) into BUILD/fpga/venv, as for `make fpga`. A finished step is kept
until the RTL, a tool or the recipe changes."""
import argparse
import json
import os
import shutil
import sys

import xilinx
from fpga import CELLS, DEVICES, Tools, critical_path, keep, kept
from hdl_flow import Spent, Stop, alone, digest, run, sources_of, write

WANTED = {"name": str, "top": str, "device": str, "package": str, "speed": str, "mhz": (int, float), "pins": str, "load": str}


def parse_arguments():
    parser = argparse.ArgumentParser(
        prog="board.py", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Synthesise, place and route the accelerator for a board, check its clock, and pack the bitstream:\n"
        "BUILD/board/NAME/NAME.bit. Where the clock is too fast for what was routed, another placement is tried.\n"
        "Ends with status 1 where it is too fast for all.",
        epilog="""examples:
  make board                          the bitstream for a ULX3S: about 20 minutes a placement
  make board BOARD_FLOW="--tries 6"   up to six placements
  make board BOARD_FLOW="--seed 2"    this placement alone
  make board BOARD=nexys_video        of a board for Vivado: what it needs, by Yosys
  make board BOARD=mine               of rtl/board/mine""")
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
    parser.add_argument("build", help="build folder")
    parser.add_argument("--board", default="ulx3s", metavar="NAME", help="folder below rtl/board (default ulx3s)")
    parser.add_argument("--tries", type=int, default=3, metavar="N", help="placements to try, by seeds 1 to N, until one meets the clock (default 3)")
    parser.add_argument("--seed", type=int, metavar="N", help="the placement of this seed alone")
    parser.add_argument("--rtl", default=root, metavar="DIR", help="folder that holds rtl/ (default: the project's)")
    parser.add_argument("--venv", metavar="DIR", help="environment of the tools (default BUILD/fpga/venv)")
    parser.add_argument("--debian", action="store_true", help="map with the installed yosys, not with PyPI's, which takes a minute to get ready")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    arguments = parser.parse_args()
    if arguments.tries < 1:
        parser.error("--tries: at least 1")
    return arguments


def read_board(path, name):
    """What board.json says; None for a board of Vivado's. Raises Stop with file and field."""
    file = os.path.join(path, "board.json")
    if os.path.exists(os.path.join(path, "vivado.tcl")) and not os.path.exists(file):
        return None
    try:
        board = json.load(open(file, encoding="utf-8"))
    except OSError as error:
        raise Stop(f"there is no board {name}: {file}: {error.strerror}", 2) from None
    except ValueError as error:
        raise Stop(f"{file}: {error}") from None
    for field, kind in WANTED.items():
        if not isinstance(board.get(field), kind):
            raise Stop(f"{file}: {field} is missing or of another kind")
    if board["device"] not in DEVICES:
        raise Stop(f"{file}: device is {board['device']}, expected one of {', '.join(DEVICES)}")
    for source in (board["pins"], board["top"] + ".sv"):
        if not os.path.exists(os.path.join(path, source)):
            raise Stop(f"{os.path.join(path, source)} is not there")
    return board


def sources_of_board(root, name):
    """The RTL with what every board has and this board's own; packages first."""
    folders = ["rtl/board", f"rtl/board/{name}"]
    own = [os.path.join(folder, file) for folder in folders for file in sorted(os.listdir(os.path.join(root, folder)))
           if file.endswith(".sv")]
    return sources_of(root) + own


def text_of_tree(root):
    """All of rtl/, for the key of what is kept."""
    names = sorted(os.path.join(folder, name) for folder, _, files in os.walk(os.path.join(root, "rtl")) for name in files)
    return "".join(open(name, encoding="utf-8").read() for name in names)


class Flow:
    """The steps, each kept beside its result."""

    def __init__(self, arguments, board, say):
        self.arguments, self.board, self.say = arguments, board, say
        self.root = os.path.abspath(arguments.rtl)
        self.folder = os.path.join(os.path.abspath(arguments.build), "board", arguments.board)
        alone(self.folder)
        self.tools = Tools(arguments.venv or os.path.join(arguments.build, "fpga", "venv"), say, arguments.debian)

    def path(self, name):
        return os.path.join(self.folder, name)

    def step(self, what, tool, words, result, key):
        """Runs a tool unless its result is kept."""
        if kept(self.path(result), key):
            return
        self.say(f"{self.arguments.board}: {what}")
        spent = Spent()
        self.tools.run(tool, words, self.path(tool + ".log"), self.folder)
        self.say(f"{self.arguments.board}: {what} took {spent}")
        keep(self.path(result), key)

    def begin(self):
        """The RTL beside the results; its key."""
        # The tools, which run as WebAssembly, see the folder that they work in and no other.
        shutil.rmtree(self.path("rtl"), ignore_errors=True)
        shutil.copytree(os.path.join(self.root, "rtl"), self.path("rtl"))
        return digest(text_of_tree(self.root), *self.tools.versions(), "board 1")

    def synthesise(self):
        """The netlist; returns the key of what it was made from."""
        key = digest(self.begin(), self.board["top"])
        script = (f"read_verilog -sv -defer -D SF_NO_TAP -Irtl {' '.join(sources_of_board(self.root, self.arguments.board))}; "
                  f"synth_ecp5 -top {self.board['top']} -json netlist.json")
        self.step("synthesis", "yosys", ["-p", script], "netlist.json", key)
        return key

    def route(self, key, seed):
        """Place and route; returns nextpnr's report and the key of what it was made from."""
        board, timing = self.board, f"timing-{seed}.json"
        key = digest(key, json.dumps(board), str(seed), "board nextpnr 2")
        self.step(f"place and route, seed {seed}", "nextpnr_ecp5",
                  [f"--{board['device']}", "--package", board["package"], "--speed", board["speed"], "--json", "netlist.json",
                   "--lpf", f"rtl/board/{self.arguments.board}/{board['pins']}", "--seed", str(seed), "--report", timing,
                   "--textcfg", f"routed-{seed}.config", "--timing-allow-fail"], timing, key)
        return json.load(open(self.path(timing), encoding="utf-8")), key

    def pack(self, key, seed):
        name = self.arguments.board + ".bit"
        self.step("bitstream", "ecppack", ["--compress", "--input", f"routed-{seed}.config", "--bit", name], name, key)
        return self.path(name)


def describe(board, report):
    """What it costs and how fast it is: ({}, f_max of the board's clock)."""
    result = {"board": board["name"], "device": DEVICES[board["device"]] + "-" + board["speed"], "mhz": board["mhz"]}
    for name, kind in CELLS.items():
        used = report["utilization"].get(kind, {"used": 0, "available": 0})
        result[name], result[name + "_available"] = used["used"], used["available"]
    clocks = [clock["achieved"] for clock in report["fmax"].values() if clock["constraint"] > 0.99 * board["mhz"]]
    result["f_max_mhz"] = round(min(clocks, default=0), 2)
    result["critical_path"] = critical_path(report)
    return result


def print_result(result):
    """Use of the device, longest path and clock, in three lines."""
    print(f"{result['board']} ({result['device']}): " +
          ", ".join(f"{result[name]} of {result[name + '_available']} {name.replace('_', ' ')}" for name in CELLS))
    path = result["critical_path"]
    if path:
        print(f"longest path {path['ns']} ns, {path['wire_ns']} ns of it on wires: {', '.join(path['names'])}")
    print(f"clock {result['mhz']} MHz, {result['f_max_mhz']} MHz after routing")


def main():
    arguments = parse_arguments()

    def say(text):
        if not arguments.quiet:
            print("board: " + text, file=sys.stderr, flush=True)
    board = read_board(os.path.join(os.path.abspath(arguments.rtl), "rtl", "board", arguments.board), arguments.board)
    flow = Flow(arguments, board, say)
    if not board:
        name = arguments.board
        print(xilinx.resources(flow, name, sources_of_board(flow.root, name), flow.begin()), end="")
        print(f"from Yosys; the bitstream is Vivado's: vivado -mode batch -source rtl/board/{name}/vivado.tcl")
        return 0
    netlist = flow.synthesise()
    seeds = [arguments.seed] if arguments.seed is not None else range(1, arguments.tries + 1)
    best = None
    for seed in seeds:
        report, key = flow.route(netlist, seed)
        result = {**describe(board, report), "seed": seed}
        if not best or result["f_max_mhz"] > best[0]["f_max_mhz"]:
            best = result, key
        if best[0]["f_max_mhz"] >= board["mhz"]:
            break
        say(f"{arguments.board}: seed {seed}: {result['f_max_mhz']} MHz after routing, its clock has {board['mhz']} MHz")
    result, key = best
    write(flow.path("board.json"), json.dumps(result, indent=2) + "\n")
    print_result(result)
    if result["f_max_mhz"] < board["mhz"]:
        raise Stop(f"{board['name']}: {result['f_max_mhz']} MHz after routing, its clock has {board['mhz']} MHz: no bitstream was made; "
                   "another --seed may do, or more --tries")
    bitstream = flow.pack(key, result["seed"])
    print(f"{bitstream}\nput it on the board: {board['load']} {os.path.relpath(bitstream)}")
    return 0


if __name__ == "__main__":
    run("board", main)
