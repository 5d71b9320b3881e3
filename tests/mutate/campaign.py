"""A campaign: mutants are run against their checkers, verdicts are kept, the score is printed.

A verdict is a line of a module's results, in JSON. Its key is of what was run: the checker that killed, or all of them for
a survivor. So an interrupted campaign goes on where it was, and a changed checker or module starts only what it decides.
"""
import collections
import concurrent.futures
import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import time

Mutant = collections.namedtuple("Mutant", "number module place what")
# command: its program; key: of what it was made of; limit: seconds of processor after which it hangs
Checker = collections.namedtuple("Checker", "name command key limit")
Verdict = collections.namedtuple("Verdict", "verdict key seconds checker")
# Ended from outside, by a person or for want of memory: that is no verdict.
ASLEEP = 12  # times its limit of the processor: so long a checker may take by the clock
NOT_ITS_OWN = (-signal.SIGINT, -signal.SIGTERM, -signal.SIGKILL)
FIRST_LIMIT = 600  # before a checker's own time is known


class Stop(Exception):
    """What ends a campaign: one line, said by stop_at()."""


class Late(Exception):
    """The campaign's time is over: the mutant gets no verdict."""


def digest(*parts):
    h = hashlib.sha256()
    for part in parts:
        h.update(part if isinstance(part, bytes) else part.encode())
        h.update(b"\0")
    return h.hexdigest()[:16]


def unique(mutants):
    """The same with "#2", "#3" behind descriptions that a module has several times, in their order."""
    seen, out = collections.Counter(), []
    for m in mutants:
        seen[m.module, m.what] += 1
        count = seen[m.module, m.what]
        out.append(m if count == 1 else m._replace(what=f"{m.what} #{count}"))
    return out


def sample(mutants, most, results):
    """At most so many, spread evenly, the same ones every time; for 0 those that have a verdict."""
    if most == 0:
        return [m for m in mutants if m.number in results.verdicts]
    take = min(most, len(mutants))
    return [mutants[i * len(mutants) // take] for i in range(take)]


class Equivalents:
    """The file of mutants that no input tells from the original: `module what | reason`, one a line."""

    def __init__(self, path, modules):
        self.path, self.reasons = path, {}
        with open(path) as f:
            for number, line in enumerate(f, 1):
                if line.startswith("#") or not line.strip():
                    continue
                head, bar, reason = line.rstrip("\n").rpartition(" | ")
                module, _, what = head.partition(" ")
                if not bar or not what or not reason:
                    raise Stop(f"{path}:{number}: expected `module what | reason`")
                if module not in modules:
                    raise Stop(f"{path}:{number}: {module} is no mutated module")
                if (module, what) in self.reasons:
                    raise Stop(f"{path}:{number}: listed twice: {module} {what}")
                self.reasons[module, what] = number, reason

    def match(self, module, mutants):
        """Stop unless every entry of the module names one of all its mutants."""
        there = {m.what for m in mutants}
        for (owner, what), (number, _) in self.reasons.items():
            if owner == module and what not in there:
                raise Stop(f"{self.path}:{number}: no such mutant: {module} {what}")

    def last(self, mutants):
        """The same with those that are listed behind the others: they cost most and say least."""
        return sorted(mutants, key=lambda m: self.reason(m) is not None)

    def reason(self, m):
        return self.reasons.get((m.module, m.what), (0, None))[1]


def run(checker, number, environment={}, deadline=None):
    """Whether the checker kills the mutant; None if it was ended from outside. Late at the deadline."""
    environment = {**os.environ, "SF_MUTANT": str(number), "CK_FORK": "no", **environment}
    command = ["sh", "-c", 'ulimit -S -t "$1" && exec "$0"', checker.command, str(checker.limit)]
    left = deadline - time.time() if deadline else float("inf")
    if left <= 0:
        raise Late()
    try:
        # Of the processor, that a loaded machine kills nobody; of the clock, should one sleep.
        status = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                stderr=subprocess.DEVNULL, timeout=min(ASLEEP * checker.limit, left)).returncode
    except subprocess.TimeoutExpired:
        if left < ASLEEP * checker.limit:
            raise Late() from None
        status = 1
    return None if status in NOT_ITS_OWN else status != 0


def measured(name, command, key):
    """A checker with its limit: some times what it takes without a mutant, which it has to pass."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    if run(Checker(name, command, key, FIRST_LIMIT), 0) is not False:
        raise Stop(f"{name} fails without a mutant")
    return Checker(name, command, key, 5 + int(4 * (resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)))


def survivor_key(checkers):
    return digest(*[c.key for c in checkers])


def of_checkers(checkers):
    """What Results is given where every mutant of a module has the same checkers."""
    keys = {c.key for c in checkers} | {survivor_key(checkers)}
    return lambda number, verdict: verdict.key in keys


class Results:
    """The kept verdicts of a module."""

    def __init__(self, path, valid):
        """valid: whether the verdict of a number is of what is there now; others are left out."""
        self.path, self.verdicts = path, {}
        lines = open(path).read().split("\n")[:-1] if os.path.exists(path) else []
        for line in lines:
            try:
                number, *fields = json.loads(line).values()
                verdict = Verdict(*fields)
            except (ValueError, TypeError, AttributeError):
                continue  # cut short, or of another layout
            if valid(number, verdict):
                self.verdicts[number] = verdict
        with open(path + ".new", "w") as f:
            f.writelines(self.line(n, v) for n, v in self.verdicts.items())
        os.replace(path + ".new", path)

    @staticmethod
    def line(number, v):
        return json.dumps({"mutant": number, **v._replace(seconds=round(v.seconds, 2))._asdict()}) + "\n"

    def add(self, number, verdict):
        self.verdicts[number] = verdict
        with open(self.path, "a") as f:
            f.write(self.line(number, verdict))


class Progress:
    """`sf_plif 120/400, 3 left over, 2:10 to go`: in place on a terminal, now and then elsewhere."""

    def __init__(self, module, done, total):
        self.module, self.done, self.total, self.left = module, done, total, 0
        self.begin, self.first, self.shown = time.time(), done, time.time()
        self.terminal = sys.stderr.isatty()

    def step(self, verdict):
        self.done += 1
        self.left += verdict == "survived"
        now = time.time()
        if now - self.shown < (0.2 if self.terminal else 60):
            return
        self.shown = now
        to_go = (now - self.begin) / (self.done - self.first) * (self.total - self.done)
        text = f"{self.module} {self.done}/{self.total}, {self.left} survived, {to_go // 60:.0f}:{to_go % 60:02.0f} to go"
        print(f"\r\033[K{text}" if self.terminal else text, end="" if self.terminal else "\n", file=sys.stderr, flush=True)

    def end(self):
        if self.terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def against(checkers, prove=None):
    """What judge_all() is given where every mutant has the same checkers; prove: whether a survivor is equivalent."""
    def one(mutant):
        start = time.time()
        for checker in checkers:
            killed = run(checker, mutant.number)
            if killed is None:
                return None
            if killed:
                return Verdict("killed", checker.key, time.time() - start, checker.name)
        verdict = "equivalent" if prove and prove(mutant) else "survived"
        return Verdict(verdict, survivor_key(checkers), time.time() - start, "-")
    return one


def judge_all(mutants, one, results, progress, jobs):
    """Adds to the results what one(mutant) says: its verdict, or None if something outside ended it."""
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        waiting = {pool.submit(one, m): m for m in mutants}
        try:
            for future in concurrent.futures.as_completed(waiting):
                try:
                    verdict = future.result()
                except Late:
                    continue
                if not verdict:
                    raise Stop(f"{waiting[future].module}: a checker was ended from outside; run it again to go on")
                results.add(waiting[future].number, verdict)
                progress.step(verdict.verdict)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


class Score:
    """Rows as modules are done, and the sum."""

    HEAD = ("module", "mutants", "of", "killed", "proven", "listed", "survived", "score", "seconds")

    def __init__(self, equivalents, shown=lambda mutant: ()):
        """shown: more lines about a survivor."""
        self.equivalents, self.modules, self.failures, self.shown = equivalents, [], 0, shown
        print("%-14s" % self.HEAD[0] + "".join("%9s" % name for name in self.HEAD[1:]), flush=True)

    def row(self, module, mutants, count, results):
        """mutants: those that have a verdict now, of so many that the module has."""
        verdicts = [(m, results.verdicts[m.number]) for m in mutants]
        killed = [m for m, v in verdicts if v.verdict == "killed"]
        proven = sum(v.verdict == "equivalent" for _, v in verdicts)
        survived = [m for m, v in verdicts if v.verdict == "survived"]
        left = [m for m in survived if not self.equivalents.reason(m)]
        listed = [m for m in survived if m not in left]
        seconds = sum(v.seconds for _, v in verdicts)
        print("%-14s%9d%9d%9d%9d%9d%9d%9s%9.0f" % (module, len(verdicts), count, len(killed), proven, len(listed), len(left),
                                                   percent(len(killed), len(killed) + len(left)), seconds), flush=True)
        for m in listed:
            print(f"  equivalent: {m.place}: {m.what} | {self.equivalents.reason(m)}", flush=True)
        for m in left:
            print("\n    ".join([f"  survived: {m.place}: {m.module} {m.what}", *self.shown(m)]), flush=True)
        for m in killed:
            if self.equivalents.reason(m):
                self.failures += 1
                print(f"{self.equivalents.path}: killed, so not equivalent: {m.module} {m.what}", file=sys.stderr)
        self.modules.append({"module": module, "mutants": len(verdicts), "of": count, "killed": len(killed),
                             "proven": proven, "listed": len(listed), "survived": len(left), "seconds": round(seconds),
                             "survivors": [[m.place, m.what, *self.shown(m)] for m in left]})

    def end(self, path):
        """Exit status. The rows in JSON, and beside it the table in Markdown."""
        killed, left = (sum(m[name] for m in self.modules) for name in ("killed", "survived"))
        with open(path, "w") as f:
            json.dump({"killed": killed, "not_equivalent": killed + left, "modules": self.modules}, f)
        with open(os.path.splitext(path)[0] + ".md", "w") as f:
            f.write("| " + " | ".join(self.HEAD[:-1]) + " |\n|---" + "|---:" * (len(self.HEAD) - 2) + "|\n")
            for m in self.modules:
                cells = [m[name] for name in self.HEAD[:-2]] + [percent(m["killed"], m["killed"] + m["survived"])]
                f.write("| " + " | ".join(str(cell) for cell in cells) + " |\n")
        print(f"score {killed} / {killed + left} = {percent(killed, killed + left)}, JSON in {path}, Markdown beside it")
        return 1 if left or self.failures else 0


def percent(part, whole):
    """Rounded down: 100 % is all of them."""
    return f"{part * 1000 // whole / 10:.1f} %" if whole else "-"


def stop_at(main):
    """main() as a program, in the repository's root: exit status, 1 and a line at a Stop, 130 when interrupted."""
    os.chdir(os.path.dirname(os.path.abspath(__file__)) + "/../..")
    try:
        sys.exit(main())
    except Stop as stop:
        sys.exit(f"mutate: {stop}")
    except KeyboardInterrupt:
        print("\nmutate: interrupted; the verdicts so far are kept", file=sys.stderr)
        sys.exit(130)
