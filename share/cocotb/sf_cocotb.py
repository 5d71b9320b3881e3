#!/usr/bin/env python3
"""Runs the cocotb bench: programs sf_top, or a block with its ports, streams a scene's rays and compares everything.

usage: sf_cocotb.py SCENE DATA [options]

  sf_cocotb.py scene.snn data                                      48 samples, Verilator, 20 % stalls
  sf_cocotb.py scene.snn data --sim icarus --samples 24 --seed 7   other rays and stalls
  sf_cocotb.py scene.snn data --dut "my_pkg.sv my_top.sv" --dut-top my_top
  sf_cocotb.py scene.snn data --dut "-F my/rtl.f" -o build/mine    a list of files, relative to its folder

Exit status 0: everything is equal; 1: a difference; 2: wrong usage, or something is missing.
Needs, in an environment of its own (docs/python.md): cocotb 1.9, cocotbext-axi, numpy and the package spikefield."""
import argparse
import glob
import hashlib
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

HERE = os.path.dirname(os.path.abspath(__file__))
TREE = os.path.dirname(os.path.dirname(HERE))  # this file's, in share/cocotb
PREFIX = os.path.dirname(TREE)  # where it is installed, in share/spikefield/cocotb
TOP = "sf_cocotb_top"
AROUND = ["sf_cocotb_waits.sv", TOP + ".sv"]  # the block
NEEDED = {"cocotb": "cocotb", "cocotbext.axi": "cocotbext-axi", "numpy": "numpy"}


class Trouble(Exception):
    """One line for the user; exit status 2."""


def is_there(module):
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def check_environment():
    """Find cocotb 1.9, spikefield and its library; Trouble names what is missing."""
    missing = [package for module, package in NEEDED.items() if not is_there(module)]
    if missing:
        raise Trouble(f"{', '.join(missing)}: not installed for {sys.executable}: "
                      f"pip install -r {os.path.join(HERE, 'requirements.txt')}")
    import cocotb
    if not cocotb.__version__.startswith("1.9."):
        raise Trouble(f"cocotb {cocotb.__version__}: the bench needs 1.9, which works with Verilator 5.006 and Icarus 11")
    beside = os.path.join(os.path.dirname(HERE), "python")  # the source tree, or what was installed
    if not is_there("spikefield") and os.path.isdir(os.path.join(beside, "spikefield")):
        sys.path.append(beside)
    built = glob.glob(os.path.join(TREE, "build", "lib", "libspikefield.so.*"))
    built += glob.glob(os.path.join(PREFIX, "lib", "libspikefield.so"))
    if "SPIKEFIELD_LIBRARY" not in os.environ and built:
        os.environ["SPIKEFIELD_LIBRARY"] = built[0]
    try:
        import spikefield  # noqa: F401
    except ImportError as error:
        raise Trouble(str(error)) from None


def find_export(named):
    """sf_export: the named one, that of the tree or PREFIX this file lies in, that of PATH."""
    near = [os.path.join(TREE, "build", "bin", "sf_export"), os.path.join(PREFIX, "bin", "sf_export")]
    for program in [named] if named else near + ["sf_export"]:
        found = shutil.which(program)
        if found:
            return os.path.abspath(found)
    raise Trouble(f"{named or 'sf_export'}: not found (make, or --export PROGRAM)")


def make_kit(options, program, kit):
    """Vectors of the scene for these rays, by sf_export, in the folder `kit`."""
    shutil.rmtree(kit, ignore_errors=True)
    done = subprocess.run([program, options.scene, "--vectors", kit, "--data", options.data, "--samples",
                           str(options.samples), "--seed", str(options.seed)], capture_output=True, text=True)
    if done.returncode:
        raise Trouble(done.stderr.strip() or f"sf_export: exit status {done.returncode}")


# ---- the block

def listed(text, folder):
    """Words of --dut or of a list: (include folders, other options, files), absolute; -F and -f lists are read."""
    includes, others, files = [], [], []
    words = iter(shlex.split(text, comments=True))
    for word in words:
        if word in ("-F", "-f"):
            name = os.path.join(folder, next(words, ""))
            try:
                with open(name, encoding="utf-8") as file:
                    more = listed(file.read(), os.path.dirname(name) if word == "-F" else os.getcwd())
            except OSError as error:
                raise Trouble(f"--dut: {name}: {error.strerror}") from None
            includes, others, files = includes + more[0], others + more[1], files + more[2]
        elif word.startswith("+incdir+"):
            includes.append(os.path.abspath(os.path.join(folder, word[8:])))
        elif word.startswith("-I"):
            includes.append(os.path.abspath(os.path.join(folder, word[2:])))
        elif word.startswith("-"):
            others.append(word)
        else:
            path = os.path.abspath(os.path.join(folder, word))
            if not os.path.isfile(path):
                raise Trouble(f"--dut: {path}: no such file")
            files.append(path)
    return includes, others, files


def build_key(command, includes, files):
    """Changes with the command, every source, and every Verilog file of an include folder."""
    key = hashlib.sha256(repr(command).encode())
    for folder in includes:
        files = files + sorted(os.path.join(folder, name) for name in os.listdir(folder) if name.endswith((".sv", ".svh", ".v", ".vh")))
    for path in files:
        with open(path, "rb") as file:
            key.update(hashlib.sha256(file.read()).digest())
    return key.hexdigest()


def around():
    return [os.path.join(HERE, name) for name in AROUND]


def verilator(folder, block, top, opt):
    """The commands that build and run the bench in Verilator, in `folder`. `block`: include folders, other options, sources."""
    import cocotb
    libs = os.path.join(os.path.dirname(cocotb.__file__), "libs")
    main = os.path.join(os.path.dirname(cocotb.__file__), "share", "lib", "verilator", "verilator.cpp")
    includes, others, files = block
    command = ["verilator", "--cc", "--exe", "--build", "-j", "2", "--timing", "--vpi", "--prefix", "Vtop",
               "--top-module", TOP, "-O3", "-Wno-fatal", "-Wno-lint", "-Wno-style", "--x-assign", "unique",
               "--x-initial", "unique", "--unroll-count", "256", "--unroll-stmts", "1000000", "--output-split", "100000000",
               "--Mdir", os.path.join(folder, "verilator"), "-o", "sim", f"-DSF_DUT={top}", *others,
               *[f"+incdir+{path}" for path in includes], *files, *around(), main, "-LDFLAGS",
               f"-Wl,-rpath,{libs} -L{libs} -lcocotbvpi_verilator", "-MAKEFLAGS", f"OPT_FAST={opt} OPT_SLOW={opt}"]
    return command, [os.path.join(folder, "verilator", "sim"), "+verilator+rand+reset+2"]


def icarus(folder, block, top, _):
    """As verilator(), for Icarus Verilog."""
    import cocotb
    libs = os.path.join(os.path.dirname(cocotb.__file__), "libs")
    includes, others, files = block
    image = os.path.join(folder, "icarus.vvp")
    command = ["iverilog", "-g2012", "-Wno-timescale", "-s", TOP, "-o", image, f"-DSF_DUT={top}", *others,
               *[f"-I{path}" for path in includes], *files, *around()]
    return command, ["vvp", "-M", libs, "-m", "libcocotbvpi_icarus", image]


def build(options, folder, block):
    """The simulation's command; built only when something it depends on has changed."""
    command, run = {"verilator": verilator, "icarus": icarus}[options.sim](folder, block, options.dut_top, options.opt)
    if not shutil.which(command[0]):
        raise Trouble(f"{command[0]}: not installed (make deps)")
    key, stamp = build_key(command, block[0], block[2] + around()), os.path.join(folder, options.sim + ".key")
    if os.path.exists(stamp) and open(stamp, encoding="ascii").read() == key:
        return run
    if os.path.exists(stamp):
        os.remove(stamp)
    shutil.rmtree(os.path.join(folder, "verilator") if options.sim == "verilator" else "", ignore_errors=True)
    log = os.path.join(folder, options.sim + ".log")
    with open(log, "w", encoding="utf-8") as file:
        status = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT).returncode
    if status:
        with open(log, encoding="utf-8", errors="replace") as file:
            said = [line for line in file if "rror" in line]
        raise Trouble(f"{command[0]} cannot build the block, see {log}\n" + "".join(said[:5]).rstrip())
    with open(stamp, "w", encoding="ascii") as file:
        file.write(key)
    return run


# ---- the run

def environment(config_path, results):
    """The environment of a simulation: what cocotb 1.9 and the bench read from it."""
    import cocotb.config
    import find_libpython
    import spikefield
    paths = [HERE, os.path.dirname(os.path.dirname(spikefield.__file__)), os.environ.get("PYTHONPATH", "")]
    return dict(os.environ, SF_COCOTB=config_path, MODULE="sf_bench", TOPLEVEL=TOP, TOPLEVEL_LANG="verilog",
                COCOTB_RESULTS_FILE=results, LIBPYTHON_LOC=find_libpython.find_libpython(), PYTHONPATH=os.pathsep.join(filter(None, paths)),
                PYTHONHOME=sys.base_prefix, PATH=os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"],
                COCOTB_LOG_LEVEL=os.environ.get("COCOTB_LOG_LEVEL", "INFO"), **venv())


def venv():
    return {"VIRTUAL_ENV": sys.prefix} if sys.prefix != sys.base_prefix else {}


def verdict(results, summary, options, seconds):
    """Prints the failed cases; True where there is none."""
    cases = list(ElementTree.parse(results).iter("testcase"))
    failed = [case for case in cases if case.find("failure") is not None or case.find("error") is not None]
    rays = [case for case in cases if case.get("name").startswith("ray_")]
    for case in failed:
        print(f"FAIL {case.get('name')}: {reason(case, options.log)}")
    if failed or not rays or not os.path.exists(summary):
        print(f"{len(failed)} of {len(cases)} cases failed, {len(rays)} rays: {results}")
        return False
    with open(summary, encoding="utf-8") as file:
        told = json.load(file)
    print(f"PASS {told['samples']} samples of {len(rays)} rays in {options.sim}, stalls {options.stalls} %, seed {options.seed}: "
          f"{told['samples'] / told['seconds']:.0f} samples/s of processor time, {seconds:.1f} s in all")
    return True


def reason(case, log):
    """The exception that cocotb printed for the case."""
    with open(log, encoding="utf-8", errors="replace") as file:
        text = file.read().split(f"{case.get('name')} failed", 1)
    said = re.findall(r"^ *([\w.]*(?:Error|Exception)\b(?:: .*)?)$", text[1] if len(text) > 1 else "", re.M)
    return said[0] if said else f"see {log}"


def run(options, folder, command, kit):
    """Simulate; leaves results.xml, summary.json and run.log in `folder`. Trouble when there are no results."""
    results, summary = os.path.join(folder, "results.xml"), os.path.join(folder, "summary.json")
    for old in (results, summary):
        if os.path.exists(old):
            os.remove(old)
    config = {"kit": kit, "scene": os.path.abspath(options.scene), "seed": options.seed, "stalls": options.stalls,
              "tap": not options.no_tap, "counters": options.counters, "summary": summary}
    path, options.log = os.path.join(folder, "bench.json"), os.path.join(folder, "run.log")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(config, file)
    start = time.monotonic()
    with open(options.log, "w", encoding="utf-8") as log:
        subprocess.run(command + options.plusarg, stdout=log, stderr=subprocess.STDOUT, env=environment(path, results), cwd=folder)
    if not os.path.exists(results):
        with open(options.log, encoding="utf-8", errors="replace") as log:
            raise Trouble(f"the simulation left no results, see {options.log}\n" + "".join(log.readlines()[-5:]).rstrip())
    return verdict(results, summary, options, time.monotonic() - start)


def percent(text):
    value = int(text)
    if not 0 <= value <= 90:
        raise argparse.ArgumentTypeError(f"{text}: expected 0..90")
    return value


def arguments():
    """The parser of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, usage=argparse.SUPPRESS)
    parser.add_argument("scene", help="a .snn file (sf_export)")
    parser.add_argument("data", help="the data set whose rays are streamed")
    parser.add_argument("--sim", choices=("verilator", "icarus"), default="verilator")
    parser.add_argument("--samples", type=int, default=48, help="in all, at most 12 a ray (48)")
    parser.add_argument("--seed", type=int, default=1, help="rays and stalls (1)")
    parser.add_argument("--stalls", type=percent, default=20, help="percent of cycles with a bubble or back-pressure, 0..90 (20)")
    parser.add_argument("--counters", choices=("each", "end"), default="end",
                        help="compare every counter after each ray, or once for all rays, which is ten times as fast (end)")
    parser.add_argument("--no-tap", action="store_true", help="the block shows no tap beats: compare results and counters")
    parser.add_argument("--dut", help="another block: sources in compilation order, +incdir+, -I, -D, -F LIST, -f LIST")
    parser.add_argument("--dut-top", default="sf_top", help="its module (sf_top)")
    parser.add_argument("--plusarg", action="append", default=[], metavar="+NAME=VALUE", help="for the simulation; any number of them")
    parser.add_argument("--opt", default="-O2", help="of the Verilated simulation: --opt=-O0 builds sooner, for few samples (-O2)")
    parser.add_argument("--export", help="sf_export, where it is not found by itself")
    parser.add_argument("-o", default="sf_cocotb", metavar="DIR", help="what is built, results.xml, run.log (sf_cocotb)")
    return parser.parse_args()


def main():
    options = arguments()
    try:
        check_environment()
        folder = os.path.abspath(options.o)
        os.makedirs(folder, exist_ok=True)
        kit = os.path.join(folder, "kit")
        make_kit(options, find_export(options.export), kit)
        block = listed(options.dut, os.getcwd()) if options.dut else listed("-F rtl.f", kit)
        return 0 if run(options, folder, build(options, folder, block), kit) else 1
    except (Trouble, OSError) as error:
        print(f"sf_cocotb: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
