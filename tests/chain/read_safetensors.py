#!/usr/bin/env python3
"""Exchanges a safetensors file with the format's own library, in both directions.

usage: read_safetensors.py BUILD     runs BUILD/tests/test_tensors
Exits 0 when equal, 1 when not, 77 (skipped) where the Python modules are not installed.
"""
import os
import subprocess
import sys
import tempfile

try:
    import numpy as np
    from safetensors import safe_open
    from safetensors.numpy import save_file
except ImportError as missing:
    print(f"read_safetensors: skipped: {missing} (make python installs it)")
    sys.exit(77)


def tensors():
    return {
        "f32": (np.arange(15, dtype=np.float32) / 4 - 1).reshape(3, 5),
        "i8": np.array([-128, 0, 127], dtype=np.int8),
        "u8": np.arange(7, dtype=np.uint8),
        "i16": np.array([[-5], [6]], dtype=np.int16),
        "i32": np.array([-(2**31), 2**31 - 1], dtype=np.int32),
        "i64": np.array([-(2**63), 2**63 - 1], dtype=np.int64),
        "u64": np.array(2**64 - 1, dtype=np.uint64),
        "empty": np.zeros((0, 4), dtype=np.float32),
    }


def main():
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    expected, metadata = tensors(), {"version": "1", "text": 'a "quoted"\nline, \u00e9'}
    with tempfile.TemporaryDirectory() as folder:
        save_file(expected, os.path.join(folder, "theirs.safetensors"), metadata=metadata)
        subprocess.run([os.path.join(sys.argv[1], "tests", "test_tensors")], env={**os.environ, "SF_CROSSCHECK": folder}, check=True)
        with safe_open(os.path.join(folder, "ours.safetensors"), "np") as ours:
            assert ours.metadata() == metadata, ours.metadata()
            assert set(ours.keys()) == set(expected), ours.keys()
            for name, value in expected.items():
                got = ours.get_tensor(name)
                assert got.dtype == value.dtype and got.shape == value.shape, (name, got.dtype, got.shape)
                assert np.array_equal(got, value), (name, got)
    print("safetensors: equal in both directions")
    return 0


if __name__ == "__main__":
    sys.exit(main())
