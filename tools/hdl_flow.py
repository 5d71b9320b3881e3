"""What the targets that take the RTL through other tools share: fpga.py, asic_energy.py, asic_netlist.py, netlist_check.py, board.py."""
import fcntl
import hashlib
import os
import sys
import time


class Stop(Exception):
    """An error that a user can act on, and the exit status."""

    def __init__(self, message, status=1):
        super().__init__(message)
        self.status = status


def run(program, main, errors=()):
    """Exits with what main() returns; an error becomes one line. errors: exceptions of the program's own modules."""
    try:
        sys.exit(main())
    except Stop as stop:
        print(f"{program}: {stop}", file=sys.stderr)
        sys.exit(stop.status)
    except errors as error:
        print(f"{program}: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print(f"{program}: interrupted; what is finished is kept", file=sys.stderr)
        sys.exit(130)


_locks = []


def alone(folder):
    """Makes the folder if need be. Until this program ends no other one that asks for the same folder gets it: that raises Stop."""
    os.makedirs(folder, exist_ok=True)
    _locks.append(open(os.path.join(folder, "lock"), "w", encoding="utf-8"))
    try:
        fcntl.flock(_locks[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise Stop(f"another run is at work in {folder}: wait for it, or take another build folder (make B=FOLDER ...)") from None


class Spent:
    """Time since it was made, of this program and of those that it ran: the processor's, and by the clock."""

    def __init__(self):
        self.began, self.used = time.monotonic(), sum(os.times()[:4])

    def processor(self):
        return sum(os.times()[:4]) - self.used

    def __str__(self):
        return f"{self.processor():.0f} s of processor time, {time.monotonic() - self.began:.0f} s by the clock"


def write(path, text):
    """A file that is whole or not there."""
    with open(path + ".aside", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(path + ".aside", path)


def digest(*parts):
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def hash_of(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def sources_of(root):
    """RTL files, packages first, relative to the root."""
    listed = [os.path.join(folder, name) for folder in ("rtl/gen", "rtl") for name in sorted(os.listdir(os.path.join(root, folder)))
              if name.endswith(".sv")]
    return sorted(listed, key=lambda name: not name.endswith("_pkg.sv"))


def module_of(text, root):
    """NAME[:PARAMETER=N,...] as the module's name and {parameter: value}. Raises Stop where it is no module of the RTL."""
    module, _, listed = text.partition(":")
    parameters = dict(part.split("=", 1) for part in listed.split(",") if "=" in part)
    if listed and len(parameters) != len(listed.split(",")):
        raise Stop(f"--modules: '{text}' is not NAME:PARAMETER=N,...", 2)
    if not os.path.exists(os.path.join(root, "rtl", module + ".sv")):
        raise Stop(f"rtl/{module}.sv is not there")
    return module, parameters
