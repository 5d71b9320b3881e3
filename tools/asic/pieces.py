"""What is measured: blocks of the RTL, the place of their recorded operands, and what counts as an event of them."""
import os

from asic import cache
from asic.bench import WARM_UP
from asic.record import Record, number, to_bits

ENGINE = "sf_top.u_engine"
CORE = ENGINE + ".u_core"
VALUES, SUMS, NEURON, READOUT = CORE + ".u_values", CORE + ".u_fed.u_c2.u_sums", CORE + ".u_neurons", ENGINE + ".u_readout"


class Piece:
    """A block with its parameters. events: recorded nets whose ones are counted; scope: where its ports are recorded."""

    def __init__(self, name, module, scope, events, parameters=None, boxes=(), ports=None, idle=(), lanes=1):
        self.name, self.module, self.scope, self.events = name, module, scope, events
        self.parameters, self.boxes, self.ports, self.idle, self.lanes = parameters or {}, boxes, ports or {}, idle, lanes
        self.memories = []  # of the block, which stay outside
        self.cut = {}  # input -> bits that are 0 instead of recorded, from the lowest on; then no output is compared
        self.clock, self.share = "clk_i", 1.0 if lanes == 1 else 0.5  # of the recorded cycles that are run

    def words(self):
        """All that makes the block what it is, for the key of what is kept."""
        return repr(sorted((name, value) for name, value in vars(self).items() if not callable(value) and name != "taken"))

    def wanted(self, netlist):
        """Recorded nets that the block needs."""
        return [self.place(name) for name in self.names(netlist)] + list(self.events)

    def names(self, netlist):
        used = [name for name, bits in netlist.boxes.items() if any(bit in netlist.sinks for bit in bits)]
        return [name for name in [*netlist.inputs, *netlist.outputs, *used] if name != self.clock and not name.startswith("tap_")]

    def place(self, name):
        return self.ports.get(name) or f"{self.scope}.{name}"

    def prepare(self, work, folder):
        """What has to be done before `record`."""

    def record(self, netlist, values, cycles):
        """Inputs, outputs and events of each cycle, taken from the waves of a run."""
        events = [sum(values[name][c].count("1") for name in self.events) for c in range(cycles)]
        inputs = {name: values[self.place(name)] for name in self.names(netlist) if name not in netlist.outputs}
        outputs = {name: values[self.place(name)] for name in self.names(netlist) if name in netlist.outputs and not self.cut}
        for name, bits in self.cut.items():
            inputs[name] = [value[:len(value) - bits] + "0" * bits for value in inputs[name]]
        return Record(inputs, outputs, events, cycles)


class Arithmetic(Piece):
    """One operation a cycle, without registers, on operands of the MAC array: the cycles in which it adds a product."""

    def __init__(self, name, module, width, operation, a, b):
        super().__init__(name, module, VALUES, [VALUES + ".op3_q"], {"WIDTH": width})
        self.clock, self.width, self.operation, self.operands = "", width, operation, (a, b)

    def wanted(self, netlist):
        return list(self.events) + [name for name, _, _ in self.operands]

    def record(self, netlist, values, cycles):
        """Inputs, outputs and events of each cycle, taken from the waves of a run."""
        at = [c for c in range(cycles) if values[self.events[0]][c] == "1"]

        def operand(source):
            name, low, high = source
            taken = [number(values[name][c][len(values[name][c]) - 1 - high:len(values[name][c]) - low]) for c in at]
            return [to_bits(value, self.width) for value in taken]
        a, b = operand(self.operands[0]), operand(self.operands[1])
        bits = len(netlist.outputs["y_o"])
        y = [to_bits(self.operation(number(one), number(two)), bits) for one, two in zip(a, b)]
        return Record({"a_i": a, "b_i": b}, {"y_o": y}, [1] * len(at), len(at))


class Tags(Piece):
    """A bank of the field cache's tags, with its list in a memory outside; operands from a simulation of the cache."""

    def __init__(self):
        super().__init__("tags", "sf_cache_tags", "", [], {"SETS": 256, "WAYS": 4, "LINE_BITS": 27}, idle=("go_i", "empty_i"))
        self.memories = ["list_q"]

    def wanted(self, netlist):
        return []

    def prepare(self, work, folder):
        lookups = os.path.join(work.build, "asic", "lookups")
        self.taken = cache.record(lookups, work.scene, work.data, work.root, work.sources(), folder, work.arguments.cycles)

    def record(self, netlist, values, cycles):
        return self.taken


def array(lanes):
    return Piece(f"values{lanes}", "sf_values", VALUES, [VALUES + ".op3_q"], {"LANES": lanes, "MACS": lanes}, ["sf_rows"],
                 {"u_weights.row_o": VALUES + ".row"}, ("valid_i", "h_valid_i", "load_i", "d1_taken_i", "c1_taken_i"), lanes)


def twin_array(lanes):
    """The MAC array with activations of 8 bits: what the integer twin would do with it."""
    piece = array(lanes)
    piece.name, piece.cut = f"twin{lanes}", dict.fromkeys(("feature_i", "dir_i", "h_i", "h_dir_i"), 4)
    return piece


def adders(lanes):
    banks = [f"{SUMS}.g_bank[{bank}].op2_q" for bank in (0, 1)]
    return Piece(f"sums{lanes}", "sf_sums", SUMS, banks, {"ROWS": 128, "ROW_BITS": 7, "OUTS": lanes, "ADDERS": lanes, "BANKS": 2, "TAP": 0}, ["sf_rows"],
                 {"u_weights.row_o": SUMS + ".row"}, ("valid_i", "load_i", "release_i"), lanes)


WEIGHT, VALUE = (VALUES + ".row2_q", 0, 7), (VALUES + ".value2_q", 4, 11)
PRODUCT, SUM, SUM_LOW = (VALUES + ".product3_q", 0, 19), (VALUES + ".from_row", 0, 26), (VALUES + ".from_row", 0, 7)


def all_pieces(root):
    """Of this RTL: one without a cache has no tags."""
    return ([Tags()] if os.path.exists(os.path.join(root, "rtl", "sf_cache_tags.sv")) else []) + [array(8), array(12), twin_array(8), adders(8), adders(12),
            Piece("neuron", "sf_plif", NEURON + ".g_unit[0].u_plif", [NEURON + ".valid_i"]),
            Piece("scale", "sf_scale", READOUT + ".u_scale", [READOUT + ".update_o"]),
            Piece("exp2", "sf_exp2", READOUT + ".u_exp2", [READOUT + ".update_o"]),
            Piece("sigmoid", "sf_sigmoid", READOUT + ".u_sigmoid", [READOUT + ".update_o"]),
            Piece("integrate", "sf_integrate", READOUT + ".u_integrate", [READOUT + ".update_o"]),
            Piece("readout", "sf_readout", READOUT, [READOUT + ".update_o"], idle=("density_begin_i", "density_valid_i", "colour_begin_i", "colour_valid_i")),
            Arithmetic("add8", "asic_add", 8, lambda a, b: a + b, WEIGHT, SUM_LOW),
            Arithmetic("add32", "asic_add", 32, lambda a, b: a + b, PRODUCT, SUM),
            Arithmetic("multiply8", "asic_multiply", 8, lambda a, b: a * b, WEIGHT, VALUE),
            Arithmetic("multiply32", "asic_multiply", 32, lambda a, b: a * b, SUM, PRODUCT)]


def counted_events(record):
    """Events in the cycles that are counted, cycles with an event, those cycles."""
    counted = record.events[WARM_UP:]
    return sum(counted), sum(n > 0 for n in counted), len(counted)
