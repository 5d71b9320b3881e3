"""Mutants of a unit in its Yosys netlist: their list, programs that hold them, proofs that one is equivalent.

A mutant is a bit of a cell's port: inverted, constant, or inverted where the port's next bit is 0 or 1. It is named by
the operator's source text or the register's name, not by its line, so its name lives as long as that text.
"""
import json
import os
import re
import shutil
import subprocess

import campaign

PACKAGES = ["rtl/gen/sf_arch_pkg.sv", "rtl/gen/sf_csr_pkg.sv", "rtl/sf_op_pkg.sv"]
ELABORATE = "proc; opt -full; wreduce; opt -full; opt_clean"
# Registers become inputs and what they take outputs, so that a unit with them is proven like one without.
CUT = "memory_collect; memory_map; dffunmap; expose -evert-dff t:*dff* %co1:+[Q]"
LINE = re.compile(r"-mode inv (-module \S+ -cell (\S+) -port (\S+) -portbit (\d+))(.*)")
SELECT_BITS = 20
PROOF_SECONDS = 60
TEXT_MOST = 72


def call(command, log):
    """Stop unless the command succeeds; its output is in the file `log`."""
    with open(log, "w") as f:
        if subprocess.run(command, stdout=f, stderr=f, stdin=subprocess.DEVNULL).returncode:
            raise campaign.Stop(f"{command[0]} failed, see {log}")


def yosys(script, log):
    call(["yosys", "-Q", "-T", "-p", script], log)


# ---- the list

class Cells:
    """The cells of the netlist and the names of its bits."""

    def __init__(self, path, module):
        with open(path) as f:
            found = json.load(f)["modules"][module]
        self.cells, self.names = found["cells"], {}
        for name, net in found["netnames"].items():
            if not net["hide_name"]:
                for i, bit in enumerate(net["bits"]):
                    self.names.setdefault(bit, f"{name}[{i}]" if len(net["bits"]) > 1 else name)

    def cell(self, name):
        return self.cells[name.lstrip("\\")]

    def port(self, cell, port):
        return self.cell(cell)["connections"][port.lstrip("\\")]

    def register(self, cell, bit):
        """Name of the register bit that the cell is, None if it is no register."""
        found = self.cell(cell)
        if "dff" not in found["type"]:
            return None
        q = found["connections"]["Q"]
        return self.names.get(q[bit if bit < len(q) else 0], "without a name")


def source_text(place):
    """(file:line, text) of Yosys' FILE:LINE.COLUMN-LINE.COLUMN."""
    path, line, column, last, end = re.match(r"(.*):(\d+)\.(\d+)-(\d+)\.(\d+)$", place).groups()
    line, column, last, end = int(line), int(column), int(last), int(end)
    if line == 0:
        return path, "(no place)"
    with open(path) as f:
        lines = f.read().split("\n")[line - 1:last]
    lines[-1] = lines[-1][:end - 1]
    lines[0] = lines[0][column - 1:]
    text = " ".join(" ".join(lines).split())
    return f"{path}:{line}", text if len(text) <= TEXT_MOST else text[:TEXT_MOST] + "..."


def control(bits, at):
    """The port's next bit that is a signal and another one, None without such."""
    for step in range(1, len(bits)):
        other = (at + step) % len(bits)
        if isinstance(bits[other], int) and bits[other] != bits[at]:
            return other
    return None


def described(module, cells, line):
    """(Yosys' options, place, what) of the mutants of a bit, without those that change nothing or are another again."""
    options, cell, port, bit, rest = LINE.search(line).groups()
    bits, at = cells.port(cell, port), int(bit)
    sources = re.findall(r"-src (\S+)", rest)
    place, text = source_text(sources[-1].split("|")[0]) if sources else (f"rtl/{module}.sv", "(no place)")
    register = cells.register(cell, at)
    of = f"register {register}" if register else f"`{text}`"
    kind, port = cells.cell(cell)["type"].lstrip("\\$"), port.lstrip("\\")
    for mode in ("inv", "const0", "const1"):
        if bits[at] != mode[-1]:  # not a constant that is it already
            yield f"-mode {mode} {options}", place, f"{mode} {kind} {port}[{bit}] of {of}"
    other = control(bits, at)
    if other is not None:
        for mode in ("cnot0", "cnot1"):
            yield f"-mode {mode} {options} -ctrlbit {other}", place, f"{mode} {kind} {port}[{bit}] by [{other}] of {of}"


def mutants(unit, work, key):
    """All mutants of the unit; work/base.il is its netlist, work/options Yosys' options of each mutant."""
    module = unit.module
    if not os.path.exists(f"{work}/key") or open(f"{work}/key").read() != key:
        os.makedirs(work, exist_ok=True)
        sources = " ".join(PACKAGES + unit.sources)
        yosys(f"read_verilog -sv -Irtl {sources} rtl/{module}.sv; hierarchy -top {module}; {ELABORATE}; "
              f"write_rtlil {work}/base.il; write_json {work}/base.json; "
              f"mutate -list 1000000 -seed 1 -o {work}/all {module}", f"{work}/yosys.log")
        cells = Cells(f"{work}/base.json", module)
        with open(f"{work}/all") as f:
            found = [d for line in f if line.startswith("mutate -mode inv") for d in described(module, cells, line)]
        with open(f"{work}/options", "w") as f:
            f.writelines("\t".join(d) + "\n" for d in found)
        if unit.domain != "exhausted":
            reference(unit, work)
        with open(f"{work}/key", "w") as f:
            f.write(key)
    with open(f"{work}/options") as f:
        fields = [line.rstrip("\n").split("\t") for line in f]
    return campaign.unique([campaign.Mutant(n, module, place, what) for n, (_, place, what) in enumerate(fields, 1)])


def options_of(work, number):
    with open(f"{work}/options") as f:
        return f.read().split("\n")[number - 1].split("\t")[0]


# ---- programs

def netlist(unit, work, chunk):
    """work/MODULE.v: the unit with the mutants of the chunk and a choice of one."""
    module = unit.module
    with open(f"{work}/options") as f:
        options = [line.split("\t")[0] for line in f]
    with open(f"{work}/chunk", "w") as f:
        f.writelines(f"mutate -ctrl mutsel {SELECT_BITS} {m.number} {options[m.number - 1]}\n" for m in chunk)
    # A wire of its own for every bit: without splitnets the Verilated netlist differs from the RTL with no mutant chosen.
    yosys(f"read_rtlil {work}/base.il; script {work}/chunk; cd {module}; opt_clean; "
          "techmap t:$lt t:$gt t:$le t:$ge; techmap t:$alu; techmap t:$lcu; opt_clean; splitnets; opt_clean; "
          f"write_verilog -noattr -selected {work}/netlist.v", f"{work}/yosys.log")
    with open(f"{work}/netlist.v") as f:
        text = f.read()
    head, end, body = text.partition(");\n")
    head = re.sub(r"\bmutsel, |, mutsel\b", "", head)
    body = re.sub(r"^  input (\[[0-9:]*\]) mutsel;\n  wire \[[0-9:]*\] mutsel;",
                  r'  import "DPI-C" function int sf_mutant();' "\n" r"  reg \1 mutsel; initial mutsel = sf_mutant();",
                  body, flags=re.M)
    if "initial mutsel" not in body:
        raise campaign.Stop(f"{work}/netlist.v: no choice of a mutant in it")
    with open(f"{work}/{module}.v", "w") as f:
        f.write(head + end + body)


def program(unit, work, chunk, build):
    """Path of the unit's checker linked with the mutants of the chunk; build has the library and Verilator's runtime."""
    module, made = unit.module, f"{work}/verilated"
    netlist(unit, work, chunk)
    shutil.rmtree(made, ignore_errors=True)
    root = subprocess.run(["verilator", "--getenv", "VERILATOR_ROOT"], capture_output=True, text=True).stdout.strip()
    call(["verilator", "--cc", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-O3", "--x-assign", "unique", "--x-initial", "unique",
          "--prefix", f"V{module}", "--top-module", module, "-Irtl", "--Mdir", made, "rtl/lint.vlt", *PACKAGES, *unit.sources,
          f"{work}/{module}.v"], f"{work}/verilator.log")
    call(["make", "-s", "-C", made, "-f", f"V{module}.mk", "OPT_FAST=-O2", f"V{module}__ALL.a"], f"{work}/make.log")
    call(["gcc", "-O2", "-c", "tests/mutate/mutant.c", "-o", f"{work}/mutant.o"], f"{work}/gcc.log")
    includes = ["-Iinclude", "-Isrc", "-I."]
    for path in (f"{root}/include", f"{root}/include/vltstd", made):
        includes += ["-isystem", path]
    path = os.path.abspath(f"{work}/checker")
    runtime = [f"{build}/verilated/runtime/{part}.o" for part in ("verilated", "verilated_threads")]
    call(["g++", "-std=c++17", "-O2", "-Wall", "-Wextra", f"-DUNIT={module}", f"-DUNIT_{module}", *includes, unit.checker,
          f"{made}/V{module}__ALL.a", f"{work}/mutant.o", *runtime, f"{build}/libspikefield.a", "-fopenmp", "-lm",
          "-lpthread", "-o", path], f"{work}/gcc.log")
    return path


# ---- proofs

def reference(unit, work):
    """work/gold.il: the unit with its domain assumed."""
    with open(f"rtl/{unit.module}.sv") as f:
        text = f.read().replace("\nendmodule", f"\n  always @* assume ({unit.domain});\nendmodule")
    with open(f"{work}/gold.sv", "w") as f:
        f.write(text)
    yosys(f"read_verilog -formal -sv -Irtl {' '.join(PACKAGES)} {work}/gold.sv; hierarchy -top {unit.module}; {ELABORATE}; "
          f"rename {unit.module} gold; {CUT}; write_rtlil {work}/gold.il", f"{work}/gold.log")


def prover(unit, work):
    """A function that says whether a surviving mutant is equivalent for certain."""
    if unit.domain == "exhausted":
        return lambda mutant: True  # the checker has tried every input

    def prove(mutant):
        script = (f"read_rtlil {work}/gold.il; read_rtlil {work}/base.il; mutate {options_of(work, mutant.number)}; "
                  f"cd {unit.module}; {CUT}; cd ..; rename {unit.module} gate; miter -equiv -flatten gold gate miter; hierarchy -top miter; flatten; "
                  "opt -full; opt_merge; opt_clean; sat -prove trigger 0 -set-assumes miter")
        # Of the processor, that a loaded machine proves no less.
        command = ["sh", "-c", f'ulimit -t {PROOF_SECONDS} && exec yosys -Q -T -p "$0"', script]
        log = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL).stdout
        return "no model found: SUCCESS" in log

    return prove
