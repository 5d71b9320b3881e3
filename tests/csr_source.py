"""An independent reading of csr.def, arch.def and event.def of a tree, as text. For crosscheck_registers.py."""
import os
import re
import sys

TREE = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(__file__), ".."))
faults = []


def fault(text):
    faults.append(text)


def text_of(path):
    with open(os.path.join(TREE, path), encoding="utf-8") as file:
        return file.read()


def same(what, got, expected):
    """Dictionaries key by key, so that a fault names the register."""
    for key in sorted(set(got) | set(expected)):
        if got.get(key) != expected.get(key):
            fault(f"{what}: {key} is {got.get(key)}, csr.def has {expected.get(key)}")


# ---- the source, read as text

def calls(text):
    """(macro, arguments) of every SF_...(...) outside comments and preprocessor lines."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r"^#.*$", "", text, flags=re.M)
    token = re.compile(r'"(?:[^"\\]|\\.)*"|[(),]|[^"(),]+')
    for start in re.finditer(r"SF_[A-Z_]+\(", text):
        depth, arguments = 1, [""]
        for part in token.findall(text[start.end():]):
            depth += (part == "(") - (part == ")")
            if depth == 0:
                break
            if part == "," and depth == 1:
                arguments.append("")
            else:
                arguments[-1] += part
        if depth == 0 and start.group() in ("SF_ARCH(", "SF_CSR(", "SF_CSR_FIELD(", "SF_CSR_WINDOW(", "SF_CSR_MEMORY("):
            yield start.group()[:-1], [a.strip() for a in arguments]


ARCH = {}


def value(expression):
    expression = re.sub(r"SF_([A-Z_0-9]+)", lambda m: str(ARCH[m.group(1)]), expression)
    assert re.fullmatch(r"[0-9a-fA-Fx|<>+()\s-]+", expression), expression
    return eval(expression)  # pylint: disable=eval-used


for kind, words in calls(text_of("include/spikefield/arch.def")):
    if kind == "SF_ARCH":
        ARCH[words[0]] = value(words[1])


def read_source():
    registers, memories = {}, {}
    for macro, a in calls(text_of("include/spikefield/csr.def")):
        if macro == "SF_CSR":
            registers[a[0]] = {"offset": value(a[1]), "access": a[2], "reset": value(a[3]), "fields": {}}
        elif macro == "SF_CSR_FIELD":
            registers[a[0]]["fields"][a[1]] = (int(a[2]), int(a[3]))
        elif macro == "SF_CSR_WINDOW":
            memories[a[0]] = {"words": value(a[1]), "bits": int(a[2]), "base": registers[a[0]]["offset"]}
        elif macro == "SF_CSR_MEMORY":
            memories[a[0]] = {"words": value(a[3]), "bits": int(a[4]), "base": 0, "address": a[1], "data": a[2]}
    assert len(registers) > 30 and len(memories) == 3, "csr.def was not understood"
    return registers, memories


REGISTERS, MEMORIES = read_source()
EVENTS = re.findall(r"^  X\(([A-Z_]+), (\w+), (\"[^\"]*\"), (\"[^\"]*\"), \d+\)", text_of("include/spikefield/event.def"), re.M)
assert len(EVENTS) == MEMORIES["COUNTERS"]["words"] // 64, "event.def was not understood"
WINDOWS = {name for name, m in MEMORIES.items() if "address" not in m}


def rules():
    """What csr.def must keep, whatever it says."""
    offsets = [r["offset"] for r in REGISTERS.values()]
    if len(set(offsets)) != len(offsets) or any(o % 4 for o in offsets):
        fault("csr.def: offsets repeat or are no multiples of 4")
    for name, r in REGISTERS.items():
        bits = [b for lsb, width in r["fields"].values() for b in range(lsb, lsb + width)]
        if len(set(bits)) != len(bits) or any(b > 31 for b in bits):
            fault(f"csr.def: fields of {name} overlap or leave the register")


def with_whole(registers):
    """As languages see it that know no register without a field. Windows are memories there."""
    return {
        name: (r["offset"], r["access"], tuple(sorted(
            (field, lsb, width, None if r["access"] == "WO" else r["reset"] >> lsb & ((1 << width) - 1))
            for field, (lsb, width) in (r["fields"] or {"VALUE": (0, 32)}).items())))
        for name, r in registers.items() if name not in WINDOWS
    }
