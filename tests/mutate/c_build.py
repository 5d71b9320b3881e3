"""Builds one mutant of a C file: its object with the normal flags, and the test programs linked with that object in front
of the library. The commands are those that make prints (`make -n V=1`), so they are the ones of the build."""
import contextlib
import os
import re
import shlex
import subprocess

import campaign

SANITIZED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
WRAP = ["-Wl,--wrap=_ck_assert_failed", "-s"]  # first_failure.c; and no symbols, which take most of a link


class Build:
    """folder: of the build; commands: the file of what make prints."""

    def __init__(self, folder, commands):
        self.folder, self.work = folder, os.path.dirname(commands)
        self.compilers, self.linkers = {}, {}
        with open(commands) as f:
            for line in f:
                words = shlex.split(line) if re.search(r" -o \S+", line) else []
                words = words[1:] if words and os.path.basename(words[0]) == "ccache" else words
                if "-c" in words:
                    self.compilers[words[words.index("-c") + 1]] = words
                elif words:
                    self.linkers[os.path.basename(words[words.index("-o") + 1])] = words

    def flags(self, path):
        """A file's compiler and flags, without what names files."""
        kept, words = [], iter(self.compilers[path])
        for word in words:
            if word in ("-c", "-o"):
                next(words)
            elif word not in ("-g", "-MMD", "-MP"):
                kept.append(word)
        return kept

    def compile(self, path, source, to, more=()):
        """Whether the compiler takes the source (bytes) in the file's place, with flags behind its own."""
        command = self.flags(path) + list(more) + ["-w", "-iquote", os.path.dirname(path), "-x", "c", "-c", "-", "-o", to]
        return subprocess.run(command, input=source, stderr=subprocess.DEVNULL).returncode == 0

    def compile_whole(self, path, more, to):
        """The file itself, with flags behind its own."""
        os.makedirs(os.path.dirname(to), exist_ok=True)
        subprocess.run(self.flags(path) + ["-w"] + more + ["-c", path, "-o", to], check=True)

    def link(self, test, first, to, more=()):
        """The test program with objects or archives in front of the library, and beside its folder what it looks for there."""
        beside = f"{os.path.dirname(os.path.dirname(to))}/share"
        if not os.path.lexists(beside):
            with contextlib.suppress(FileExistsError): # another thread was faster
                os.symlink(os.path.abspath(f"{self.folder}/share"), beside)
        command = list(self.linkers[test])
        command[command.index("-o") + 1] = to
        library = next(i for i, word in enumerate(command) if word.endswith(".a"))
        command[library:library] = first
        if subprocess.run(command + list(more), stdout=subprocess.DEVNULL).returncode:
            raise campaign.Stop(f"{test} cannot be linked")

    def link_mutant(self, test, mutant, to, more=()):
        """mutant: its object, or None for the program without a mutant."""
        first = [mutant] if mutant else []
        self.link(test, first + [f"{self.folder}/obj/tests/mutate/first_failure.o"], to, WRAP + list(more))

    def key_of_test(self, test):
        """Of the program as it is built, without what comments and places change."""
        stripped = f"{self.work}/stripped.{test}"
        subprocess.run(["strip", "-o", stripped, f"{self.folder}/tests/{test}"], check=True)
        with open(stripped, "rb") as f:
            key = campaign.digest(f.read())
        os.remove(stripped)
        return key
