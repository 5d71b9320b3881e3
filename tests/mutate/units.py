#!/usr/bin/env python3
"""Mutates RTL units and counts how many mutants their checkers kill.

Units, checkers and domains: tests/mutate/modules. Yosys lists every mutant of a unit (netlist.py); those of a run go into
one netlist, CHUNK at a time, of which SF_MUTANT=N in the environment chooses one when the program starts. Killed: the
checker fails, crashes or hangs. Equivalent: proven by Yosys, or listed with its reason in tests/mutate/equivalent.
--mutants: at most so many per unit, spread evenly, the same ones every time; 0 runs none: rows of the verdicts that are
kept, in BUILD/mutate/MODULE (campaign.py). --sample: a few mutants of a few units, in seconds, for `make check`.
Exit 0 nothing unexplained survived, 1 not, 77 no tool.
"""
import argparse
import collections
import glob
import os
import shutil
import sys

sys.dont_write_bytecode = True  # the source tree stays as it is
import campaign
import netlist

Unit = collections.namedtuple("Unit", "module sources checker domain")
CHUNK = 400
SAMPLE = ("sf_sigmoid", "sf_stream_out")


def table():
    """tests/mutate/modules, by name."""
    units = {}
    with open("tests/mutate/modules") as f:
        for line in f:
            field = line.split()
            if field and not line.startswith("#"):
                units[field[0]] = Unit(field[0], [] if field[1] == "-" else [field[1]], field[2], field[3])
    return units


def key_of(unit):
    """Of all that decides a verdict."""
    files = [f"rtl/{unit.module}.sv", unit.checker, "include/spikefield/arch.def", "tests/mutate/netlist.py"] + unit.sources
    files += netlist.PACKAGES + sorted(glob.glob("rtl/*.svh") + glob.glob("src/fx/*.[ch]"))
    return campaign.digest(repr(unit), *[open(f, "rb").read() for f in files])


def chunks(items, size):
    return [items[i:i + size] for i in range(0, len(items), size)]


def judge(unit, work, chosen, results, key, build, equivalents):
    """Gives every chosen mutant its verdict."""
    jobs = int(os.environ.get("MUTANT_JOBS", "2"))
    pending = equivalents.last([m for m in chosen if m.number not in results.verdicts])
    progress = campaign.Progress(unit.module, len(chosen) - len(pending), len(chosen))
    for chunk in chunks(pending, CHUNK):
        program = netlist.program(unit, work, chunk, build)
        checkers = [campaign.measured(f"the checker of {unit.module}", program, key)]
        campaign.judge_all(chunk, campaign.against(checkers, netlist.prover(unit, work)), results, progress, jobs)
    progress.end()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("modules", nargs="*")
    parser.add_argument("--mutants", type=int, default=sys.maxsize)
    parser.add_argument("--sample", action="store_true")
    given = parser.parse_intermixed_args()
    for tool in ("yosys", "verilator"):
        if not shutil.which(tool):
            print(f"mutate: {tool} is not installed")
            return 77
    units, folder = table(), f"{given.build}/mutate"
    modules, most = given.modules or list(units), given.mutants
    if given.sample:
        modules, most, folder = list(SAMPLE), 24, folder + "/sample"
    for module in modules:
        if module not in units:
            raise campaign.Stop(f"{module} is not in tests/mutate/modules")
    equivalents = campaign.Equivalents("tests/mutate/equivalent", units)
    lists = {}
    for module in modules:
        lists[module] = netlist.mutants(units[module], f"{folder}/{module}", key_of(units[module]))
        equivalents.match(module, lists[module])
    score = campaign.Score(equivalents)
    for module, mutants in lists.items():
        unit, work = units[module], f"{folder}/{module}"
        key = key_of(unit)
        results = campaign.Results(f"{work}/results", campaign.of_checkers([campaign.Checker(module, None, key, None)]))
        chosen = campaign.sample(mutants, most, results)
        judge(unit, work, chosen, results, key, given.build, equivalents)
        score.row(module, chosen, len(mutants), results)
    return score.end(f"{folder}/mutate.json")


if __name__ == "__main__":
    campaign.stop_at(main)
