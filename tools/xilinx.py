"""What a board of the 7 series needs, by Yosys: for boards that Vivado places. board.py calls it."""
import json
import re

from hdl_flow import Stop, digest, write

# What is counted, as patterns of cells; and what an XC7A200T has.
KINDS = {"LUT": r"LUT[1-6]", "FF": r"FD[A-Z]+(_1)?", "CARRY4": r"CARRY4", "DSP48E1": r"DSP48E1", "RAMB18": r"RAMB18E1", "RAMB36": r"RAMB36E1",
         "LUT RAM": r"RAM(32|64|128|256)\w*"}
DEVICES = {"xc7a200t": {"LUT": 134600, "FF": 269200, "CARRY4": 33650, "DSP48E1": 740, "RAMB36": 365}}


def device_of(script):
    """The device of a vivado.tcl."""
    found = re.search(r"^set part (xc7\w+?t)\w*-\d", open(script, encoding="utf-8").read(), re.M)
    if not found or found.group(1) not in DEVICES:
        raise Stop(f"{script}: no `set part` of {', '.join(DEVICES)}")
    return found.group(1)


def script_of(sources, top):
    """Every module is mapped once and stays a module: flattened, the same takes Yosys hours."""
    return (f"read_verilog -sv -defer -D SF_NO_TAP -Irtl {' '.join(sources)}; synth_xilinx -family xc7 -top {top}; "
            "tee -q -o stat.json stat -json")


def plain(name):
    """A module's name. Yosys calls one with parameters $paramod, name, parameters, or $paramod$hash, name; backslashes between."""
    return name.split("\\")[1] if name.startswith("$paramod") else name.lstrip("\\")


def add(into, counts, times=1):
    for kind, count in counts.items():
        into[kind] = into.get(kind, 0) + times * count


def count(stat, top):
    """{module's name: {"instances": N, kind: cells of all its instances with what is in them}}, of everything below the top."""
    modules, whole, rows = {name.lstrip("\\"): module for name, module in stat["modules"].items()}, {}, {}

    def types(name):
        module = modules[name]
        return {**module["num_cells_by_type"], **module.get("num_submodules_by_type", {})}

    def cells(name):
        if name not in whole:
            whole[name] = {}
            for cell, number in types(name).items():
                if cell in modules:
                    add(whole[name], cells(cell), number)
                add(whole[name], {kind: number for kind, pattern in KINDS.items() if re.fullmatch(pattern, cell)})
        return whole[name]

    def visit(name, times):
        row = rows.setdefault(plain(name), {"instances": 0})
        add(row, {"instances": 1, **cells(name)}, times)
        for cell, number in types(name).items():
            if cell in modules:
                visit(cell, times * number)
    names = [name for name in modules if plain(name) == top]
    if len(names) != 1:
        raise Stop(f"stat.json: {len(names)} modules {top}")
    visit(names[0], 1)
    return {name: row for name, row in rows.items() if any(kind in row for kind in KINDS)}


def table_of(rows, top, device):
    """Resources of each module as Markdown, with per cent of the device for the top."""
    limits = DEVICES[device]
    lines = ["| module | instances | " + " | ".join(KINDS) + " |", "|---" * (len(KINDS) + 2) + "|"]
    for name, row in sorted(rows.items(), key=lambda item: (-item[1].get("LUT", 0), item[0])):
        cells = [f"{row.get(kind, 0)}" + (f" ({100 * row.get(kind, 0) / limits[kind]:.0f} %)" if name == top and kind in limits else "") for kind in KINDS]
        lines.append(f"| `{name}` | {row['instances']} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + f"\n\nPer cent are of an {device}. A module's row has all its instances, and what is in them.\n"


def resources(flow, name, sources, key):
    """Runs Yosys unless its result is kept; the table."""
    device = device_of(flow.path(f"rtl/board/{name}/vivado.tcl"))
    flow.step("synthesis", "yosys", ["-p", script_of(sources, name)], "stat.json", digest(key, "xilinx 1"))
    with open(flow.path("stat.json"), encoding="utf-8") as file:
        rows = count(json.load(file), name)
    write(flow.path("resources.json"), json.dumps({"board": name, "device": device, "modules": rows}, indent=2) + "\n")
    write(flow.path("resources.md"), table_of(rows, name, device))
    return table_of(rows, name, device)
