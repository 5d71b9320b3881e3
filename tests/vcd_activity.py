#!/usr/bin/env python3
"""Counts a VCD file and compares with a SAIF file of the same cycles: every bit of every net, both ways.

usage: vcd_activity.py FILE.vcd FILE.saif
"""
import re
import sys


def read_vcd(path):
    """{(instance path, net, index or None): [T0, T1, TX, TC]}, last time"""
    scope, where, widths = [], {}, {}
    state, since, count = {}, {}, {}
    now = 0

    def change(code, value):
        value = value.rjust(widths[code], "0" if value[0] == "1" else value[0])
        for i, bit in enumerate(value):
            key = (code, i)
            if key in state:
                old = state[key]
                if old == bit:
                    continue
                count[key]["01".find(old) if old in "01" else 2] += now - since[key]
                count[key][3] += old in "01" and bit in "01"
            else:
                count[key] = [0, 0, 0, 0]
            state[key], since[key] = bit, now

    with open(path) as lines:
        for line in lines:
            word = line.split()
            if not word:
                continue
            if word[0] == "$scope":
                scope.append(word[2])
            elif word[0] == "$upscope":
                scope.pop()
            elif word[0] == "$var":
                code, name = word[3], word[4]
                widths[code] = int(word[2])
                left = right = None
                if word[5] != "$end":
                    left, right = (int(x) for x in word[5].strip("[]").split(":"))
                where.setdefault(code, []).append(("/".join(scope), name, left, right))
            elif word[0][0] == "#":
                now = int(word[0][1:])
            elif word[0][0] == "b":
                change(word[1], word[0][1:])
            elif word[0][0] in "01xz":
                change(word[0][1:], word[0][0])
    nets = {}
    for (code, i), n in count.items():
        n["01".find(state[code, i]) if state[code, i] in "01" else 2] += now - since[code, i]
        for path_, name, left, right in where[code]:
            index = None if left is None else left - i if left >= right else left + i
            nets[path_, name, index] = n
    return nets, now


def read_saif(path):
    nets, scope, duration = {}, [], None
    bit = re.compile(r"\((\S+) \(T0 (\d+)\) \(T1 (\d+)\) \(TX (\d+)\) \(TC (\d+)\) \(IG 0\)\)$")
    depth, opened = 0, []
    with open(path) as lines:
        for line in lines:
            line = line.strip()
            found = bit.match(line)
            if found:
                name = found[1].replace("\\", "")
                index = None
                if name.endswith("]"):
                    name, index = name[:-1].rsplit("[", 1)
                    index = int(index)
                nets[path_of(scope), name, index] = [int(x) for x in found.groups()[1:]]
                continue
            if line.startswith("(DURATION"):
                duration = int(line.split()[1][:-1])
            if line.startswith("(INSTANCE"):
                scope.append(line.split()[1].replace("\\", ""))
                opened.append(depth)
            depth += line.count("(") - line.count(")")
            if opened and depth == opened[-1]:
                opened.pop()
                scope.pop()
    if depth != 0:
        sys.exit(f"{path}: {depth} brackets are open at the end")
    return nets, duration


def path_of(scope):
    return "/".join(scope)


def main():
    vcd, end = read_vcd(sys.argv[1])
    saif, duration = read_saif(sys.argv[2])
    if end != duration:
        sys.exit(f"{sys.argv[1]} ends at {end}, {sys.argv[2]} has a duration of {duration}")
    if vcd.keys() != saif.keys():
        sys.exit(f"nets of one file alone: {sorted(map(str, vcd.keys() ^ saif.keys()))[:4]}")
    for key, n in vcd.items():
        if sum(n[:3]) != end or n != saif[key]:
            sys.exit(f"{key}: T0 T1 TX TC are {n} in the VCD, {saif[key]} in the SAIF file")
    print(f"{len(vcd)} bits of nets, {sum(n[3] for n in vcd.values())} toggles in {end} ps: equal")


main()
