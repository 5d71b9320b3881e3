#!/usr/bin/python3
"""Mutates C files and counts how many mutants the test programs kill. `make mutate-c` runs it.

A mutant is a file with one change (c_operators.py), compiled with the file's own flags. Equal object code: equivalent.
Otherwise the test programs that reach the changed line (c_reach.py) are linked with it and run, the fastest first, each
with a limit of some times the processor time that it takes without a mutant. The first that fails, crashes or hangs kills
the mutant. A survivor is compiled once more for the address and undefined-behaviour sanitizers, and its shorter programs run
again: they see accesses out of bounds, and memory that is not released. Known equivalents have their reasons in
tests/mutate/equivalent-c.

BUILD/mutate-c keeps every verdict at once (results, a line of JSON each), so an interrupted run goes on where it was. A
verdict is dropped when its file, or a program that decided it, has changed. The table is printed, and written beside the
results as mutate.json and mutate.md.
Exit 0 nothing unexplained survived, 1 not, 77 a package is missing.
"""
import argparse
import concurrent.futures
import glob
import os
import random
import shutil
import subprocess
import sys
import threading
import time

sys.dont_write_bytecode = True  # the source tree stays as it is
import c_build
import c_operators
import c_reach
import campaign

SANITIZED_SECONDS = 4  # programs that take longer do not run again under the sanitizers
ROOMS = ["src/train", "src/quant", "src/energy", "src/audit", "src/scene"]


class Judge:
    """Gives a mutant its verdict. edits: by the mutant's number; deadline: a time, or None."""

    def __init__(self, build, reach, edits, deadline):
        self.build, self.reach, self.edits, self.deadline = build, reach, edits, deadline
        self.originals, self.sources, self.leaks, self.lock = {}, {}, {}, threading.Lock()

    def prepare(self, path):
        """A file's object without a mutant."""
        with open(path, "rb") as f:
            self.sources[path] = f.read()
        to = f"{self.build.work}/original.{path.replace('/', '.')}.o"
        if not self.build.compile(path, self.sources[path], to):
            raise campaign.Stop(f"{path} does not compile")
        with open(to, "rb") as f:
            self.originals[path] = f.read()
        os.remove(to)

    def tests(self, mutant):
        edit = self.edits[mutant.number]
        return self.reach.of(mutant.module, edit.first, edit.last)

    def key(self, mutant, tests):
        return campaign.digest(self.originals[mutant.module], *[self.reach.tests[name]["key"] for name in tests])

    def survivor_key(self, mutant):
        return campaign.digest(self.key(mutant, self.tests(mutant)), " ".join(c_build.SANITIZED))

    def valid(self, chosen):
        """Whether a kept verdict is of what is there now, as campaign.Results asks; those of other runs stay."""
        there = {m.number: m for m in chosen}

        def valid(number, verdict):
            mutant = there.get(number)
            if not mutant:
                return True
            if verdict.verdict == "killed":
                return verdict.checker in self.reach.tests and verdict.key == self.key(mutant, [verdict.checker])
            return verdict.key == (self.survivor_key(mutant) if verdict.verdict == "survived" else self.key(mutant, []))
        return valid

    def one(self, mutant):
        """As campaign.judge_all asks."""
        start = time.time()
        if self.deadline and start >= self.deadline:
            raise campaign.Late()
        folder = f"{self.build.work}/work.{threading.get_ident()}"
        os.makedirs(f"{folder}/tmp", exist_ok=True)
        try:
            verdict, key, checker = self.judged(mutant, folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return campaign.Verdict(verdict, key, time.time() - start, checker)

    def judged(self, mutant, folder):
        edit, path, changed = self.edits[mutant.number], mutant.module, f"{folder}/mutant.o"
        source = self.sources[path]
        if not self.build.compile(path, source[:edit.start] + edit.new.encode() + source[edit.end:], changed):
            return "invalid", self.key(mutant, []), "-"
        with open(changed, "rb") as f:
            if f.read() == self.originals[path]:
                return "equivalent", self.key(mutant, []), "-"
        tests = self.tests(mutant)
        for name in tests:
            if self.fails(name, changed, folder):
                return "killed", self.key(mutant, [name]), name
        if self.build.compile(path, source[:edit.start] + edit.new.encode() + source[edit.end:], changed, c_build.SANITIZED):
            for name in (name for name in tests if self.reach.tests[name]["seconds"] <= SANITIZED_SECONDS):
                leaks = self.sanitized(path, name, folder)
                if leaks is not None and self.fails(name, changed, folder, leaks):
                    return "killed", self.key(mutant, [name]), name
        return "survived", self.survivor_key(mutant), "-"

    def fails(self, name, changed, folder, leaks=None):
        """Whether a test program fails with the file's object in its place; leaks: that was made for the sanitizers, and
        whether memory that is not released fails it, too."""
        program = f"{folder}/{name}"
        self.build.link_mutant(name, changed, program, [] if leaks is None else c_build.SANITIZED)
        environment = c_reach.environment(os.path.abspath(f"{folder}/tmp"), self.reach.tests[name]["fork"])
        if leaks is not None:
            environment["ASAN_OPTIONS"] = f"detect_leaks={int(leaks)}"
        failed = campaign.run(self.reach.checker(name, program), 0, environment, self.deadline) is not False
        os.remove(program)
        return failed

    def sanitized(self, path, name, folder):
        """How a test program passes with the file itself made for the sanitizers: True with leaks detected, False without;
        None if it does not."""
        with self.lock:
            if (path, name) not in self.leaks:
                whole = f"{folder}/whole.o"
                if not self.build.compile(path, self.sources[path], whole, c_build.SANITIZED):
                    raise campaign.Stop(f"{path} does not compile for the sanitizers")
                self.leaks[path, name] = next((l for l in (True, False) if not self.fails(name, whole, folder, l)), None)
            return self.leaks[path, name]


def parse(pair):
    return c_operators.mutants(*pair)


def parsed(build, files, jobs):
    """{file: its mutants and their edits}."""
    if not files:
        return {}
    headers = subprocess.run([build.flags(files[0])[0], "-print-file-name=include"], capture_output=True, text=True).stdout.strip()
    arguments = [c_operators.arguments_of(build.flags(path)) + ["-idirafter", headers] for path in files]
    with concurrent.futures.ProcessPoolExecutor(jobs) as pool:
        return dict(zip(files, pool.map(parse, zip(files, arguments))))


def rows_of(modules):
    """{room or file: its files}."""
    rows = {}
    for module in modules:
        rows[module] = [module] if module.endswith(".c") else sorted(glob.glob(f"{module.rstrip('/')}/*.c"))
        if not rows[module] or not os.path.isfile(rows[module][0]):
            raise campaign.Stop(f"{module} is no file and no folder of C files")
    return rows


def chosen_of(row, mutants, most, seed):
    """At most so many, drawn: the same seed gives the same, and more of them contain the fewer."""
    order = sorted(mutants, key=lambda m: m.number)
    random.Random(f"{seed} {row}").shuffle(order)
    return order[:most] if most else order


def interleaved(lists):
    """The first of every list, then the second, so that a run that ends early has judged of all alike."""
    return [chosen[i] for i in range(max(map(len, lists), default=0)) for chosen in lists if i < len(chosen)]


def shown(edit, path):
    """The changed lines before and after."""
    with open(path, "rb") as f:
        source = f.read()
    begin, end = source.rfind(b"\n", 0, edit.start) + 1, source.find(b"\n", edit.end)
    after = source[begin:edit.start] + edit.new.encode() + source[edit.end:end]
    return [f"- {line.strip()}" for line in source[begin:end].decode().split("\n")] + [
        f"+ {line.strip()}" for line in after.decode().split("\n")]


def options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", help="the build's folder")
    parser.add_argument("modules", nargs="*", help="rooms or files (%s)" % " ".join(ROOMS))
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="N of every room, drawn (0: all)")
    parser.add_argument("--match", default="", metavar="TEXT", help="only mutants with the text in their description, as a function's name")
    parser.add_argument("--seed", default="1", help="of the drawing (1)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="how many at once (one per processor)")
    parser.add_argument("--minutes", type=float, default=0, help="stop after so long, with the table of what was judged (0: never)")
    parser.add_argument("--equivalents", default="tests/mutate/equivalent-c", help=argparse.SUPPRESS)
    parser.add_argument("--reach-only", action="store_true", help="measure what the tests reach, judge nothing")
    parser.add_argument("--list", action="store_true", help="print the mutants, judge nothing")
    parser.add_argument("--listed", action="store_true", help="whether all listed equivalents are mutants, judge nothing")
    return parser.parse_intermixed_args()


def main():
    given = options()
    deadline = time.time() + 60 * given.minutes if given.minutes else None
    if c_operators.cindex is None:
        print("mutate-c: python3-clang-14 is not installed")
        return 77
    build = c_build.Build(given.build, f"{given.build}/mutate-c/commands")
    rows = rows_of(given.modules or ROOMS)
    equivalents = campaign.Equivalents(given.equivalents, glob.glob("src/*/*.c") + sum(rows.values(), []))
    if given.listed:
        rows = {path: [path] for path, _ in equivalents.reasons}
    files = sorted({path for paths in rows.values() for path in paths})
    found = parsed(build, files, given.jobs)
    for path in files:
        equivalents.match(path, [m for m, _ in found[path]])
    if given.listed:
        return 0
    edits = {m.number: edit for pairs in found.values() for m, edit in pairs}
    mutants = {row: [m for path in paths for m, _ in found[path] if given.match in m.what] for row, paths in rows.items()}
    chosen = {row: chosen_of(row, mutants[row], given.sample, given.seed) for row in rows}
    if given.list:
        for m in sorted((m for row in chosen.values() for m in row), key=lambda m: (m.module, edits[m.number].start)):
            print(f"{m.place}: {edits[m.number].operator}: {m.what}")
        return 0
    reach = c_reach.Reach(build, {path for path in [*files, *sum(rows_of(ROOMS).values(), [])] if path in build.compilers}, given.jobs, deadline)
    reach.load()
    if given.reach_only:
        return 0

    return campaign_of(rows, mutants, chosen, equivalents, Judge(build, reach, edits, deadline), given.jobs)


def campaign_of(rows, mutants, chosen, equivalents, judge, jobs):
    """Exit status."""
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        list(pool.map(judge.prepare, {m.module for row in chosen.values() for m in row}))
    every = interleaved(list(chosen.values()))
    results = campaign.Results(f"{judge.build.work}/results", judge.valid(every))
    pending = equivalents.last([m for m in every if m.number not in results.verdicts])
    progress = campaign.Progress("mutate-c", len(every) - len(pending), len(every))
    campaign.judge_all(pending, judge.one, results, progress, jobs)
    progress.end()
    score = campaign.Score(equivalents, lambda m: shown(judge.edits[m.number], m.module))
    refused = 0
    for row in rows:
        known = [m for m in chosen[row] if m.number in results.verdicts]
        judged = [m for m in known if results.verdicts[m.number].verdict != "invalid"]
        refused += len(known) - len(judged)
        score.row(row, judged, len(mutants[row]), results)
    if refused:
        print(f"{refused} changes that the compiler refuses are not counted")
    return score.end(f"{judge.build.work}/mutate.json")


if __name__ == "__main__":
    campaign.stop_at(main)
