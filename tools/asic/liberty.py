"""Reads a liberty file: groups and attributes with their lines, units, tables. Errors name file, line and what is wrong."""
import bisect
import gzip
import re
import zlib

SPACE = re.compile(r"(?:\s|\\\r?\n|/\*.*?\*/|//[^\n]*)*", re.S)
HEAD = re.compile(r"([A-Za-z_][\w.\[\]-]*)\s*([:(])")
VALUE = re.compile(r'\s*("[^"]*"|[^;\n{}"]+)[ \t]*;?')
ARGUMENTS = re.compile(r'((?:"[^"]*"|[^"(){};])*)\)\s*([{;]?)')
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
OPERATION = re.compile(r"[^;]*;")  # "a = b * c;" of parameterised libraries


class LibertyError(Exception):
    """What is wrong with a liberty file, and where."""


class Group:
    """name (arguments) { attributes; groups }"""

    def __init__(self, name, arguments, line, start):
        self.name, self.arguments, self.line, self.start, self.end = name, arguments, line, start, start
        self.attributes, self.lines, self.groups = {}, {}, []

    def get(self, name, default=None):
        return self.attributes.get(name, default)

    def all(self, *names):
        return [group for group in self.groups if group.name in names]

    @property
    def title(self):
        return self.arguments[0] if self.arguments else ""


def words(text):
    """Arguments of a group or of a complex attribute, without quotes."""
    return [word.strip().strip('"').strip() for word in re.findall(r'"[^"]*"|[^,\s"]+', text.replace("\\\n", " ").replace("\\\r\n", " "))]


def read_text(path):
    """The text of a file, also of one that gzip packed."""
    try:
        with open(path, "rb") as file:
            data = file.read()
    except OSError as error:
        raise LibertyError(f"{path}: {error.strerror}") from error
    if data[:2] == b"\x1f\x8b":
        try:
            data = gzip.decompress(data)
        except (EOFError, OSError, zlib.error) as error:
            raise LibertyError(f"{path}: the packed file is damaged or cut off: {error}") from error
    if b"\0" in data:
        raise LibertyError(f"{path}: not a text file")
    return data.decode("utf-8", errors="replace")


class Parser:
    """One pass over the text."""

    def __init__(self, path, text):
        self.path, self.text, self.at = path, text, 0
        self.breaks = [found.start() for found in re.finditer("\n", text)]

    def line(self, at):
        return bisect.bisect_left(self.breaks, at) + 1

    def fail(self, at, what):
        raise LibertyError(f"{self.path}:{self.line(at)}: {what}")

    def library(self):
        """Read the whole text: the outermost group, with all groups below it."""
        stack, top = [], None
        while True:
            self.at = SPACE.match(self.text, self.at).end()
            if self.at == len(self.text):
                break
            if self.text[self.at] in "};":
                if self.text[self.at] == "}":
                    if not stack:
                        self.fail(self.at, "'}' closes nothing")
                    stack[-1].end = self.at + 1
                    stack.pop()
                self.at += 1
                continue
            top = self.statement(stack, top)
        if stack:
            self.fail(len(self.text), f"the file ends inside '{stack[-1].name} ({stack[-1].title})', which line {stack[-1].line} opens: is it cut off?")
        if top is None or top.name != "library":
            raise LibertyError(f"{self.path}:1: no 'library (NAME) {{': not a liberty file")
        return top

    def statement(self, stack, top):
        """Read one attribute, or the head of a group, which goes on the stack."""
        start = self.at
        head = HEAD.match(self.text, start)
        if not head:
            operation = OPERATION.match(self.text, start) if stack else None
            if not operation:
                self.fail(start, f"expected an attribute or a group, found '{self.text[start:start + 30].splitlines()[0]}'")
            self.at = operation.end()
            return top
        name, line = head.group(1), self.line(start)
        body = (VALUE if head.group(2) == ":" else ARGUMENTS).match(self.text, head.end())
        if not body:
            self.fail(start, f"'{name}' is cut off or not closed")
        self.at = body.end()
        if head.group(2) == "(" and body.group(2) == "{":
            group = Group(name, words(body.group(1)), line, start)
            if stack:
                stack[-1].groups.append(group)
            elif top is not None:
                self.fail(start, f"'{name}' stands outside the library")
            stack.append(group)
            return top or group
        if not stack:
            self.fail(start, f"'{name}' stands outside the library")
        value = body.group(1).strip() if head.group(2) == ":" else words(body.group(1))
        stack[-1].attributes[name] = value.strip('"').strip() if isinstance(value, str) else value
        stack[-1].lines[name] = line
        return top


TIME_UNITS = {"ns": 1e3, "ps": 1.0, "fs": 1e-3, "us": 1e6}  # in ps
VOLTAGE_UNITS = {"V": 1.0, "mV": 1e-3}
CAPACITANCE_UNITS = {"ff": 1.0, "pf": 1e3}  # in fF
LEAKAGE_UNITS = {"mW": 1e6, "uW": 1e3, "nW": 1.0, "pW": 1e-3}  # in nW


class Library:
    """A parsed library in ps, V, fF, fJ and nW."""

    def __init__(self, path, power=True):
        self.path = path
        self.text = read_text(path)
        self.top = Parser(path, self.text).library()
        self.name = self.top.title
        self.cells = {cell.title: cell for cell in self.top.all("cell")}
        if not self.cells:
            self.fail(self.top, "the library has no cells")
        self.units()
        self.voltage = self.operating_point()
        self.templates = {group.title: group for group in self.top.all("lu_table_template", "power_lut_template")}
        if power and not any(pin.all("internal_power") for cell in self.cells.values() for pin in cell.all("pin")):
            self.fail(self.top, "no cell has tables of internal power ('internal_power'): energies cannot be taken from this library")

    def fail(self, group, what, attribute=None):
        line = group.lines.get(attribute, group.line) if attribute else group.line
        raise LibertyError(f"{self.path}:{line}: {what}")

    def unit(self, attribute, scales, required=True):
        """A unit of the library in SI units, by `scales`; refused when it is another, or missing and required."""
        text = self.top.get(attribute)
        if text is None:
            if required:
                self.fail(self.top, f"the library does not say its '{attribute}'")
            return None
        found = re.fullmatch(r"(10*)\s*([A-Za-z]+)", text)
        if not found or found.group(2) not in scales:
            self.fail(self.top, f"'{attribute}' is '{text}', not 1, 10 or 100 of {', '.join(scales)}", attribute)
        return float(found.group(1)) * scales[found.group(2)]

    def units(self):
        """Time, voltage, leakage and capacitance units of the library."""
        self.time = self.unit("time_unit", TIME_UNITS)
        self.volts = self.unit("voltage_unit", VOLTAGE_UNITS)
        self.leakage = self.unit("leakage_power_unit", LEAKAGE_UNITS, required=False)
        load = self.top.get("capacitive_load_unit")
        if load is None:
            self.fail(self.top, "the library does not say its 'capacitive_load_unit'")
        if not isinstance(load, list) or len(load) != 2 or not NUMBER.fullmatch(load[0]) or load[1].lower() not in CAPACITANCE_UNITS:
            self.fail(self.top, f"'capacitive_load_unit' is '{', '.join(load)}', not a number of ff or pf", "capacitive_load_unit")
        self.farads = float(load[0]) * CAPACITANCE_UNITS[load[1].lower()]
        if self.farads <= 0:
            self.fail(self.top, f"'capacitive_load_unit' is '{', '.join(load)}'", "capacitive_load_unit")
        self.joules = self.farads * self.volts * self.volts
        model = self.top.get("delay_model", "table_lookup")
        if model != "table_lookup":
            self.fail(self.top, f"'delay_model' is '{model}', not table_lookup", "delay_model")

    def operating_point(self):
        """The voltage in V; sets the temperature. From the default operating conditions, else the nominal values."""
        wanted = self.top.get("default_operating_conditions")
        points = [group for group in self.top.all("operating_conditions") if wanted in (None, group.title)]
        self.temperature = self.top.get("nom_temperature")
        for group in points[:1]:
            self.temperature = group.get("temperature", self.temperature)
            if group.get("voltage"):
                return self.number(group, "voltage") * self.volts
        if self.top.get("nom_voltage") is None:
            self.fail(self.top, "the library says no voltage (operating_conditions or nom_voltage)")
        return self.number(self.top, "nom_voltage") * self.volts

    def number(self, group, attribute, default=None):
        """An attribute as a float; refused with its line when it is none."""
        text = group.get(attribute)
        if text is None and default is not None:
            return default
        if text is None or isinstance(text, list) or not NUMBER.fullmatch(text):
            self.fail(group, f"'{attribute}' of '{group.name} ({group.title})' is '{text}', not a number", attribute)
        return float(text)

    def numbers(self, group, attribute, texts):
        """Quoted lists of numbers as one list of floats."""
        found = [part for text in texts for part in re.split(r"[,\s]+", text.replace("\\", " ")) if part]
        for part in found:
            if not NUMBER.fullmatch(part):
                self.fail(group, f"'{attribute}' of '{group.name}' holds '{part}', not a number", attribute)
        return [float(part) for part in found]

    def table(self, group, scale):
        """A Table of a group like rise_power (template) { index_1(...); values(...); }; its values times scale."""
        template = self.templates.get(group.title)
        if template is None and group.title != "scalar":
            self.fail(group, f"'{group.name}' uses the template '{group.title}', which the library lacks")
        axes, points = [], []
        for i in (1, 2, 3):
            variable = template.get(f"variable_{i}") if template else None
            if variable is None:
                break
            source = group if group.get(f"index_{i}") else template
            if source.get(f"index_{i}") is None:
                self.fail(group, f"'{group.name}' has no 'index_{i}'")
            axes.append(variable)
            points.append(self.numbers(source, f"index_{i}", source.get(f"index_{i}")))
        if group.get("values") is None:
            self.fail(group, f"'{group.name}' has no 'values'")
        values = self.numbers(group, "values", group.get("values"))
        expected = 1
        for axis in points:
            expected *= len(axis)
        if len(values) != expected:
            self.fail(group, f"'{group.name}' has {len(values)} values, its indices ask for {expected}", "values")
        for axis in points:
            if any(a >= b for a, b in zip(axis, axis[1:])):
                self.fail(group, f"an index of '{group.name}' does not rise")
        return Table(self, group, axes, points, [value * scale for value in values])


SLEWS = ("input_transition_time", "input_net_transition", "related_pin_transition")


class Table:
    """Values over slew (ps) and load (fF), linear between the points and beyond them."""

    def __init__(self, library, group, axes, points, values):
        if len(axes) > 2:
            library.fail(group, f"'{group.name}' depends on {len(axes)} variables; tables of slew and load are read")
        self.kinds, self.points, self.values = [], [], values
        for axis, point in zip(axes, points):
            if axis in SLEWS:
                self.kinds.append("slew")
                self.points.append([p * library.time for p in point])
            elif axis == "total_output_net_capacitance":
                self.kinds.append("load")
                self.points.append([p * library.farads for p in point])
            else:
                library.fail(group, f"'{group.name}' depends on '{axis}'; tables of slew and load are read")

    def at(self, slew, load):
        """The table's value for a slew and a load, interpolated and beyond its ends extrapolated."""
        shares = []
        for kind, points in zip(self.kinds, self.points):
            x = slew if kind == "slew" else load
            if len(points) == 1:
                shares.append((0, 0.0))
                continue
            i = min(max(bisect.bisect_right(points, x) - 1, 0), len(points) - 2)
            shares.append((i, (x - points[i]) / (points[i + 1] - points[i])))
        if not shares:
            return self.values[0]
        if len(shares) == 1:
            return self.between(shares[0], 0)
        (i, f), width = shares[0], len(self.points[1])
        low = self.between(shares[1], i * width)
        return low if f == 0 else low + f * (self.between(shares[1], (i + 1) * width) - low)

    def between(self, share, base):
        i, f = share
        low = self.values[base + i]
        return low if f == 0 else low + f * (self.values[base + i + 1] - low)
