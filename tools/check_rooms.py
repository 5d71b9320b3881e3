#!/usr/bin/env python3
"""The order of the house: a file includes and calls only what stands above it in README.md's map, and no files include or
call each other in a circle.

usage: check_rooms.py BUILD     after a build: what calls what is read from BUILD/obj. Exit status 1 names every violation.

A room is a folder of the map's list. Calls through pointers are not seen, and they are the way to call downwards."""
import collections
import os
import re
import subprocess
import sys


def rooms_of_readme():
    """The folders of the map in README.md, top to bottom: {"src/base": 0, ...}."""
    with open("README.md", encoding="utf-8") as readme:
        house = readme.read().split("## Map of the house")[1].split("\n## ")[0]
    return {folder: place for place, folder in enumerate(re.findall(r"^    ([a-z_/]+)/ ", house, re.M))}


def room_of(path, rooms):
    """The innermost folder of the map that holds the file; None: the file is in none."""
    folder = os.path.dirname(path)
    while folder and folder not in rooms:
        folder = os.path.dirname(folder)
    return folder or None


def included(sources):
    """(file, file that it includes), for includes of files of the house."""
    for source in sources:
        with open(source, encoding="utf-8", errors="replace") as text:
            for name in re.findall(r'^\s*#\s*include\s+["<]([^">]+)[">]', text.read(), re.M):
                for folder in (os.path.dirname(source), "src", "include", "."):
                    path = os.path.normpath(os.path.join(folder, name))
                    if os.path.exists(path):
                        yield source, path
                        break


def called(build, sources):
    """(file, file that it calls): [names]. An object kernels_isa.avx2.o is of kernels_isa.c."""
    defined, wanted = {}, collections.defaultdict(set)
    for source in sources:
        stem = os.path.splitext(source)[0]
        folder = os.path.join(build, "obj", os.path.dirname(source))
        if not source.endswith(".c") or not os.path.isdir(folder):
            continue
        name = re.compile(re.escape(os.path.basename(stem)) + r"(\.[a-z0-9]+)?\.o$")
        for entry in filter(name.match, os.listdir(folder)):
            listing = subprocess.run(["nm", os.path.join(folder, entry)], capture_output=True, text=True, check=True)
            for line in listing.stdout.splitlines():
                kind, symbol = line.split()[-2:]
                if kind == "U":
                    wanted[source].add(symbol)
                elif kind in "TDBRVW":
                    defined[symbol] = source
    calls = collections.defaultdict(list)
    for source, symbols in wanted.items():
        for symbol in sorted(symbols):
            if defined.get(symbol, source) != source:
                calls[source, defined[symbol]].append(symbol)
    return calls


def circles(edges):
    """Groups of files that reach each other (Tarjan's strongly connected components of two files or more)."""
    graph = collections.defaultdict(set)
    for start, end in edges:
        graph[start].add(end)
    index, low, stack, found = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for following in sorted(graph[node]):
            if following not in index:
                visit(following)
            if following in stack:
                low[node] = min(low[node], low[following])
        if low[node] == index[node]:
            group = stack[stack.index(node):]
            del stack[stack.index(node):]
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    rooms = rooms_of_readme()
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "src", "sim", "firmware", "tools", "include"],
                            capture_output=True, text=True, check=True)
    sources = [path for path in listed.stdout.split() if path.endswith((".c", ".h", ".cpp")) and os.path.exists(path)]
    calls = called(sys.argv[1], sources)
    if not calls:
        sys.exit(f"check_rooms: {sys.argv[1]}: no objects; build first")
    faults = [f"{path}: in no room of README.md's map" for path in sources if room_of(path, rooms) is None]

    def below(source, other):
        a, b = room_of(source, rooms), room_of(other, rooms)
        return a is not None and b is not None and rooms[a] < rooms[b]

    includes = sorted(set(included(sources)))
    for source, other in includes:
        if below(source, other):
            faults.append(f"{source}: includes {other}, which stands below it in README.md's map")
    for (source, other), names in sorted(calls.items()):
        if below(source, other):
            faults.append(f"{source}: calls {', '.join(names)} of {other}, which stands below it in README.md's map")
    faults += [f"a circle of includes: {', '.join(group)}" for group in circles(includes)]
    for group in circles(calls):
        faults.append(f"a circle of calls: {', '.join(group)}")
        faults += [f"  {a} -> {b}: {', '.join(names)}" for (a, b), names in sorted(calls.items()) if a in group and b in group]
    for fault in faults:
        print(fault, file=sys.stderr)
    sys.exit(1 if faults else 0)


main()
