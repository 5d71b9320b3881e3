#!/usr/bin/env python3
"""Writes the Python package and its library as a wheel. Needs nothing but Python.

usage: wheel.py PACKAGE LIBRARY VERSION FOLDER

  wheel.py share/python/spikefield build/lib/libspikefield.so.1.1.0 1.1.0 build/wheel

Prints the wheel's name. The same inputs give the same bytes."""
import base64
import hashlib
import os
import sys
import sysconfig
import zipfile

METADATA = """Metadata-Version: 2.1
Name: spikefield
Version: {version}
Summary: libspikefield for Python: the fixed-point core of a spiking accelerator, bit for bit
License: Apache-2.0
Requires-Python: >=3.9
Requires-Dist: numpy>=1.24
"""
WHEEL = """Wheel-Version: 1.0
Generator: spikefield
Root-Is-Purelib: false
Tag: {tag}
"""


def contents(package, library, version, tag):
    """(name in the wheel, bytes)."""
    name = os.path.basename(os.path.normpath(package))
    for file in sorted(os.listdir(package)):
        if file.endswith(".py"):
            with open(os.path.join(package, file), "rb") as data:
                yield f"{name}/{file}", data.read()
    with open(library, "rb") as data:
        yield f"{name}/{os.path.basename(library)}", data.read()
    info = f"{name}-{version}.dist-info"
    yield f"{info}/METADATA", METADATA.format(version=version).encode()
    yield f"{info}/WHEEL", WHEEL.format(tag=tag).encode()


def main(package, library, version, folder):
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"py3-none-{platform}"
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, f"spikefield-{version}-{tag}.whl")
    record = f"spikefield-{version}.dist-info/RECORD"
    lines = []
    with zipfile.ZipFile(path + ".part", "w") as wheel:
        def put(name, data):
            entry = zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0))
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            wheel.writestr(entry, data)

        for name, data in contents(package, library, version, tag):
            put(name, data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            lines.append(f"{name},sha256={digest},{len(data)}\n")
        put(record, "".join(lines) + f"{record},,\n")
    os.replace(path + ".part", path)
    print(path)


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[1] in ("-h", "--help"):
        sys.exit(__doc__)
    main(*sys.argv[1:])
