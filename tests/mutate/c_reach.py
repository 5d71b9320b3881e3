"""Which test program reaches which line, and what it costs: measured once, kept in WORK/reach.json.

The mutated files are compiled once more for gcov, without optimisation, into an archive that every test program is linked
with in front of the library. A program's entry is made again when the program, or one of the files, has changed."""
import concurrent.futures
import json
import os
import shutil
import subprocess
import time

import campaign


def environment(folder, fork):
    """Of every run, with and without a mutant."""
    return {"OMP_NUM_THREADS": "2", "OMP_WAIT_POLICY": "passive", "TMPDIR": folder, "CK_FORK": "yes" if fork else "no"}


def timed(command, folder, fork, **more):
    """(exit status, seconds of processor) of a program that writes into the folder."""
    os.makedirs(folder, exist_ok=True)
    process = subprocess.Popen([command], env=dict(os.environ, **environment(os.path.abspath(folder), fork), **more),
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = status
    return status, usage.ru_utime + usage.ru_stime


class Reach:
    def __init__(self, build, files, jobs, deadline=None):
        self.build, self.files, self.jobs, self.deadline = build, sorted(files), jobs, deadline
        self.path, self.cover = f"{build.work}/reach.json", f"{build.work}/cover"
        self.tests = {}

    def load(self):
        """The entries, measured where they are missing or of another state."""
        kept = {}
        if os.path.exists(self.path):
            with open(self.path) as f:
                kept = json.load(f)
        sources = [open(path, "rb").read() for path in self.files]
        names = sorted(self.build.linkers)
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            keys = dict(zip(names, pool.map(self.build.key_of_test, names)))
            full = {name: campaign.digest(keys[name], *self.files, *sources) for name in names}
            self.tests = {n: kept[n] for n in names if n in kept and kept[n]["full"] == full[n]}
            missing = [n for n in names if n not in self.tests]
            if missing:
                print(f"reach: {len(missing)} test programs", flush=True)
                self.archive(pool)
                waiting = {pool.submit(self.measured, name): name for name in missing}
                for future in concurrent.futures.as_completed(waiting):
                    if future.result():
                        name = waiting[future]
                        self.tests[name] = {"full": full[name], "key": keys[name], **future.result()}
                        self.keep()
                shutil.rmtree(self.cover)
        if len(self.tests) < len(names):
            raise campaign.Stop(f"the time is over with {len(self.tests)} of {len(names)} test programs measured; run it again to go on")
        self.index()

    def keep(self):
        """Each at once: an interrupted measurement goes on where it was."""
        with open(self.path + ".new", "w") as f:
            json.dump(self.tests, f)
        os.replace(self.path + ".new", self.path)

    def archive(self, pool):
        shutil.rmtree(self.cover, ignore_errors=True)
        objects = [f"{self.cover}/{path[:-2]}.o" for path in self.files]
        for _ in pool.map(lambda pair: self.build.compile_whole(pair[0], ["-O0", "--coverage", "-fprofile-update=single"], pair[1]), zip(self.files, objects)):
            pass
        subprocess.run(["ar", "rcs", f"{self.cover}/cover.a"] + objects, check=True)

    def measured(self, name):
        """What a program costs, whether it needs forks, and what it reaches; None when the time is over."""
        if self.deadline and time.time() > self.deadline:
            return None
        folder = f"{self.cover}/run/{name}"
        program = f"{folder}/{name}"
        os.makedirs(folder)
        self.build.link_mutant(name, None, program)
        fork = False
        status, seconds = timed(program, f"{folder}/tmp", fork)
        if status:
            fork = True
            status, seconds = timed(program, f"{folder}/tmp", fork)
        if status:
            raise campaign.Stop(f"{name} fails without a mutant")
        self.build.link(name, [f"{self.cover}/cover.a"], program, ["--coverage"])
        timed(program, f"{folder}/tmp", fork, GCOV_PREFIX=os.path.abspath(folder))
        lines = self.counted(folder)
        shutil.rmtree(folder)
        return {"fork": fork, "seconds": round(seconds, 2), "files": lines}

    def counted(self, folder):
        """{file: {"lines": run, "all": that could have been run, "functions": [[first, last]] entered}}."""
        data = []
        for path in self.files:
            stem = f"{folder}{os.path.abspath(self.cover)}/{path[:-2]}"
            if os.path.exists(stem + ".gcda"):
                os.symlink(os.path.abspath(f"{self.cover}/{path[:-2]}.gcno"), stem + ".gcno")
                data.append(stem + ".gcda")
        found = {}
        if not data:
            return found
        text = subprocess.run(["gcov", "--json-format", "--stdout"] + data, capture_output=True, check=True).stdout
        for document in text.splitlines():
            for file in json.loads(document)["files"]:
                if file["file"] not in self.files:
                    continue
                run = sorted({line["line_number"] for line in file["lines"] if line["count"]})
                if run:
                    found[file["file"]] = {
                        "lines": run, "all": sorted({line["line_number"] for line in file["lines"]}),
                        "functions": [[f["start_line"], f["end_line"]] for f in file["functions"] if f["execution_count"]]}
        return found

    def index(self):
        """Sets, and the programs from the fastest to the slowest."""
        self.order = sorted(self.tests, key=lambda name: (self.tests[name]["seconds"], name))
        self.all = {}
        for entry in self.tests.values():
            for path, found in entry["files"].items():
                found["set"] = set(found["lines"])
                self.all.setdefault(path, set(found["all"]))
        if not self.all:
            raise campaign.Stop("no test program reaches any of the files")

    def of(self, path, first, last):
        """The programs that run one of the lines; of a place without code of its own, those that enter its function."""
        lines = set(range(first, last + 1))
        coded, reaching = lines & self.all.get(path, set()), []
        for name in self.order:
            found = self.tests[name]["files"].get(path)
            if not found:
                continue
            entered = [f for f in found["functions"] if f[0] <= first <= f[1]]
            if lines & found["set"] if coded else entered or not self.in_function(path, first):
                reaching.append(name)
        return reaching

    def in_function(self, path, line):
        return any(f[0] <= line <= f[1] for t in self.tests.values() if path in t["files"] for f in t["files"][path]["functions"])

    def checker(self, name, command):
        entry = self.tests[name]
        return campaign.Checker(name, command, entry["key"], 5 + int(4 * entry["seconds"]))
