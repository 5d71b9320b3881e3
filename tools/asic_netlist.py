#!/usr/bin/env python3
"""The accelerator as a netlist of standard cells: area and longest path of each module, and what a layout tool needs.

usage: asic_netlist.py BUILD [options]      `make asic` calls it; --help has examples"""
import argparse
import glob
import json
import os
import re
import shutil
import subprocess
import sys

from asic import defaults, flow, liberty, netlist, tech
from hdl_flow import Spent, Stop, alone, digest, hash_of, module_of, run, sources_of, write

HERE = os.path.dirname(os.path.abspath(__file__))
TOP = "sf_ray_top:TAP=0,MACS=64,NEURONS=8,PLANES=0"


def parse_arguments():
    parser = argparse.ArgumentParser(
        prog="asic_netlist.py", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Synthesis (Yosys), area and timing (OpenSTA) in the cells of a liberty file. Memories with a registered read\n"
        "port are boxes. Writes BUILD/asic/NAME/netlist/MODULE: report.json, report.md and the folder handover. What is finished\n"
        "is kept until RTL, library or recipe change.",
        epilog=f"""examples:
  make asic                                              the block of the board ({TOP}) in Debian's osu018
  make asic LIBERTY=../shared/data/liberty/sky130hd_tt.lib.gz MODULES="sf_core:TAP=0" MHZ=100
  tools/asic_netlist.py build --modules "sf_plif sf_readout" --json""")
    parser.add_argument("build", help="build folder")
    parser.add_argument("--liberty", default=defaults.LIBERTY, metavar="FILE", help=f"cells: .lib or .lib.gz (default {defaults.LIBERTY})")
    parser.add_argument("--name", metavar="NAME", help="of the technology (default: the library's)")
    parser.add_argument("--modules", default=TOP, metavar="\"NAME[:PARAMETER=N,...] ...\"", help=f"build these (default {TOP})")
    parser.add_argument("--clock", type=float, default=50, metavar="MHZ", help="the clock that is aimed at (default 50)")
    parser.add_argument("--gating", choices=["on", "off", "auto"], default="auto",
                        help="registers with an enable: a gated clock, or a multiplexer (default: gated where the library has a cell for it)")
    parser.add_argument("--skip", action="append", metavar="PATTERN", help=f"cells that are not used (default {' '.join(defaults.SKIPPED)})")
    parser.add_argument("--saif", metavar="FILE", help="activity for the handover (sf_cosim --saif)")
    parser.add_argument("--rtl", default=os.path.join(HERE, ".."), metavar="DIR", help="folder that holds rtl/ (default: the project's)")
    parser.add_argument("--json", action="store_true", help="print the JSON instead of the tables")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    arguments = parser.parse_args()
    if not 1 <= arguments.clock <= 2000:
        parser.error("--clock: 1 to 2000 MHz")
    if arguments.saif and not os.path.exists(arguments.saif):
        parser.error(f"--saif: {arguments.saif} is not there")
    return arguments


class Work:
    """Library, folders, options."""

    def __init__(self, arguments):
        self.arguments, self.root = arguments, os.path.abspath(arguments.rtl)
        for tool in ("yosys", "sta"):
            if not shutil.which(tool):
                raise Stop(f"{tool} is not installed (make deps-asic)", 77)
        defaults.must_exist(arguments.liberty)
        self.library = liberty.Library(arguments.liberty, power=False)
        if not any(cell.get("area") and float(cell.get("area")) > 0 for cell in self.library.cells.values()):
            self.library.fail(self.library.top, "no cell has an area")
        self.name = arguments.name or tech.name_of(self.library.name)
        alone(os.path.join(os.path.abspath(arguments.build), "asic", self.name, "netlist"))
        self.period_ps = round(1e6 / arguments.clock)
        self.skipped = arguments.skip or defaults.SKIPPED
        own_gate = any(cell.get("clock_gating_integrated_cell") == "latch_posedge" for cell in self.library.cells.values())
        self.gating = arguments.gating == "on" or (arguments.gating == "auto" and own_gate)
        versions = [subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL).stdout.splitlines()[:1]
                    for command in (["yosys", "-V"], ["sta", "-version"])]
        self.versions = [line[0] if line else "unknown" for line in versions]

    def say(self, text):
        if not self.arguments.quiet:
            print("asic: " + text, file=sys.stderr, flush=True)

    def key(self, text):
        recipe = [hash_of(path) for path in sorted(glob.glob(os.path.join(HERE, "asic", "*.py")) + [os.path.abspath(__file__)])]
        rtl = [hash_of(os.path.join(self.root, name)) for name in sources_of(self.root)]
        return digest(*recipe, *rtl, hash_of(self.arguments.liberty), text, str(self.period_ps), str(self.gating), *self.skipped, *self.versions)


class Build:
    """One top module with its parameters."""

    def __init__(self, work, text):
        self.text = text
        self.module, self.parameters = module_of(text, work.root)
        self.folder = os.path.join(os.path.abspath(work.arguments.build), "asic", work.name, "netlist", re.sub(r"[^A-Za-z0-9_]+", "-", text))


def clocked(design, name):
    ports = design.modules[name]["ports"]
    return "" if "clk_i" not in ports else "reset" if "rst_ni" in ports else "clock"


def measure(work, build):
    """The netlist, and of each of its modules area and longest path."""
    shutil.rmtree(build.folder, ignore_errors=True)
    os.makedirs(build.folder)
    os.symlink(os.path.join(work.root, "rtl"), os.path.join(build.folder, "rtl"))
    spent = Spent()
    work.say(f"{build.text}: synthesis")
    plain, _ = flow.synthesise(build.module, build.parameters, sources_of(work.root), work.library, build.folder, work.period_ps,
                               work.gating, work.skipped)
    work.say(f"{build.text}: synthesis took {spent}")
    design = flow.Design(build.folder, build.module, plain, work.library)
    times, modules = design.instances(), {}
    for number, name in enumerate(times, 1):
        work.say(f"{build.text}: timing of {name}, {number} of {len(times)}")
        whole = design.whole(name)
        paths = flow.sta(name, clocked(design, name), work.period_ps, work.library.time, build.folder)
        modules[name] = {"instances": times[name], "own_area_um2": design.own[name]["area_um2"], **whole, "path": paths[0] if paths else None}
    top = modules[build.module]
    if top["path"]:
        top["path"]["start"], top["path"]["end"] = design.signal_of(top["path"]["start"]), design.signal_of(top["path"]["end"])
    return {"format": "spikefield-asic-1", "module": build.module, "parameters": build.parameters, "library": work.library.name,
            "voltage": work.library.voltage, "clock_mhz": work.arguments.clock, "gating": work.gating, "tools": work.versions,
            "modules": modules, "memories": design.memories()}


def hand_over(work, build, result):
    """A folder for a layout tool: netlist, constraints, memories, activity, scripts."""
    folder = os.path.join(build.folder, "handover")
    os.makedirs(folder, exist_ok=True)
    for source, target in (("netlist.v", "netlist.v"), (build.module + ".sdc", "constraints.sdc")):
        shutil.copy(os.path.join(build.folder, source), os.path.join(folder, target))
    if work.arguments.saif:
        shutil.copy(work.arguments.saif, os.path.join(folder, "activity.saif"))
    write(os.path.join(folder, "memories.v"), flow.boxes_of(result["memories"]) or "// no memories\n")
    write(os.path.join(folder, "memories.json"), json.dumps(result["memories"], indent=2) + "\n")
    write(os.path.join(folder, "timing.tcl"), f"# sta timing.tcl, with LIBERTY in the environment\nread_liberty $::env(LIBERTY)\nread_verilog netlist.v\n"
          f"link_design {build.module}\nread_sdc constraints.sdc\nreport_checks -path_delay max -digits 3\n")
    platform = "sky130hd" if work.library.name.startswith("sky130_fd_sc_hd") else "# the name of your platform"
    write(os.path.join(folder, "config.mk"), f"# For OpenROAD-flow-scripts: make DESIGN_CONFIG=.../config.mk. Boxes (memories.json) need a LEF and a LIB each.\n"
          f"export DESIGN_NAME = {build.module}\nexport PLATFORM = {platform}\nexport SYNTH_NETLIST_FILES = $(dir $(DESIGN_CONFIG))netlist.v\n"
          f"export SDC_FILE = $(dir $(DESIGN_CONFIG))constraints.sdc\nexport CORE_UTILIZATION = 40\n")


def table_of(results):
    """The results as Markdown: modules, memories, notes."""
    lines = []
    for text, result in results.items():
        lines += [f"`{text}`: {result['library']}, {result['voltage']:g} V, {result['clock_mhz']:g} MHz, clock gating {'on' if result['gating'] else 'off'}", "",
                  "| module | instances | cells | registers | area, um2 | without what it uses, um2 | memory bits | longest path, ns |", "|---|---|---|---|---|---|---|---|"]
        for name, module in sorted(result["modules"].items(), key=lambda item: -item[1]["area_um2"]):
            path = module["path"]
            lines.append(f"| `{name}` | {module['instances']} | {module['cells']} | {module['registers']} | {module['area_um2']:.0f} | {module['own_area_um2']:.0f}"
                         f" | {module['memory_bits']} | {path['ns'] if path else '-'} |")
        if result["memories"]:
            lines += ["", "| memories of | count | words | bits of a word | bits of all | ports |", "|---|---|---|---|---|---|"]
            for memory in result["memories"]:
                ports = ", ".join(f"{name} {port['bits']}" for name, port in memory["ports"].items())
                lines.append(f"| `{memory['module']}` | {memory['count']} | {memory['words']} | {memory['width']} | {memory['count'] * memory['bits']} | {ports} |")
        path = result["modules"][result["module"]]["path"]
        if path:
            met = "met" if path["slack_ns"] >= 0 else f"NOT met, {-path['slack_ns']:.2f} ns too long"
            lines += ["", f"The longest path of `{result['module']}` takes {path['ns']:.2f} ns ({met}), through {path['levels']} cells, from `{path['start']}` "
                      f"to `{path['end']}`. Wires are not in it."]
        lines.append("")
    return "\n".join(lines)


def main():
    arguments = parse_arguments()
    if not os.path.exists(os.path.join(arguments.rtl, "rtl", "sf_top.sv")):
        raise Stop(f"{arguments.rtl}/rtl/sf_top.sv is not there")
    work = Work(arguments)
    results = {}
    for build in [Build(work, text) for text in arguments.modules.split()]:
        path, key = os.path.join(build.folder, "report.json"), work.key(build.text)
        try:
            with open(path, encoding="utf-8") as file:
                found = json.load(file)
        except (OSError, ValueError):
            found = {}
        if found.get("key") == key:
            work.say(f"{build.text}: kept")
        else:
            found = dict(measure(work, build), key=key)
            write(path, json.dumps(found, indent=2) + "\n")
        hand_over(work, build, found)
        results[build.text] = {name: value for name, value in found.items() if name != "key"}
        write(os.path.join(build.folder, "report.md"), table_of({build.text: results[build.text]}))
        work.say(f"{build.folder}/handover is written")
    print(json.dumps(results, indent=2) if arguments.json else table_of(results), end="\n" if arguments.json else "")
    late = [text for text, result in results.items() if (result["modules"][result["module"]]["path"] or {"slack_ns": 0})["slack_ns"] < 0]
    return 1 if late else 0


if __name__ == "__main__":
    run("asic", main, (liberty.LibertyError, netlist.NetlistError, flow.FlowError))
