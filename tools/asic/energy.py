"""Adds up what the counted edges of a netlist cost: the library's internal power of each edge, C V^2 / 2 of each net's edge."""
from asic.bench import events_of, pins_of
from asic.cells import event_energy

SHARES = ("clock", "registers", "logic", "operands")


def internal(netlist, counts):
    """{share: fJ} inside cells."""
    ideal = netlist.clock_nets()
    events = {name: events_of(cell) for name, cell in netlist.cells.items()}
    pins = {name: pins_of(cell) for name, cell in netlist.cells.items()}
    total = dict.fromkeys(SHARES, 0.0)
    for (number, event, state), count in counts.items():
        instance = netlist.instances[number]
        cell = instance.cell
        pin, related = events[cell.name][event]
        values = {name: (state >> i) & 1 for i, name in enumerate(pins[cell.name])}
        slew = netlist.slew.get(instance.pins.get(related or pin), 0.0)
        load = netlist.load.get(instance.pins.get(pin), 0.0) if related is not None else 0.0
        share = "clock" if instance.pins.get(pin) in ideal else "registers" if cell.sequential() else "logic"
        total[share] += count * event_energy(cell, pin, values[pin], related, values, slew, load)
    return total


def toggles(netlist, counts):
    """{net: edges}, from the output that drives it, or else from the first pin that it drives."""
    found = {}
    events = {name: events_of(cell) for name, cell in netlist.cells.items()}
    first = {net: sinks[0] for net, sinks in netlist.sinks.items() if net not in netlist.driver}
    for (number, event, _), count in counts.items():
        instance = netlist.instances[number]
        pin, related = events[instance.cell.name][event]
        net = instance.pins.get(pin)
        if related is not None or (net in first and first[net][0] is instance and first[net][1] == pin):
            found[net] = found.get(net, 0) + count
    return found


def switching(netlist, counts):
    """{share: fJ} of charging nets: half of C V^2 for each edge."""
    ideal = netlist.clock_nets()
    volts = netlist.library.voltage
    total = dict.fromkeys(SHARES, 0.0)
    for net, edges in toggles(netlist, counts).items():
        instance, _ = netlist.driver.get(net, (None, None))
        share = ("clock" if net in ideal else "operands" if instance is None else "registers" if instance.cell.sequential() else "logic")
        total[share] += edges * 0.5 * netlist.load[net] * volts * volts
    return total


def leakage_nw(netlist):
    """nW of all cells; None where the library does not say it of one of them."""
    values = [instance.cell.leakage for instance in netlist.instances]
    return None if any(value is None for value in values) else sum(values)


def sum_up(netlist, counts, cycles):
    """What a run of so many cycles cost, and how busy its nets were."""
    inside, nets = internal(netlist, counts), switching(netlist, counts)
    edges = toggles(netlist, counts)
    ideal = netlist.clock_nets()
    data = [net for net in netlist.load if net not in ideal]
    return {"fj": sum(inside.values()) + sum(nets.values()), "internal_fj": sum(inside.values()), "net_fj": sum(nets.values()),
            "shares_fj": {share: inside[share] + nets[share] for share in SHARES},
            "toggles_per_net_and_cycle": sum(edges.get(net, 0) for net in data) / max(1, len(data)) / max(1, cycles)}
