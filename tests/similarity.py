#!/usr/bin/env python3
"""Whether the cameras of one data set are those of another after a similarity (Horn 1987, by unit quaternions).

usage: similarity.py TRUTH.json OTHER.json PERCENT     of sf_data --json; the views to learn from of TRUTH, by the names of
their pictures. No camera may lie farther off than PERCENT of the mean distance of the cameras from their scene's origin, and
none may look more than PERCENT degrees past it. Prints the largest and mean of both."""
import json
import math
import os
import sys


def poses(path, splits):
    """{name of the picture: 3 x 4 pose}"""
    with open(path, encoding="utf-8") as text:
        data = json.load(text)
    return {os.path.splitext(os.path.basename(view["name"]))[0]: [view["to_model"][4 * i:4 * i + 4] for i in range(3)]
            for split in splits for view in data[split]}


def position(pose):
    return [row[3] for row in pose]


def mean(vectors):
    return [sum(column) / len(vectors) for column in zip(*vectors)]


def apply(matrix, v):
    return [sum(a * b for a, b in zip(row, v)) for row in matrix]


def largest_eigenvector(n):
    """Of a symmetric 4 x 4 matrix, by squaring: it grows fastest once all are positive."""
    shift = sum(abs(x) for row in n for x in row)
    power = [[n[i][k] + (shift if i == k else 0) for k in range(4)] for i in range(4)]
    for _ in range(60):
        power = [apply(power, column) for column in power]
        top = max(abs(x) for row in power for x in row)
        power = [[x / top for x in row] for row in power]
    column = max(power, key=lambda c: sum(x * x for x in c))
    length = math.sqrt(sum(x * x for x in column))
    return [x / length for x in column]


def rotation(a, b):
    """The rotation that turns the vectors a into the vectors b best."""
    s = [[sum(x[i] * y[k] for x, y in zip(a, b)) for k in range(3)] for i in range(3)]
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = s
    w, x, y, z = largest_eigenvector([[xx + yy + zz, yz - zy, zx - xz, xy - yx], [yz - zy, xx - yy - zz, xy + yx, zx + xz],
                                      [zx - xz, xy + yx, yy - xx - zz, yz + zy], [xy - yx, zx + xz, yz + zy, zz - xx - yy]])
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def main():
    truth, other = poses(sys.argv[1], ["train"]), poses(sys.argv[2], ["train", "test"])
    limit = float(sys.argv[3])
    names = sorted(truth)
    if sorted(other) != names or len(names) < 3:
        sys.exit(f"similarity: {len(other)} cameras, expected the {len(names)} of {sys.argv[1]}")
    a, b = [position(other[n]) for n in names], [position(truth[n]) for n in names]
    middle_a, middle_b = mean(a), mean(b)
    a, away = [[x - m for x, m in zip(v, middle_a)] for v in a], sum(math.hypot(*v) for v in b) / len(b)
    b = [[x - m for x, m in zip(v, middle_b)] for v in b]
    turn = rotation(a, b)
    turned = [apply(turn, v) for v in a]
    scale = sum(x * y for v, w in zip(turned, b) for x, y in zip(v, w)) / sum(x * x for v in a for x in v)
    off = [100 * math.dist([scale * x for x in v], w) / away for v, w in zip(turned, b)]
    past = []
    for n in names:
        ahead = apply(turn, [-row[2] for row in other[n]])
        cosine = -sum(x * row[2] for x, row in zip(ahead, truth[n]))
        past.append(math.degrees(math.acos(min(1, cosine))))
    print(f"{len(names)} cameras: off by {max(off):.3f} % of their distance at most, {sum(off) / len(off):.3f} % in the mean; "
          f"{max(past):.3f} degrees at most, {sum(past) / len(past):.3f} in the mean")
    return max(off) > limit or max(past) > limit


if __name__ == "__main__":
    sys.exit(main())
