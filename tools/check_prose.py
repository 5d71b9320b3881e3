#!/usr/bin/env python3
"""No sentence of the documents is longer than 38 words.

usage: check_prose.py FILE.md ...     Exit status 1 names every longer one.

Tables, headings and code are left out. A sentence ends at . : ; ? ! or with its paragraph or list item."""
import re
import sys

LONGEST = 38


def paragraphs(text):
    """(line number, text) of each paragraph or list item."""
    found, fenced = [], False
    for number, line in enumerate(text.split("\n"), 1):
        bare = line.lstrip()
        fenced ^= bare.startswith("```")
        code = fenced or bare.startswith("```") or (line.startswith("    ") and not (found and found[-1][1]))
        if code or not bare or bare.startswith(("|", "#")):
            found.append((number, ""))
        elif re.match(r"(?:[-*]|\d+\.) ", bare) or not found:
            found.append((number, bare))
        else:
            start, before = found.pop()
            found.append((start if before else number, f"{before} {bare}".strip()))
    return [(number, words) for number, words in found if words]


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    failed = False
    for name in sys.argv[1:]:
        with open(name, encoding="utf-8") as page:
            for number, text in paragraphs(page.read()):
                for sentence in re.split(r"(?<=[.:;?!])\s+", text):
                    if len(sentence.split()) > LONGEST:
                        failed = True
                        print(f"{name}:{number}: a sentence of {len(sentence.split())} words, expected at most {LONGEST}: "
                              f"{sentence[:60]} ...", file=sys.stderr)
    sys.exit(failed)


main()
