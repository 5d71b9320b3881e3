"""Errors that are planted in a netlist: a register takes the inverse of its next state."""
import json
import os
import random
import re

from hdl_flow import Stop

CHOICE = "planted"  # the plusarg that says which error is on; 0, and without it, none


def registers(text, pins):
    """[(RTL's name, begin, end)] of the registers' inputs in a netlist's Verilog: the place of what is connected there.

    pins: {kind of register: its data pin}."""
    found = []
    kinds = "|".join(re.escape(kind) for kind in pins)
    if not kinds:
        return found
    for first in re.finditer(rf"^  ({kinds}) ", text, re.M):
        instance = text[first.start():text.index("\n  );", first.start()) + 1]
        pin = re.search(rf"^\s*\.{pins[first.group(1)]}\((.+)\),?$", instance, re.M)
        output = re.search(r"^\s*\.Q\w*\((.+)\),?$", instance, re.M)
        if pin and output:
            name = output.group(1).strip().lstrip("\\").replace(" ", "")
            found.append((name, first.start() + pin.start(1), first.start() + pin.end(1)))
    return found


class States:
    """Which registers of a netlist's JSON have a next state that depends on their own through gates alone."""

    def __init__(self, folder, pins):
        self.pins, self.names = pins, {}
        with open(os.path.join(folder, "netlist.json"), encoding="utf-8") as file:
            modules = json.load(file)["modules"].values()
        for module in modules:
            drivers = {bit: cell for cell in module["cells"].values() for port, bits in cell["connections"].items()
                       if cell.get("port_directions", {}).get(port) == "output" for bit in bits}
            for name, net in module["netnames"].items():
                for place, bit in enumerate(net["bits"]):
                    # One bit of several has its number in the name; Yosys' splitnets has put it there already.
                    full = f"{name}[{place + net.get('offset', 0)}]" if len(net["bits"]) > 1 else name
                    self.names.setdefault(full, []).append((drivers, bit))

    def own(self, name):
        """True when the register of this name, in any module, holds or adds to what it has: its inverse can undo itself a clock later."""
        return any(self.reads(drivers, bit) for drivers, bit in self.names.get(name, []))

    def reads(self, drivers, bit):
        """True when the register that drives this bit finds it again on the way back from its data pin. drivers: {bit: cell}, of a module."""
        register = drivers.get(bit)
        if not register or register["type"] not in self.pins:
            return False
        nets, seen = list(register["connections"][self.pins[register["type"]]]), set()
        while nets:
            net = nets.pop()
            if net == bit:
                return True
            cell = drivers.get(net)
            if net in seen or not cell or cell["type"] in self.pins:
                continue
            seen.add(net)
            nets += [source for port, bits in cell["connections"].items() if cell["port_directions"].get(port) == "input" for source in bits]
        return False


def choose(places, own, number, seed):
    """So many of the places, by chance. Registers that have a name in the RTL, and whose next state is not made of their own, come first."""
    order = random.Random(seed).sample(places, len(places))
    named = [place for place in order if not re.match(r"_\d+_", place[0])] or order
    if number and not named:
        raise Stop("no register in the netlist: no error can be planted")
    chosen, rest = [], []
    for place in named:
        if len(chosen) == number:
            break
        (rest if own(place[0]) else chosen).append(place)
    return (chosen + rest)[:number]


def plant(text, places):
    """The netlist with an error at each of the places; +planted=N turns the N-th on, from 1."""
    choice = f"  integer sf_{CHOICE} = 0;\n  initial if (!$value$plusargs(\"{CHOICE}=%d\", sf_{CHOICE})) sf_{CHOICE} = 0;\n"
    modules = [found.end() for found in re.finditer(r"^module [^;]*;\n", text, re.M)]
    edits = [(begin, end, f"(sf_{CHOICE} == {number}) ^ ({text[begin:end]})") for number, (_, begin, end) in enumerate(places, 1)]
    edits += [(place, place, choice) for place in {max(module for module in modules if module <= begin) for _, begin, _ in places}]
    for begin, end, new in sorted(edits, reverse=True):
        text = text[:begin] + new + text[end:]
    return text
