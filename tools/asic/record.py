"""Operands of a real scene: `sf_cosim --vcd` records the accelerator, and the values of a block's ports are taken cycle by cycle."""


class RecordError(Exception):
    """The recording lacks what a block needs."""


class Record:
    """Values of a block's inputs and outputs, a string of bits per cycle, and the events of each cycle."""

    def __init__(self, inputs, outputs, events, cycles):
        self.inputs, self.outputs, self.events, self.cycles = inputs, outputs, events, cycles


def declared(lines, wanted):
    """{code: (name, bits)} of the wanted nets, read up to the end of the definitions. Names: "sf_top.u_core.u_x.net"."""
    scope, codes = [], {}
    for line in lines:
        word = line.split()
        if not word:
            continue
        if word[0] == "$scope":
            scope.append(word[2])
        elif word[0] == "$upscope":
            scope.pop()
        elif word[0] == "$var":
            name = ".".join(scope + [word[4]])
            if name in wanted:
                codes.setdefault(word[3], []).append((name, int(word[2])))
        elif word[0] == "$enddefinitions":
            break
    return codes


def read_vcd(path, wanted, clock, cycles):
    """{name: [value before the clock's rise, by cycle]}; values are strings of bits. RecordError names what is missing."""
    wanted = set(wanted) | {clock}
    with open(path, encoding="ascii") as lines:
        codes = declared(lines, wanted)
        widths = {name: bits for names in codes.values() for name, bits in names}
        missing = sorted(wanted - widths.keys())
        if missing:
            raise RecordError(f"{path}: the recording has no net '{missing[0]}'")
        clock_code = next(code for code, names in codes.items() if any(name == clock for name, _ in names))
        now, pending = {code: "0" for code in codes}, {}
        values = {name: [] for name in wanted}
        count = 0
        for line in lines:
            if line[0] == "#":
                if now[clock_code] == "0" and pending.get(clock_code) == "1":
                    for code, names in codes.items():
                        for name, bits in names:
                            values[name].append(now[code].rjust(bits, "0"))
                    count += 1
                    if count == cycles:
                        return values
                now.update(pending)
                pending = {}
            elif line[0] in "bB":
                value, code = line[1:].split()
                if code in codes:
                    pending[code] = value
            elif line[0] in "01xz":
                code = line[1:].strip()
                if code in codes:
                    pending[code] = line[0]
    raise RecordError(f"{path}: {count} cycles are recorded, {cycles} are asked for")


def number(bits, signed=True):
    value = int(bits.replace("x", "0"), 2)
    return value - (1 << len(bits)) if signed and bits[0] == "1" else value


def to_bits(value, width):
    return format(value & ((1 << width) - 1), f"0{width}b")
