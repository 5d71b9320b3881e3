#!/usr/bin/env python3
"""Runs the commands of the tutorials as a reader types them, in a folder of their own, and holds the pages to what they show.

usage: tutorials.py BUILD [PAGE.md ...]     Default: every docs/tutorial-*.md and docs/first-hour.md.
       tutorials.py --print BUILD [PAGE.md ...]     Puts today's numbers into the outputs of the pages (make outputs).
           Default: the tutorials, and the pages that show outputs of the demo's scene in BUILD/demo.

A ```sh block runs in the shell of the blocks before it and has to succeed. The ```text block behind it shows lines of its
output, in order: any number stands for any other, and a line that ends with ... shows only its beginning. Comments say more
about the next ```sh block; a comment that does not apply to it is an error:
  <!-- skip: why -->          is not run here
  <!-- needs: PROGRAM -->     is not run where PROGRAM is missing
  <!-- short: s|OLD|NEW| -->  a shorter command in place of the reader's
  <!-- exit: N -->            ends with this status
  <!-- range: TEXT in A..B -->  TEXT with one # is in the output, and each number there lies between A and B
  <!-- makes: FILE -->        writes this file; a .png is a PNG"""
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), ".."))
PAGES = ["docs/tutorial-rtl.md", "docs/tutorial-training.md", "docs/tutorial-energy.md", "docs/first-hour.md"]
DEMO_PAGES = ["docs/kit.md", "docs/firmware.md", "docs/activity.md"]
NUMBER = r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?"
KINDS = ("skip", "needs", "short", "exit", "range", "makes")
LIMIT = 900  # seconds a page: ends what hangs, even on a busy machine


class Block:
    def __init__(self, page, line, notes):
        self.where, self.notes, self.commands, self.shown = f"{page}:{line}", notes, [], []

    def note(self, kind):
        return [text for name, text in self.notes if name == kind]


def blocks(page):
    """The ```sh blocks of a page, each with the comments before it and the ```text block behind it."""
    found, notes, fence = [], [], None
    with open(os.path.join(ROOT, page), encoding="utf-8") as text:
        for number, line in enumerate(text.read().split("\n"), 1):
            comment = re.fullmatch(r"<!-- (\w+): (.*) -->", line)
            if line.startswith("```"):
                fence = None if fence is not None else line[3:]
                if fence == "sh":
                    found.append(Block(page, number, notes))
                    notes = []
                elif fence == "text" and not found:
                    sys.exit(f"{page}:{number}: output without a command before it")
            elif fence == "sh":
                found[-1].commands.append(line)
            elif fence == "text":
                found[-1].shown.append((number, line))
            elif comment and fence is None:
                if comment[1] not in KINDS:
                    sys.exit(f"{page}:{number}: '{comment[1]}': expected one of {', '.join(KINDS)}")
                notes.append((comment[1], comment[2]))
    if notes:
        sys.exit(f"{page}: '{notes[0][1]}' stands before no ```sh block")
    if not found:
        sys.exit(f"{page}: no ```sh block")
    return found


def left_out(block):
    """Why a block is not run, or nothing."""
    for program in block.note("needs"):
        if not shutil.which(program):
            print(f"{program}: not on this machine", flush=True)
            return program
    return block.note("skip")


def shortened(block):
    text = "\n".join(block.commands)
    for rule in block.note("short"):
        _, old, new, _ = rule[1:].split(rule[1])
        if old not in text:
            sys.exit(f"{block.where}: '{old}' is not in the block: nothing to shorten")
        text = text.replace(old, new)
    return text


def script(todo, logs, in_full):
    """One shell for all blocks of a page; N.log is the output of block N, N.status and N.folder are there when it is through."""
    lines = []
    for n, block in enumerate(todo):
        status = (block.note("exit") or ["0"])[0]
        lines += [f"exec >{logs}/{n}.log 2>&1", "set -e" if status == "0" else "set +e",
                  "\n".join(block.commands) if in_full else shortened(block),
                  f"echo $? >{logs}/{n}.status", f"pwd >{logs}/{n}.folder"]
    return "\n".join(lines)


def plain(line):
    """A line of output with its numbers replaced by #, to compare it by."""
    return re.sub(NUMBER, "#", " ".join(line.split()))


def check_shown(block, output):
    rest = [plain(line) for line in output]
    for number, line in block.shown:
        want = plain(line)
        if want in ("", "..."):
            continue
        if want.endswith("..."):
            at = [n for n, got in enumerate(rest) if got.startswith(want[:-3].rstrip())]
        else:
            at = [n for n, got in enumerate(rest) if got == want]
        if not at:
            yield f"{block.where}: line {number} of the page, '{line.strip()}', is not in the output"
            return
        rest = rest[at[0] + 1:]


def check_ranges(block, output):
    for text in block.note("range"):
        what, bounds = text.rsplit(" in ", 1)
        low, high = map(float, bounds.split(".."))
        pattern = r"\s+".join(map(re.escape, what.split())).replace(r"\#", f"({NUMBER})")
        got = [float(value.replace(",", "")) for line in output for value in re.findall(pattern, line)]
        if not got:
            yield f"{block.where}: '{what}' is not in the output"
        for value in got:
            if not low <= value <= high:
                yield f"{block.where}: '{what}' is {value}, the page promises {low} to {high}"


def check_files(block, folder):
    for name in block.note("makes"):
        path = os.path.join(folder, name)
        if not os.path.isfile(path) or not os.path.getsize(path):
            yield f"{block.where}: no {name}"
        elif name.endswith(".png"):
            with open(path, "rb") as file:
                if file.read(8) != b"\x89PNG\r\n\x1a\n":
                    yield f"{block.where}: {name} is no PNG"


def read(path):
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.read()


def check(block, n, logs):
    """What is wrong with one block after the run."""
    output = re.split(r"[\r\n]", read(f"{logs}/{n}.log")) if os.path.exists(f"{logs}/{n}.log") else []
    want = int((block.note("exit") or ["0"])[0])
    if not os.path.exists(f"{logs}/{n}.status"):
        return [f"{block.where}: failed, expected exit status {want}:"] + [f"    {line}" for line in output[-12:]]
    status = int(read(f"{logs}/{n}.status"))
    wrong = [f"{block.where}: exit status {status}, expected {want}"] if status != want else []
    wrong += [*check_shown(block, output), *check_ranges(block, output), *check_files(block, read(f"{logs}/{n}.folder").strip())]
    return wrong + [f"    {line}" for line in output[-30:] if wrong]


def house(build, work, whole):
    """The source tree as a reader sees it, with a build folder whose contents are those of BUILD: what the tutorials need, or
    the whole of it with a copy of the demo."""
    sources, built = ("docs", "rtl", "share", "tests", "tools"), ("bin", "share")
    if whole:
        sources = [name for name in os.listdir(ROOT) if name not in ("build", ".git")]
        built = [name for name in os.listdir(build) if name not in ("demo", "tutorial")]
    for name in sources:
        os.symlink(os.path.join(ROOT, name), os.path.join(work, name))
    os.mkdir(os.path.join(work, "build"))
    for name in built:
        os.symlink(os.path.join(build, name), os.path.join(work, "build", name))
    if whole and os.path.isdir(os.path.join(build, "demo")):
        shutil.copytree(os.path.join(build, "demo"), os.path.join(work, "build", "demo"))


def end(shell):
    """Ends a shell and whatever it started, if anything of that is still there."""
    try:
        os.killpg(shell.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    shell.wait()


def forget_blocks(logs):
    """Removes what sf_cosim --dut built beside BUILD for this run."""
    for name in os.listdir(logs):
        for folder in re.findall(r"^ *VERI *(/.*/dut/[0-9a-f]{16})$", read(f"{logs}/{name}"), re.M):
            shutil.rmtree(folder, ignore_errors=True)


def today(shown, output):
    """The line of the page with the numbers of the line of output that it shows, and what is left of the output."""
    text = shown.strip()
    dots = re.search(r" ?\.\.\.$", text)
    parts = re.split(f"({NUMBER}|\\s+)", text[:dots.start()] if dots else text)
    pattern = "".join(r"\s+" if part.isspace() else NUMBER if n % 2 else re.escape(part) for n, part in enumerate(parts))
    for n, line in enumerate(output):
        found = re.match(pattern if dots else f"{pattern}$", line.strip())
        if text not in ("", "...") and found:
            indent = shown[:len(shown) - len(shown.lstrip())]
            return indent + found[0] + (dots[0] if dots else ""), output[n + 1:]
    return shown, output


def reprint(page, todo, logs):
    """Writes the page again with the outputs of this run."""
    with open(os.path.join(ROOT, page), encoding="utf-8") as file:
        lines = file.read().split("\n")
    for n, block in enumerate(todo):
        output = re.split(r"[\r\n]", read(f"{logs}/{n}.log"))
        for number, line in block.shown:
            lines[number - 1], output = today(line, output)
    with open(os.path.join(ROOT, page), "w", encoding="utf-8") as file:
        file.write("\n".join(lines))


def run(page, build, write):
    """Runs a page, and writes it again if nothing is wrong with it; what is wrong with it."""
    todo = [block for block in blocks(page) if not left_out(block)]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    environment["GNUMAKEFLAGS"] = "VERILATED_OPT=OPT_FAST=-O0\\ OPT_SLOW=-O0\\ OPT_GLOBAL=-O0"  # a block of one's own is sooner there
    with tempfile.TemporaryDirectory(prefix="sf_tutorial.") as top:
        work, logs = os.path.join(top, "spikefield"), os.path.join(top, "logs")
        os.mkdir(work)
        os.mkdir(logs)
        house(build, work, write)
        started = time.monotonic()
        shell = subprocess.Popen(["bash", "-c", script(todo, logs, write)], cwd=work, env=environment, stdin=subprocess.DEVNULL,
                                 start_new_session=True)
        wrong = []
        try:
            shell.wait(LIMIT)
        except subprocess.TimeoutExpired:
            wrong = [f"{page}: not through after {LIMIT} s"]
        finally:
            end(shell)
        for n, block in enumerate(todo):
            if wrong:
                break
            wrong = check(block, n, logs)
        if write and not wrong:
            reprint(page, todo, logs)
        forget_blocks(logs)
    print(f"{page}: {len(todo)} blocks, {time.monotonic() - started:.0f} s", flush=True)
    return wrong


def main():
    write = sys.argv[1:2] == ["--print"]
    arguments = sys.argv[2:] if write else sys.argv[1:]
    if not arguments or arguments[0].startswith("-"):
        sys.exit(__doc__)
    wrong = []
    for page in arguments[1:] or (PAGES[:3] + DEMO_PAGES if write else PAGES):
        wrong += run(page, os.path.abspath(arguments[0]), write)
    print(*wrong, sep="\n", end="\n" if wrong else "")
    sys.exit(len(wrong) > 0)


main()
