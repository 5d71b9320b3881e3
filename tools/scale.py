#!/usr/bin/env python3
"""What training, co-simulation and the launcher cost on ranks of this machine, a model fitted to it, and what it says of clusters.

usage: scale.py BUILD DATA   (make scale DATA=folder; docs/scale.md explains the lines)

Processor time counts, not time: so other work on the machine hardly matters. Training: the first iterations of a hash
grid, ranks of one thread. The model's two numbers are fitted to 1, 2 and 8 ranks and checked on 4.
"""
import json
import os
import resource
import subprocess
import sys
import tempfile

FEW, MANY = 2, 14        # iterations; their difference leaves out start and evaluation; before the first occupancy update
FITTED, CHECKED = (1, 2, 8), 4
PARTS = 16               # of an iteration, dealt to ranks and threads: GROUPS in src/train/internal.h
CORES = 16               # of a node of the clusters below
ITERATIONS = 40000       # of the paper's runs
COSIM_SAMPLES = 100e6
COSIM_RAYS = 32
BLOCK_BYTES = 54e3       # that come back of a block of sf_cosim
LAUNCHED = (2, 4)
NODES, GBITS = (8, 64, 512), (25, 100)


def measure(command, ranks=0):
    """Standard output and processor seconds of a command, of all its processes."""
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "-n", str(ranks)] + command
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return out, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def iteration(binary, data, work, ranks):
    """Processor seconds and bytes sent by rank 0, of an iteration."""
    seconds, sent = [], []
    for n in (FEW, MANY):
        out, cpu = measure([binary + "/sf_train", data, "--downscale", "4", "--limit", "8", "--eval-views", "1", "--seed", "1",
                            "--stage1", str(n), "--stage2", "0", "--threads", "1", "-q", "--json", "-o", work + "/model"], ranks)
        seconds.append(cpu)
        sent.append(json.loads(out).get("sent_bytes", 0))
    return (seconds[1] - seconds[0]) / (MANY - FEW), (sent[1] - sent[0]) / (MANY - FEW)


def fit(points):
    """Least squares of w + r n."""
    n = len(points)
    mean_x, mean_y = sum(x for x, _ in points) / n, sum(y for _, y in points) / n
    r = sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)
    return mean_y - r * mean_x, r


def train(binary, data, work):
    """Print what an iteration costs on ranks, the model of it, and what that says of clusters."""
    found = {n: iteration(binary, data, work, n) for n in sorted(FITTED + (CHECKED,))}
    shared, each = fit([(n, found[n][0]) for n in FITTED])
    for n, (cpu, sent) in found.items():
        print(f"train.ranks_{n:<12} {cpu:8.4f} s of processor an iteration, all ranks; efficiency {found[1][0] / cpu:5.1%}; "
              f"{sent / 1e6:6.3f} MB sent by a rank")
    print(f"train.model           {shared:8.4f} s are shared out, {each:.4f} s are done by every rank")
    said = shared + each * CHECKED
    print(f"train.check           {CHECKED} ranks: {said:.4f} s said, {found[CHECKED][0]:.4f} s measured ({said / found[CHECKED][0] - 1:+.1%})")
    full = found[max(FITTED)][1] * 8 / 7  # a ring's share of everything
    for gbit in GBITS:
        for nodes in NODES:
            parts = min(PARTS, nodes * CORES)
            across = full * (nodes - 1) / nodes / (gbit * 1e9 / 8)
            seconds = shared / parts + each + across
            print(f"train.nodes_{nodes:<4} {gbit:>4} Gbit/s {ITERATIONS * seconds / 3600:8.2f} h for {ITERATIONS} iterations; {across / seconds:5.1%} of it "
                  f"on the wire; {parts} ranks of one thread have work")


def cosim(binary, data, work):
    """Print the rate of co-simulation, and what that says of clusters. After train(), whose model it exports."""
    measure([binary + "/sf_export", work + "/model", "-o", work + "/scene.snn"])
    out, cpu = measure([binary + "/sf_cosim", work + "/scene.snn", data, "--rays", str(COSIM_RAYS), "-q", "--json"])
    samples = json.loads(out)["samples"]
    rate = samples / cpu
    blocks = COSIM_SAMPLES / (samples / COSIM_RAYS * 256)
    print(f"cosim.rate            {rate:8.1f} samples a second of processor")
    for gbit in GBITS:
        for nodes in NODES:
            work_s, wire = COSIM_SAMPLES / rate / (nodes * CORES), blocks * BLOCK_BYTES / (gbit * 1e9 / 8)
            print(f"cosim.nodes_{nodes:<4} {gbit:>4} Gbit/s {(work_s + wire) / 3600:8.3f} h for {COSIM_SAMPLES:.0f} samples; "
                  f"{wire / (work_s + wire):5.1%} of it on rank 0's wire")


def launch(binary, data, work):
    """After cosim(): what a job costs that has nothing to do."""
    command = [binary + "/sf_cosim", work + "/scene.snn", data, "--rays", "1", "--block", "1", "-q", "--json"]
    _, alone = measure(command)
    for ranks in LAUNCHED:
        _, cpu = measure(command, ranks)
        print(f"launch.ranks_{ranks:<11} {cpu - alone:8.2f} s of processor more than one process, whatever is computed")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    if os.geteuid() == 0:
        os.environ["OMPI_ALLOW_RUN_AS_ROOT"] = os.environ["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    os.environ["OMP_NUM_THREADS"], os.environ["OMP_WAIT_POLICY"] = "1", "passive"
    binary = sys.argv[1] + "/bin"
    with tempfile.TemporaryDirectory() as work:
        train(binary, sys.argv[2], work)
        cosim(binary, sys.argv[2], work)
        launch(binary, sys.argv[2], work)


if __name__ == "__main__":
    main()
