#!/usr/bin/env python3
"""Speed of training, co-simulation and rendering on ranks of this machine, by the clock: for an idle machine.

usage: scale_wall.py BUILD DATA "RANKS..." MINUTES   (make scale RANKS="1 2 4 8 16" MINUTES=4; docs/scale.md explains the lines)

Each rank has one thread. The programs' own seconds count, without start and end. A model of two numbers, work that is
shared out and work that every rank does, is fitted to the smaller counts and says the larger ones. It takes MINUTES at
most; what did not fit is left out and named. BUILD/scale.json has every figure.
"""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time

KINDS = ("train_ingp", "train_tensorf", "cosim", "render")
FULL = 4.0  # minutes for which the sizes below are made, on cores of some 2 GHz


def processor():
    with open("/proc/cpuinfo", encoding="ascii") as file:
        lines = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    return f"{lines[0] if lines else 'unknown processor'}, {os.cpu_count()} processors"


class Bench:
    """Programs, data and the time that is left for all runs."""
    def __init__(self, build, data, work, minutes):
        self.bin, self.data, self.work = build + "/bin/", data, work
        self.end = time.monotonic() + 60 * minutes
        self.share = minutes / FULL

    def call(self, command, ranks=1):
        """Its standard output; TimeoutExpired when the time is over."""
        if ranks > 1:
            command = ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks)] + command
        left = self.end - time.monotonic()
        if left < 1:
            raise subprocess.TimeoutExpired(command, 0)
        return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=left).stdout

    def prepare(self):
        """Make what the runs need: a data set where none was given, views and a small scene."""
        if not os.path.exists(self.data + "/transforms_train.json"):
            self.data = self.work + "/data"
            self.call([self.bin + "sf_scene", "textured", "-o", self.data, "--size", "128", "--train", "12", "--test", "1"])
        views = self.work + "/views"
        self.call([self.bin + "sf_scene", "textured", "-o", views, "--size", "100", "--train", "1", "--test", str(max(16, int(48 * self.share)))])
        model = self.work + "/small"
        self.call([self.bin + "sf_train", self.work + "/views", "--stage1", "60", "--stage2", "60", "--samples", "1024", "--levels", "8",
                   "--log2-hash", "12", "--lattice", "256", "--eval-views", "1", "-q", "-o", model])
        self.call([self.bin + "sf_export", model, "-o", self.work + "/scene.snn"])

    def train(self, backbone, ranks, threads):
        """Seconds an iteration. All counts of ranks do the same iterations, bit for bit."""
        log, iterations = self.work + "/log", 16 * max(2, int(3 * self.share))
        self.call([self.bin + "sf_train", self.data, "--backbone", backbone, "--limit", "12", "--eval-views", "1", "--stage1", str(iterations + 16),
                   "--stage2", "0", "--threads", str(threads), "-q", "--log", log, "-o", self.work + "/model"], ranks)
        with open(log, encoding="ascii") as file:
            lines = [json.loads(line) for line in file if "seconds" in line and "iteration" in line]
        return (lines[-1]["seconds"] - lines[0]["seconds"]) / (lines[-1]["iteration"] - lines[0]["iteration"])

    def cosim(self, ranks, threads):
        """Seconds a sample; processes where there are no ranks."""
        out = json.loads(self.call([self.bin + "sf_cosim", self.work + "/scene.snn", self.work + "/views", "--rays", str(int(1600 * self.share)),
                                    "--block", "4", "-q", "--json"] + (["--jobs", str(threads)] if threads > 1 else []), ranks))
        return out["seconds"] / out["samples"]

    def render(self, ranks, threads):
        """Seconds of the set."""
        folder = self.work + "/set"
        shutil.rmtree(folder, ignore_errors=True)
        out = json.loads(self.call([self.bin + "sim_render", self.work + "/scene.snn", self.work + "/views", "--all", "-o", folder, "--threads",
                                    str(threads), "-q", "--json"], ranks))
        return out["seconds"]

    def one(self, kind, ranks, threads):
        if kind.startswith("train"):
            return self.train(kind.split("_")[1], ranks, threads)
        return getattr(self, kind)(ranks, threads)


def fit(points):
    """shared, each of t = shared / n + each, by least squares of the relative error."""
    a = [(1 / (n * t), 1 / t) for n, t in points]
    xx, xy, yy = sum(x * x for x, _ in a), sum(x * y for x, y in a), sum(y * y for _, y in a)
    x1, y1 = sum(x for x, _ in a), sum(y for _, y in a)
    det = xx * yy - xy * xy
    shared, each = (x1 * yy - y1 * xy) / det, (y1 * xx - x1 * xy) / det
    return (shared, each) if each > 0 else (x1 / xx, 0.0)


def tell(kind, seconds, two, counts):
    """Lines and figures of one program."""
    base, found = seconds[min(seconds)] * min(seconds), {}
    fitted = counts[:max(2, len(counts) - 2)]
    points = [(n, seconds[n]) for n in fitted if n in seconds]
    shared, each = fit(points) if len(points) > 1 else (None, None)
    for n, t in seconds.items():
        said = shared / n + each if shared is not None and n not in fitted else None
        found[n] = {"seconds": t, "speedup": base / t, "efficiency": base / t / n, "model": said}
        print(f"{kind}.ranks_{n:<4} {t:10.6f} s; {base / t:5.2f} times one rank; efficiency {base / t / n:6.1%}"
              + (f"; the model said {said:.6f} s ({said / t - 1:+.1%})" if said else ""), flush=True)
    if shared is not None:
        print(f"{kind}.model      {shared:10.6f} s are shared out, {each:.6f} s are done by every rank; fitted to {' '.join(str(n) for n, _ in points)} ranks")
    if two and 2 in seconds:
        print(f"{kind}.two        2 ranks of one thread have {two / seconds[2]:.3f} of the speed of one process with two", flush=True)
    return {"ranks": found, "shared": shared, "each": each, "one_process_two_threads": two, "fitted": fitted}


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    if os.geteuid() == 0:
        os.environ["OMPI_ALLOW_RUN_AS_ROOT"] = os.environ["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    os.environ["OMP_WAIT_POLICY"] = "passive"
    build, data, counts, minutes = sys.argv[1], sys.argv[2], sorted({int(n) for n in sys.argv[3].split()}), float(sys.argv[4])
    report = {"processor": processor(), "ranks": counts, "minutes": minutes, "left_out": []}
    print(report["processor"], flush=True)
    with tempfile.TemporaryDirectory() as work:
        bench = Bench(build, data, work, minutes)
        bench.prepare()
        for kind in KINDS:
            seconds, two = {}, None
            try:
                for n in counts:
                    seconds[n] = bench.one(kind, n, 1)
                two = bench.one(kind, 1, 2)
            except subprocess.TimeoutExpired:
                report["left_out"].append(kind + " behind " + " ".join(map(str, seconds)))
            if seconds:
                report[kind] = tell(kind, seconds, two, counts)
    for what in report["left_out"]:
        print(f"left out, the time was over: {what} ranks")
    with open(build + "/scale.json", "w", encoding="ascii") as file:
        json.dump(report, file, indent=1)
    print(f"{build}/scale.json")


if __name__ == "__main__":
    main()
