#!/usr/bin/env python3
"""What the documents point to is there.

usage: check_links.py FILE.md ...     Exit status 1 names every link, picture and file name that leads nowhere.

Links and pictures are looked up beside the page, headings (#...) by the names that GitHub gives them. A word between backquotes
that begins with a folder of the source tree is a file of it, unless it holds a wildcard or a word in capitals for any name.
share/spikefield belongs to what is installed."""
import os
import re
import sys

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), ".."))
FOLDERS = r"(?:docs|firmware|include|rtl|share|sim|src|tests|tools)"


def prose(path):
    """The lines of a page with those of code blocks left empty."""
    fenced = False
    with open(path, encoding="utf-8") as page:
        for line in page:
            fence = line.lstrip().startswith("```")
            fenced ^= fence
            yield "" if fenced or fence or line.startswith("    ") else line


def anchors(path):
    """The names of a page's headings."""
    titles = [line.lstrip("#").strip().lower() for line in prose(path) if line.startswith("#")]
    return {re.sub(r"[^\w\- ]", "", title).replace(" ", "-") for title in titles}


def wrong_link(page, target):
    """What is wrong with a link, or nothing."""
    if re.match(r"[a-z]+:", target):
        return None
    name, _, heading = target.partition("#")
    path = os.path.join(os.path.dirname(page), name) if name else page
    if not os.path.exists(path):
        return "no such file"
    if heading and heading not in anchors(path):
        return f"no heading #{heading}"
    return None


def wrong_name(word):
    """What is wrong with a file name of the source tree, or nothing."""
    if re.search(r"[*?$()\[\]{}<>]|\b[A-Z]{2,}\b|(?<![a-z])[A-Z_]{2,}(?![a-z])|/NAME|^share/spikefield", word):
        return None
    return None if os.path.exists(os.path.join(ROOT, word)) else "no such file in the source tree"


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    failed = False
    for page in sys.argv[1:]:
        for number, line in enumerate(prose(page), 1):
            found = [(t, wrong_link(page, t)) for t in re.findall(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"", line) for t in t if t]
            found += [(w, wrong_name(w)) for w in re.findall(rf"`({FOLDERS}/[^`\s:]+)`", line)]
            for what, wrong in found:
                if wrong:
                    failed = True
                    print(f"{page}:{number}: {what}: {wrong}", file=sys.stderr)
    sys.exit(failed)


main()
