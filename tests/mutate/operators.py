#!/usr/bin/env python3
"""Writes RTL modules with all their mutants in them; the environment's SF_MUTANT=N chooses one at run time.

usage: operators.py [--lanes] RTL OUT MODULE...
OUT/MODULE.sv is RTL/MODULE.sv in which every expression reads `mutant N ? changed : original`; OUT/mutants lists them
with tabs between: number, module, place, what was changed. The same sources give the same numbers.

Operators, on right sides, conditions and what an instance's inputs are connected to:
  && with ||, & with |, + with -, == with !=, < with <=, > with >=; ! and ~ dropped
  a bit (signal, or element of a vector) stuck at 0 and at 1; the lowest bit of a vector, of a part of it, of a word of
  a memory inverted
  a constant one more and one less; a condition always true and never true; a register that keeps its value
Not mutated: declarations, parameters, clocks and resets of instances, branches of builds without a tap, and loops over
lanes (of more than 8 rounds); with --lanes nothing but these loops.
"""
import os
import re
import sys

TOKEN = re.compile(r"\d+'\(|\d+'s?[bdh][0-9a-fA-F_]+|'0|[A-Za-z_$][\w$]*(?:::\w+)?|\d+|&&|\|\||==|!=|<=|>=|<<|>>>|>>|\+:|-:|\+\+|\S")
SWAP = {"&&": "||", "||": "&&", "&": "|", "|": "&", "+": "-", "-": "+", "==": "!=", "!=": "==", "<": "<=", "<=": "<",
        ">": ">=", ">=": ">"}
CLOSE = {"(": ")", "[": "]", "{": "}"}
BLANK = re.compile(r"//[^\n]*|/\*.*?\*/|`SF_REFUSE\(.*?\"\)|`[^\n]*", re.S)
ROUNDS = 8
LANES = ("LANES", "MACS", "ADDERS", "NEURONS")
INPUT = re.compile(r"\binput\s+wire\s*(?:signed\s*)?(?:\[[^\]]*\])?\s*(\w+)")


def inputs(rtl):
    """The inputs of every module that may be mutated at an instance of it."""
    found = {}
    for name in os.listdir(rtl):
        if name.endswith(".sv"):
            with open(f"{rtl}/{name}") as f:
                found[name[:-3]] = set(INPUT.findall(f.read())) - {"clk_i", "rst_ni"}
    return found


def is_word(token):
    return bool(re.fullmatch(r"[\w:']+", token))


class Module:
    """lanes: whether the loops over lanes are mutated or everything else; inputs: of each module."""

    def __init__(self, name, text, inputs, lanes):
        self.name, self.inputs, self.lanes = name, inputs, lanes
        self.source = text
        # Comments and checks of parameters become blanks, so that places stay what they are.
        self.text = re.sub(BLANK, lambda m: re.sub(r"[^\n]", " ", m[0]), text)
        self.tokens = [(m[0], m.start(), m.end()) for m in TOKEN.finditer(self.text)]
        self.bits, self.vectors, self.memories, self.signed = set(), set(), set(), set()
        self.declared()

    def declared(self):
        for m in re.finditer(r"\b(?:wire|reg)\b\s*(signed\b)?\s*(\[[^\]]*\])?\s*([^;=]*?)\s*(?=[;=)]|,\s*(?:input|output|$))",
                             self.text, flags=re.M):
            for one in m[3].split(","):
                name, range_behind = re.fullmatch(r"\s*(\w*)\s*(\[.*)?", one, flags=re.S).groups()
                (self.memories if range_behind else self.vectors if m[2] else self.bits).add(name)
                if m[1]:
                    self.signed.add(name)
        for i, token in enumerate(self.tokens):
            if token[0] in ("wire", "reg"):
                self.given(i + 1)

    def given(self, i):
        """The names of a declaration `wire [1:0] a = x, b = y;` of which token i is the first behind `wire`."""
        signed = self.tokens[i][0] == "signed"
        i += signed
        vector = self.tokens[i][0] == "["
        i = self.match(i) if vector else i
        while self.tokens[i + 1][0] == "=":
            name = self.tokens[i][0]
            (self.vectors if vector else self.bits).add(name)
            if signed:
                self.signed.add(name)
            i = self.until(i + 2, (",", ";"))
            if self.tokens[i][0] == ";":
                break
            i += 1

    def match(self, i):
        """Token behind the bracket that closes token i."""
        depth = 0
        while True:
            t = self.tokens[i][0]
            depth += t[-1] in "([{"
            depth -= t in (")", "]", "}")
            i += 1
            if depth == 0:
                return i

    def block(self, i):
        """Token behind the statement that begins at token i."""
        if self.tokens[i][0] != "begin":
            while self.tokens[i][0] != ";":
                if self.tokens[i][0] == "begin":
                    return self.block(i)
                i = self.match(i) if self.tokens[i][0][-1] in "([{" else i + 1
            return i + 1
        depth = 0
        while True:
            depth += self.tokens[i][0] in ("begin", "case")
            depth -= self.tokens[i][0] in ("end", "endcase")
            i += 1
            if depth == 0:
                return i

    def until(self, i, end):
        while self.tokens[i][0] not in end:
            i = self.match(i) if self.tokens[i][0][-1] in "([{" else i + 1
        return i

    def places(self):
        """(kind, first token, end token, what it is given to) of every expression that is mutated."""
        loop_end = 0
        for end, place in self.all_places():
            loop_end = max(loop_end, end)
            if place and (place[1] < loop_end) == self.lanes:
                yield place

    def all_places(self):
        """(token behind a loop over lanes that begins here, else 0; place or None)."""
        t = [token[0] for token in self.tokens]
        i, instance = t.index(";", t.index("module")), set()
        while i < len(t):
            if t[i] in ("localparam", "parameter", "initial"):
                i = self.block(i)
            elif t[i] == "for" and t[self.match(i + 1)] == "begin" and t[self.match(i + 1) + 1] == ":":
                i = self.match(i + 1)
            elif t[i] == "for":
                head, i = t[i:self.match(i + 1)], self.match(i + 1)
                limit = head[head.index("<") + 1]
                if limit in LANES or (limit.isdigit() and int(limit) > ROUNDS):
                    yield self.block(i), None
            elif t[i] == "if":
                end = self.match(i + 1)
                if t[end + 1] != ":":
                    yield 0, ("if", i + 2, end - 1, "if")
                i = end
            elif t[i] == "begin" and t[i + 1] == ":" and t[i + 2].startswith("g_no_"):
                i = self.block(i)
            elif t[i] == "#" and t[i + 1] == "(":
                i = self.match(i + 1)
            elif t[i] == "." and t[i + 2] == "(":
                end = self.match(i + 2)
                if t[i + 1] in instance:
                    yield 0, ("port", i + 3, end - 1, "." + t[i + 1])
                i = end
            elif t[i] in self.inputs and i + 1 < len(t) and t[i + 1] != ";":
                instance, i = self.inputs[t[i]], i + 1
            elif t[i] in "[{" or (t[i] == "(" and t[i - 1] == "case"):
                i = self.match(i)
            elif t[i] in ("=", "<="):
                end = self.until(i + 1, (",", ";"))
                first = i - 1  # of what is given: a name with brackets behind it, or braces
                while t[first] in ("]", "}"):
                    depth = 0
                    while True:
                        depth += (t[first] in ("]", "}")) - (t[first] in ("[", "{"))
                        if depth == 0:
                            break
                        first -= 1
                    if t[first] == "{":
                        break
                    first -= 1
                left = " ".join(self.text[self.tokens[first][1]:self.tokens[i - 1][2]].split())
                if not left.startswith("unused"):
                    yield 0, (t[i], i + 1, end, left)
                i = end
            else:
                i += 1

    def changes(self, kind, first, end, left):
        """(line, what, expression) of each mutant of a place."""
        t, spans = [x[0] for x in self.tokens], self.tokens
        start, stop = spans[first][1], spans[end - 1][2]

        def put(i, j, new):
            old = self.text[spans[i][1]:spans[j - 1][2]]
            line = self.text.count("\n", 0, spans[i][1]) + 1
            around = " ".join(self.text[max(start, spans[i][1] - 24):min(stop, spans[j - 1][2] + 24)].split())
            shown = new.strip() or "nothing"
            return line, f"{left}: {old} -> {shown} in `{around}`", self.text[start:spans[i][1]] + new + self.text[spans[j - 1][2]:stop]

        whole = self.text.count("\n", 0, start) + 1
        if kind == "if":
            condition = " ".join(self.text[start:stop].split())
            yield whole, f"if ({condition}) always", "1'b1"
            yield whole, f"if ({condition}) never", "1'b0"
        if kind == "<=":
            # $signed: an unsigned choice would make a signed right side unsigned.
            yield whole, f"{left} keeps its value", f"$signed({left})"
        constant_end = 0  # behind the range of a part of a vector, the count of a replication, a name in another block
        for i in range(first, end):
            if t[i] == "[" and t[self.until(i + 1, (":", "]"))] == ":":
                constant_end = max(constant_end, self.match(i))
            if t[i] == "[" and t[self.match(i)] == ".":
                constant_end = max(constant_end, self.match(i) + 2)
            if t[i] == "{":
                constant_end = max(constant_end, self.count_end(i))
            if i < constant_end:
                continue
            before = t[i - 1] if i > first else "("
            binary = bool(re.fullmatch(r"[\w$:']*[\w]|[\])}]", before))
            if t[i] in SWAP and binary and not (t[i] == "&" and t[i + 1] == "&"):
                yield put(i, i + 1, SWAP[t[i]])
            elif t[i] in ("!", "~"):
                yield put(i, i + 1, " ")
            elif re.match(r"\d+'s?[bdh]", t[i]):
                size, sign, base, digits = re.match(r"(\d+)'(s?)([bdh])(.*)", t[i]).groups()
                value = int(digits.replace("_", ""), {"b": 2, "d": 10, "h": 16}[base])
                new = {(value + step) % (1 << int(size)) for step in (1, -1)}
                for v in sorted(new):
                    yield put(i, i + 1, f"{size}'{sign}h{v:x}")
            elif t[i] in self.bits or t[i] in self.vectors:
                j = self.match(i + 1) if i + 1 < end and t[i + 1] == "[" else i + 1
                alone = end - first == j - i and kind == "if"  # the condition itself
                if (t[i] in self.bits and j == i + 1) or (t[i] in self.vectors and j > i + 1 and ":" not in t[i:j]
                                                         and "+:" not in t[i:j]):
                    if not alone:
                        yield put(i, j, "1'b0")
                        yield put(i, j, "1'b1")
                elif j == i + 1 or t[i] in self.vectors:
                    yield put(i, j, self.inverted(i, j, t[i] in self.signed and j == i + 1))
            elif t[i] in self.memories and t[i + 1] == "[":
                j = self.match(i + 1)
                if j == end or t[j] != "[":
                    yield put(i, j, self.inverted(i, j, t[i] in self.signed))

    def count_end(self, i):
        """Token behind the count of the replication that token i opens, 0 if it is none."""
        j = i + 1
        while is_word(self.tokens[j][0]) or self.tokens[j][0] in "()*+-":
            j += 1
        return j if self.tokens[j][0] == "{" and j > i + 1 else 0

    def inverted(self, first, end, signed):
        """The lowest bit of a vector; an unsigned operand would make its whole expression unsigned."""
        text = self.text[self.tokens[first][1]:self.tokens[end - 1][2]]
        one = "2'sb01" if signed else "1'b1"
        return f"({text} ^ {one})"

    def mutate(self, number):
        """The text with all mutants, numbered from `number`; their list."""
        out, at, mutants = [], 0, []
        for kind, first, end, left in self.places():
            alternatives = list(dict((c[2], c) for c in self.changes(kind, first, end, left)).values())
            if not alternatives:
                continue
            start, stop = self.tokens[first][1], self.tokens[end - 1][2]
            low, chain = number, ""
            for line, what, changed in alternatives:
                chain += f"mutant_q == {number} ? ({changed}) : "
                mutants.append((number, self.name, line, what))
                number += 1
            original = self.text[start:stop]
            out += [self.source[at:start], f"(mutant_q >= {low} && mutant_q < {number} ? ({chain}({original})) : ({original}))"]
            at = stop
        text = "".join(out) + self.source[at:]
        choice = "\n  import \"DPI-C\" function int sf_mutant();\n  int mutant_q;\n  initial mutant_q = sf_mutant();\n"
        header = text.index("\n);") + 3
        return text[:header] + choice + text[header:], mutants


def main():
    given = sys.argv[1:]
    lanes = given[:1] == ["--lanes"]
    if len(given) < 3 + lanes:
        sys.exit(__doc__)
    (rtl, out), modules = given[lanes:lanes + 2], given[lanes + 2:]
    number, everything, ports = 1, [], inputs(rtl)
    for name in modules:
        with open(f"{rtl}/{name}.sv") as f:
            module = Module(name, f.read(), ports, lanes)
        text, mutants = module.mutate(number)
        number += len(mutants)
        everything += mutants
        with open(f"{out}/{name}.sv", "w") as f:
            f.write(text)
    with open(f"{out}/mutants", "w") as f:
        f.writelines(f"{n}\t{m}\trtl/{m}.sv:{line}\t{what}\n" for n, m, line, what in everything)


main()
