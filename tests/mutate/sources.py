#!/usr/bin/env python3
"""Counts how many mutants of the RTL's source their checkers kill.

FOLDER/rtl/mutants is the list of the mutants (operators.py); FOLDER has the checkers, linked with hardware that holds
every mutant, of which SF_MUTANT=N in the environment chooses one. MODULE:CHECKER,... names a module's checkers; they run
in this order, and the first that fails, crashes or hangs kills the mutant. --modules: those of this run. --mutants: at
most so many per module, spread evenly, the same ones every time; 0 runs none: rows of the verdicts that are kept, in
FOLDER/results.MODULE (campaign.py). --listed: only looks whether every equivalent that is listed is a mutant.
Equivalent: listed with its reason in tests/mutate/equivalent-FOLDER. Exit 0 nothing unexplained survived, 1 not.
"""
import argparse
import os
import sys

sys.dont_write_bytecode = True  # the source tree stays as it is
import campaign


def unmeasured(folder, name):
    command = os.path.abspath(f"{folder}/{name}")
    with open(command, "rb") as f:
        return campaign.Checker(name, command, campaign.digest(f.read()), None)


def limited(folder, checker):
    """The checker with its limit, which is kept: without a mutant it takes its whole time."""
    path, kept = f"{folder}/limit.{checker.name}", []
    if os.path.exists(path):
        with open(path) as f:
            kept = f.read().split()
    if len(kept) == 2 and kept[0] == checker.key:
        return checker._replace(limit=int(kept[1]))
    found = campaign.measured(checker.name, checker.command, checker.key)
    with open(path, "w") as f:
        f.write(f"{found.key} {found.limit}\n")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("modules_checkers", nargs="+", metavar="MODULE:CHECKER,...")
    parser.add_argument("--mutants", type=int, default=sys.maxsize)
    parser.add_argument("--modules", default="")
    parser.add_argument("--listed", action="store_true")
    given = parser.parse_intermixed_args()
    checkers_of = {module: checkers.split(",") for module, checkers in (m.split(":") for m in given.modules_checkers)}
    modules = given.modules.split() or list(checkers_of)
    with open(f"{given.folder}/rtl/mutants") as f:
        fields = [line.rstrip("\n").split("\t") for line in f]
    mutants = campaign.unique([campaign.Mutant(int(n), module, place, what) for n, module, place, what in fields])
    of = {module: [m for m in mutants if m.module == module] for module in checkers_of}
    for module in modules:
        if not of.get(module):
            raise campaign.Stop(f"{module} is no mutated module")
    equivalents = campaign.Equivalents(f"tests/mutate/equivalent-{os.path.basename(given.folder)}", checkers_of)
    for module in checkers_of:
        equivalents.match(module, of[module])
    if given.listed:
        return 0

    score = campaign.Score(equivalents)
    for module in modules:
        checkers = [unmeasured(given.folder, name) for name in checkers_of[module]]
        results = campaign.Results(f"{given.folder}/results.{module}", campaign.of_checkers(checkers))
        chosen = campaign.sample(of[module], given.mutants, results)
        pending = equivalents.last([m for m in chosen if m.number not in results.verdicts])
        if pending:
            checkers = [limited(given.folder, c) for c in checkers]
        progress = campaign.Progress(module, len(chosen) - len(pending), len(chosen))
        campaign.judge_all(pending, campaign.against(checkers), results, progress, int(os.environ.get("MUTANT_JOBS", "2")))
        progress.end()
        score.row(module, chosen, len(of[module]), results)
    return score.end(f"{given.folder}/mutate.json")


if __name__ == "__main__":
    campaign.stop_at(main)
