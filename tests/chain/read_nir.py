#!/usr/bin/env python3
"""Reads our NIR graphs with NIR's own library and simulates them: the spikes of the fixed-point core.

usage: read_nir.py BUILD     runs BUILD/tests/test_nir
Exits 0 when equal, 1 when not, 77 (skipped) where the Python modules are not installed.
"""
import os
import subprocess
import sys
import tempfile

try:
    import nir
    import numpy as np
    from nir.serialization import read_version
except ImportError as missing:
    print(f"read_nir: skipped: {missing} (make python installs it)")
    sys.exit(77)

def charge(node, v, current, first):
    """One step of tau dv/dt = (v_leak - v) + r I with dt = 1, rounded as the metadata says."""
    note = node.metadata
    if first and note.get("first_step") == "v = I":
        return current
    lsb, k = note["membrane_lsb"], note["k"]
    if note["rounding"].startswith("v += membrane_lsb * floor((I - v)"):
        return v + lsb * np.floor((current - v) / lsb * k + 0.5)
    most = 2.0 ** (note["membrane_bits"] - 1)
    return lsb * np.clip((v + current) / lsb - np.floor(v / lsb * k + 0.5), -most, most - 1)


def simulate(graph, features, direction):
    """{(layer, step): indices of the neurons that fired}"""
    fired, v = {}, {}
    for t in range(int(graph.metadata["steps"])):
        out = {"features": features, "direction": direction}
        while len(out) < len(graph.nodes):
            for name, node in graph.nodes.items():
                before = [a for a, b in graph.edges if b == name]
                if name in out or not all(a in out for a in before):
                    continue
                x = sum(out[a] for a in before)
                if isinstance(node, nir.Linear):
                    step = node.metadata.get("input_step")
                    x = step * np.floor(x / step + 1 / 16) if step else x
                    out[name] = node.weight.astype(np.float64) @ x
                elif isinstance(node, (nir.LIF, nir.IF)):
                    u = charge(node, v.get(name, np.zeros(len(x))), x, t == 0)
                    spike = u >= node.v_threshold
                    v[name] = u - spike * node.v_threshold
                    out[name] = spike.astype(np.float64)
                    fired[name, t] = list(np.flatnonzero(spike))
                else:
                    out[name] = x
    return fired


def check(folder, mode):
    path = os.path.join(folder, f"{mode}.nir")
    graph = nir.read(path)
    assert read_version(path) == "1.0.8"
    assert set(graph.inputs) == {"features", "direction"} and set(graph.outputs) == {"density", "colour"}
    inputs, samples, fired = {}, 0, None
    with open(os.path.join(folder, f"{mode}.txt")) as lines:
        for line in lines:
            word = line.split()
            if word[0] != "spikes":
                inputs[word[0]] = np.array(word[1:], dtype=np.float64)
                fired = None
                continue
            if fired is None:
                fired = simulate(graph, inputs["features"], inputs["direction"])
                samples += 1
            assert fired[word[1], int(word[2])] == [int(x) for x in word[3:]], (mode, samples, line[:60])
    return samples


def main():
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([os.path.join(sys.argv[1], "tests", "test_nir")], env={**os.environ, "SF_CROSSCHECK": folder}, check=True)
        if not os.listdir(folder):
            print("read_nir: skipped: this build has no HDF5 (libhdf5-dev)")
            return 77
        samples = [check(folder, mode) for mode in range(3)]
    assert min(samples) >= 12, samples
    print(f"nir: spikes of {sum(samples)} samples equal, nir {nir.__version__}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
