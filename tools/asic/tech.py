"""Prices from the measured blocks: the report of a run, and the technology file that energy_audit reads."""
import os
import re

BASE_NM, BASE_V = 45.0, 0.9  # of the published prices
PUBLISHED = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "share", "tech", "45nm.tech")
MEASURED = ("int_add.", "int_multiply.")  # what stands there and is measured here
UNITS = {"fJ": 1, "pJ": 1000, "nJ": 1000000}
PAPER = {"mac": 4.6, "sop": 0.9}
FULL = {"values": "MACS", "sums": "LANES"}  # how many lanes share the control of a whole engine: in sf_arch_pkg


def name_of(library):
    return "sky130" if library.startswith("sky130") else re.sub(r"[^A-Za-z0-9]+", "-", library.split("_")[0])


def node_of(library):
    """Feature size in nm that a library's name tells; None where it tells none."""
    known = {"sky130": 130.0, "osu018": 180.0, "osu035": 350.0, "osu050": 500.0}
    return next((nm for start, nm in known.items() if library.startswith(start)), None)


def operation_fj(block):
    """Energy of the counted cycles without the clock of those that had no event."""
    return block["busy"]["fj"] - block["idle_fj_per_cycle"] * (block["cycles"] - block["active"])


def per_event(block):
    return operation_fj(block) / block["events"]


def per_lane(small, large, full):
    """Of one lane and event: a lane is what the larger build costs more, and the rest is shared by all lanes."""
    lane = (per_event(large) - per_event(small)) / (large["lanes"] - small["lanes"])
    shared = max(0.0, per_event(small) - small["lanes"] * lane)
    return lane + shared / full


def engine_lanes(root):
    with open(os.path.join(root, "rtl", "gen", "sf_arch_pkg.sv"), encoding="utf-8") as file:
        text = file.read()
    return {name: int(re.search(rf"\b{name} = (\d+);", text).group(1)) for name in ("LANES", "MACS")}


def priced(blocks, full):
    """[(key, fJ, what, blocks behind it)] of all that the measured blocks give."""
    rows = []

    def add(key, what, names, fj):
        if all(name in blocks for name in names):
            rows.append((key, fj([blocks[name] for name in names]), what, names))
    add("mac", "MAC: 12 x 8 bits, 27-bit sums, lane of sf_values", ["values8", "values12"], lambda b: per_lane(b[0], b[1], full["MACS"]))
    add("twin_mac", "the same lane with activations of 8 bits", ["values8", "values12", "twin8"],
        lambda b: per_lane(b[0], b[1], full["MACS"]) * per_event(b[2]) / per_event(b[0]))
    add("sop", "step addition: 8 into 16 bits, lane of sf_sums", ["sums8", "sums12"], lambda b: per_lane(b[0], b[1], full["LANES"]))
    add("neuron_update", "leak, compare, reset: sf_plif", ["neuron"], lambda b: per_event(b[0]))
    add("integrator_update", "leaky integrator: sf_integrate", ["integrate"], lambda b: per_event(b[0]))
    add("special", "argument and both tables: sf_scale, sf_exp2, sf_sigmoid", ["scale", "exp2", "sigmoid"], lambda b: sum(per_event(one) for one in b))
    add("tag_lookup", "tags of a line, 4 ways: a bank of sf_cache_tags without its memory", ["tags"], lambda b: per_event(b[0]))
    for width in (8, 32):
        add(f"int_add.{width}", f"addition alone, {width} bits", [f"add{width}"], lambda b: per_event(b[0]))
    for width in (8, 32):
        add(f"int_multiply.{width}", f"multiplication alone, {width} x {width} bits", [f"multiply{width}"], lambda b: per_event(b[0]))
    return rows


def measured_price(row, blocks):
    """A price in fJ of an event, with what was measured beside it, from its blocks' results."""
    key, fj, what, names = row
    first = blocks[names[0]]
    lanes = first["lanes"]
    return {"key": key, "fj": round(fj), "what": what, "blocks": names, "events_per_cycle": first["events"] / first["cycles"],
            "toggles_per_net_and_cycle": first["busy"]["toggles_per_net_and_cycle"],
            "idle_fj_per_cycle": sum(blocks[name]["idle_fj_per_cycle"] / blocks[name]["lanes"] for name in (names if lanes == 1 else names[:1])),
            "with_idle_clock_fj": round(fj + first["idle_fj_per_cycle"] * (first["cycles"] - first["active"]) / first["events"] / lanes) if lanes > 1 or len(names) == 1
            else round(sum(blocks[name]["busy"]["fj"] / blocks[name]["events"] for name in names)),
            "leakage_nw": None if any(blocks[name]["leakage_nw"] is None for name in names) else
            sum(blocks[name]["leakage_nw"] / blocks[name]["lanes"] for name in (names if lanes == 1 else names[:1]))}


def report_of(work, results):
    """The report: library, tools, prices and blocks, as written to JSON."""
    library, arguments = work.library, work.arguments
    node = arguments.node or node_of(library.name)
    blocks = {name: {key: value for key, value in result.items() if key != "key"} for name, result in results.items()}
    prices = [measured_price(row, blocks) for row in priced(blocks, engine_lanes(work.root))]
    fj = {price["key"]: price["fj"] for price in prices}
    report = {"format": "spikefield-asic-energy-1", "name": work.name, "node_nm": node,
              "library": {"file": os.path.basename(library.path), "name": library.name, "voltage": library.voltage, "temperature": float(library.temperature or 25)},
              "tools": {name: version for name, version in work.tools.items() if name != "sta"}, "scene": os.path.basename(work.scene),
              "clock_mhz": arguments.clock, "cycles": arguments.cycles, "gating": arguments.gating == "on",
              "prices": prices, "blocks": blocks}
    if "mac" in fj and "sop" in fj:
        report["mac_to_sop"] = fj["mac"] / fj["sop"]
        report["paper_mac_to_sop"] = PAPER["mac"] / PAPER["sop"]
    return report


def cell(value, form="{:.0f}"):
    return "-" if value is None else form.format(value)


def table_of(report):
    """Markdown: prices, then blocks."""
    library = report["library"]
    lines = [f"{library['name']}, {library['voltage']:g} V, {library['temperature']:g} C, {report['clock_mhz']:g} MHz, clock gating "
             f"{'on' if report['gating'] else 'off'}; operands of {report['scene']}", "",
             "| price | of | fJ | with the clock of idle cycles | idle, fJ per cycle | leakage, nW | events per cycle | toggles per net and cycle |",
             "|---|---|---|---|---|---|---|---|"]
    for price in report["prices"]:
        lines.append(f"| `{price['key']}` | {price['what']} | {price['fj']} | {price['with_idle_clock_fj']} | {price['idle_fj_per_cycle']:.0f}"
                     f" | {cell(price['leakage_nw'], '{:.2f}')} | {price['events_per_cycle']:.2f} | {price['toggles_per_net_and_cycle']:.2f} |")
    lines += ["", "| block | cells | registers | area, um2 | fJ per event and lane | clock | registers | logic | operands | outputs compared |",
              "|---|---|---|---|---|---|---|---|---|---|"]
    for name, block in report["blocks"].items():
        total = block["busy"]["fj"] or 1.0
        shares = " | ".join(f"{100 * block['busy']['shares_fj'][share] / total:.0f} %" for share in ("clock", "registers", "logic", "operands"))
        lines.append(f"| `{name}` | {block['cells']} | {block['registers']} | {block['area_um2']:.0f} | {per_event(block) / block['lanes']:.0f} | {shares}"
                     f" | {100 * block['compared']:.0f} % |")
    if "mac_to_sop" in report:
        lines += ["", f"MAC : SOP = {report['mac_to_sop']:.1f} : 1; the paper's prices are {report['paper_mac_to_sop']:.1f} : 1."]
    return "\n".join(lines) + "\n"


def amount(fj):
    """An exact number of fJ in the unit that reads best."""
    if fj < 1000:
        return f"{fj} fJ"
    return f"{fj / 1000:.3f}".rstrip("0").rstrip(".") + " pJ"


def published():
    """[(key, fJ, source)] of the prices that stay published."""
    with open(PUBLISHED, encoding="utf-8") as file:
        rows = [line.split(None, 3) for line in file if line.strip() and not line.startswith(("#", "name", "title"))]
    return [(key, round(float(value) * UNITS[unit]), source.strip()) for key, value, unit, source in rows if not key.startswith(MEASURED)]


def file_of(report):
    """The technology file. Published prices go with the feature size and the square of the voltage: C V^2."""
    library, node = report["library"], report["node_nm"]
    scale = node / BASE_NM * (library["voltage"] / BASE_V) ** 2
    lines = [f"# Made by make asic-energy from {library['file']} ({library['name']}) and operands of {report['scene']}, {report['cycles']} cycles.",
             f"# {report['tools']['yosys']}; {report['tools']['iverilog']}.",
             f"# Clock {report['clock_mhz']:g} MHz, clock gating {'on' if report['gating'] else 'off'}. How each price comes about: docs/energy.md.",
             f"name   {report['name']}",
             f"title  {library['name']}, {node:g} nm, {library['voltage']:g} V, {library['temperature']:g} C: operations from netlists",
             "", "# operations of this hardware"]
    for price in report["prices"]:
        source = (f"netlist: {price['what']}; {price['events_per_cycle']:.2f} events, {price['toggles_per_net_and_cycle']:.2f} toggles per net a cycle; "
                  f"idle {price['idle_fj_per_cycle']:.0f} fJ a cycle")
        lines.append(f"{price['key']:<17} {amount(price['fj']):<12} {source}")
    lines += ["", f"# published for {BASE_NM:g} nm and {BASE_V:g} V, times {node:g}/{BASE_NM:g} and ({library['voltage']:g}/{BASE_V:g})^2 = {scale:.4g}"]
    for key, fj, source in published():
        if key == "dram":
            lines.append(f"{key:<17} {fj / 1e6:g} nJ      {source}; a chip of its own, not scaled")
        else:
            lines.append(f"{key:<17} {amount(round(fj * scale)):<12} {source}; {amount(fj)} at {BASE_NM:g} nm, scaled")
    return "\n".join(lines) + "\n"
