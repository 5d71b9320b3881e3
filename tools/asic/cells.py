"""A cell of a liberty file: what it computes, what its pins weigh, and what each of its events costs."""
import re

TOKEN = re.compile(r"\s*([A-Za-z_][\w\[\].]*|[01]|[!'&*|+^()])")


class Expression:
    """A function of liberty's: !A, A', A & B, A * B, A B, A | B, A + B, A ^ B, parentheses, 0 and 1."""

    def __init__(self, text, fail):
        self.text, self.names, self.fail = text, set(), fail
        self.tokens, at = [], 0
        while at < len(text.rstrip()):
            found = TOKEN.match(text, at)
            if not found:
                fail(f"'{text}' is no function: '{text[at:].strip()}'")
            self.tokens.append(found.group(1))
            at = found.end()
        self.python = self.either()
        if self.tokens:
            fail(f"'{text}' is no function: '{self.tokens[0]}' is too much")
        self.code = compile(self.python, "function", "eval")

    def peek(self):
        return self.tokens[0] if self.tokens else ""

    def chain(self, part, signs, sign):
        """Terms of one level of precedence, joined by `signs`, as Python with `sign`."""
        text = part()
        while self.peek() in signs and self.peek():
            self.tokens.pop(0)
            text = f"({text} {sign} {part()})"
        return text

    def either(self):
        return self.chain(self.both, "|+", "|")

    def both(self):
        """Terms joined by AND, whose sign may be left out."""
        text = self.unequal()
        while self.peek() and self.peek() not in ("|", "+", ")"):
            if self.peek() in "&*":
                self.tokens.pop(0)
            text = f"({text} & {self.unequal()})"
        return text

    def unequal(self):
        return self.chain(self.one, "^", "^")

    def one(self):
        """A pin, a constant, a term in brackets or a negation, as Python."""
        token = self.tokens.pop(0) if self.tokens else ""
        if token == "!":
            text = f"(1 ^ {self.one()})"
        elif token == "(":
            text = self.either()
            if not self.tokens or self.tokens.pop(0) != ")":
                self.fail(f"'{self.text}' is no function: ')' is missing")
        elif token in ("0", "1"):
            text = token
        elif re.match(r"[A-Za-z_]", token):
            self.names.add(token)
            text = f"v[{token!r}]"
        else:
            self.fail(f"'{self.text}' is no function")
        while self.peek() == "'":
            self.tokens.pop(0)
            text = f"(1 ^ {text})"
        return text

    def value(self, values):
        return eval(self.code, {"__builtins__": {}, "v": values})  # its text was made above, of names, signs and digits

    def verilog(self, names=None):
        names = names or {}
        text = re.sub(r"v\['([^']*)'\]", lambda found: names.get(found.group(1), found.group(1)), self.python)
        return text.replace("(1 ^ ", "(1'b1 ^ ")


class Power:
    """One internal_power group of a pin: rise and fall tables, related pins, condition."""

    def __init__(self, cell, group):
        library = cell.library
        self.related = (group.get("related_pin") or "").replace('"', "").split()
        self.rail = group.get("related_pg_pin", "")
        when = group.get("when")
        self.when = cell.expression(group, when, "when") if when else None
        self.tables = {}
        for name, directions in (("rise_power", (1,)), ("fall_power", (0,)), ("power", (0, 1))):
            for table in group.all(name):
                for direction in directions:
                    self.tables[direction] = library.table(table, library.joules)


class Cell:
    """Pins, function and tables; parsed when first needed, so that a strange cell disturbs only who uses it."""

    def __init__(self, library, name):
        self.library, self.name, self.group = library, name, library.cells[name]
        self.pins = {pin_name: pin for pin in self.group.all("pin") for pin_name in pin.arguments}
        self.inputs = [name for name, pin in self.pins.items() if pin.get("direction") == "input"]
        self.outputs = [name for name, pin in self.pins.items() if pin.get("direction") == "output"]
        self.state = (self.group.all("ff", "latch") + [None])[0]
        self.gate = self.group.get("clock_gating_integrated_cell")
        self.area = library.number(self.group, "area", 0.0)
        self.parsed = {}
        self.functions = {name: self.expression(self.pins[name], self.pins[name].get("function"), "function") for name in self.outputs
                          if self.pins[name].get("function")}
        self.leakage = self.mean_leakage()

    def powers(self, pin):
        if pin not in self.parsed:
            self.parsed[pin] = [Power(self, group) for group in self.pins[pin].all("internal_power")]
        return self.parsed[pin]

    def expression(self, group, text, attribute):
        return Expression(text, lambda what: self.library.fail(group, f"cell '{self.name}': {what}", attribute))

    def capacitance(self, pin):
        group = self.pins[pin]
        if group.get("capacitance") is None:
            return self.library.number(self.library.top, "default_input_pin_cap", 0.0) * self.library.farads
        return self.library.number(group, "capacitance") * self.library.farads

    def mean_leakage(self):
        """nW: cell_leakage_power, or the mean over the states that the file tells apart; None where it says nothing."""
        if self.library.leakage is None:
            return None
        if self.group.get("cell_leakage_power"):
            return self.library.number(self.group, "cell_leakage_power") * self.library.leakage
        values = [self.library.number(group, "value") for group in self.group.all("leakage_power") if group.get("value")]
        return sum(values) / len(values) * self.library.leakage if values else None

    def clock_pins(self):
        """Input pins that clock the state: of clock gates, too."""
        if self.gate:
            return [name for name, pin in self.pins.items() if pin.get("clock_gate_clock_pin") == "true"]
        if self.state is None:
            return []
        text = self.state.get("clocked_on") or self.state.get("enable") or ""
        return sorted(self.expression(self.state, text, "clocked_on").names) if text else []

    def sequential(self):
        return self.state is not None or self.gate is not None

    def truth(self, output):
        """The output's values over the inputs' binary numbers, first input lowest."""
        function = self.functions[output]
        return [function.value({name: (number >> i) & 1 for i, name in enumerate(self.inputs)}) for number in range(1 << len(self.inputs))]

    def arcs(self, output, kinds):
        """[(related pins, {kind: Table})] of the timing groups that make this output change."""
        found = []
        for group in self.pins[output].all("timing"):
            tables = {kind: self.library.table(table, self.library.time) for kind in kinds for table in group.all(kind)}
            if tables:
                found.append(((group.get("related_pin") or "").split(), tables))
        return found


def holds(power, values):
    """Does the group's condition hold? Names that are no pins (a state inside) are looked up as the output that shows it."""
    if power.when is None:
        return True
    if not power.when.names <= values.keys():
        return False
    return power.when.value(values) == 1


def event_energy(cell, pin, direction, related, values, slew, load):
    """fJ of one edge of a pin. related: the input that caused an output's edge, else None; values: all pins after the edge."""
    groups = [power for power in cell.powers(pin) if direction in power.tables]
    if related is not None:
        groups = [power for power in groups if related in power.related] or [power for power in groups if not power.related] or groups
    if not groups:
        return 0.0
    total = 0.0
    for rail in sorted({power.rail for power in groups}):
        here = [power for power in groups if power.rail == rail]
        true = [power for power in here if power.when is not None and holds(power, values)]
        chosen = true or [power for power in here if power.when is None]
        if not chosen and related is not None:
            chosen = here
        if chosen:
            total += sum(power.tables[direction].at(slew, load) for power in chosen) / len(chosen)
    return total
