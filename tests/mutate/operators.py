#!/usr/bin/env python3
"""Writes RTL modules with all their mutants in them; the environment's SF_MUTANT=N chooses one at run time.

usage: operators.py RTL OUT MODULE...
OUT/MODULE.sv is RTL/MODULE.sv in which every expression reads `mutant N ? changed : original`; OUT/mutants lists them
with tabs between: number, module, place, what was changed. The same sources give the same numbers.

Operators, on right sides, conditions and port expressions:
  && with ||, & with |, + with -, == with !=, < with <=, > with >=; ! and ~ dropped
  a bit (signal, or element of a vector) stuck at 0 and at 1; the lowest bit of a vector inverted
  a constant one more and one less; a condition always true and never true; a register that keeps its value
Not mutated: declarations, parameters, loops over more than 8 rounds (lanes), branches of builds without a tap.
"""
import re
import sys

TOKEN = re.compile(r"\d+'\(|\d+'s?[bdh][0-9a-fA-F_]+|'0|[A-Za-z_$][\w$]*(?:::\w+)?|\d+|&&|\|\||==|!=|<=|>=|<<|>>>|>>|\+:|-:|\+\+|\S")
SWAP = {"&&": "||", "||": "&&", "&": "|", "|": "&", "+": "-", "-": "+", "==": "!=", "!=": "==", "<": "<=", "<=": "<",
        ">": ">=", ">=": ">"}
CLOSE = {"(": ")", "[": "]", "{": "}"}
ROUNDS = 8


class Module:
    def __init__(self, name, text):
        self.name = name
        self.source = text
        # Comments become blanks, so that places stay what they are.
        self.text = re.sub(r"//[^\n]*|/\*.*?\*/|`[^\n]*", lambda m: re.sub(r"[^\n]", " ", m[0]), text, flags=re.S)
        self.tokens = [(m[0], m.start(), m.end()) for m in TOKEN.finditer(self.text)]
        self.bits, self.vectors = set(), set()
        self.declared()

    def declared(self):
        for m in re.finditer(r"\b(?:wire|reg)\b\s*(?:signed\s*)?(\[[^\]]*\])?\s*([^;=]*?)\s*(?=[;=)]|,\s*(?:input|output|$))",
                             self.text, flags=re.M):
            for name in m[2].split(","):
                if re.fullmatch(r"\s*\w+\s*", name):  # a memory has a range behind its name
                    (self.vectors if m[1] else self.bits).add(name.strip())

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
        while self.tokens[i][0] != end:
            i = self.match(i) if self.tokens[i][0][-1] in "([{" else i + 1
        return i

    def places(self):
        """(kind, first token, end token, what it is given to) of every expression that is mutated."""
        t = [token[0] for token in self.tokens]
        i = t.index(";", t.index("module"))
        while i < len(t):
            if t[i] in ("localparam", "parameter", "initial"):
                i = self.block(i)
            elif t[i] == "for" and t[self.match(i + 1)] == "begin" and t[self.match(i + 1) + 1] == ":":
                i = self.match(i + 1)
            elif t[i] == "for":
                head, i = t[i:self.match(i + 1)], self.match(i + 1)
                limit = head[head.index("<") + 1]
                if not limit.isdigit() or int(limit) > ROUNDS:
                    i = self.block(i)
            elif t[i] == "if":
                end = self.match(i + 1)
                if t[end + 1] != ":":
                    yield "if", i + 2, end - 1, "if"
                i = end
            elif t[i] == "begin" and t[i + 1] == ":" and t[i + 2].startswith("g_no_"):
                i = self.block(i)
            elif t[i] == "#" and t[i + 1] == "(":
                i = self.match(i + 1)
            elif t[i] == "." and t[i + 2] == "(":
                end = self.match(i + 2)
                if any(x in SWAP or x in "!~?" for x in t[i + 3:end - 1]):
                    yield "port", i + 3, end - 1, "." + t[i + 1]
                i = end
            elif t[i] in "[{" or (t[i] == "(" and t[i - 1] == "case"):
                i = self.match(i)
            elif t[i] in ("=", "<="):
                end = self.until(i + 1, ";")
                first = i - 1
                if t[first] in ("]", "}"):
                    depth = 0
                    while True:
                        depth += (t[first] in ("]", "}")) - (t[first] in ("[", "{"))
                        if depth == 0:
                            break
                        first -= 1
                    first -= t[first] == "["
                left = " ".join(self.text[self.tokens[first][1]:self.tokens[i - 1][2]].split())
                if not left.startswith("unused"):
                    yield t[i], i + 1, end, left
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
            yield whole, f"{left} keeps its value", left
        for i in range(first, end):
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
                elif j == i + 1:
                    yield put(i, j, f"({t[i]} ^ 1'b1)")

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
            out += [self.text[at:start], f"(mutant_q >= {low} && mutant_q < {number} ? ({chain}({original})) : ({original}))"]
            at = stop
        text = "".join(out) + self.text[at:]
        choice = "\n  import \"DPI-C\" function int sf_mutant();\n  int mutant_q;\n  initial mutant_q = sf_mutant();\n"
        header = text.index("\n);") + 3
        return "`default_nettype none\n" + text[:header] + choice + text[header:], mutants


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    rtl, out, modules = sys.argv[1], sys.argv[2], sys.argv[3:]
    number, everything = 1, []
    for name in modules:
        with open(f"{rtl}/{name}.sv") as f:
            module = Module(name, f.read())
        text, mutants = module.mutate(number)
        number += len(mutants)
        everything += mutants
        with open(f"{out}/{name}.sv", "w") as f:
            f.write(text)
    with open(f"{out}/mutants", "w") as f:
        f.writelines(f"{n}\t{m}\trtl/{m}.sv:{line}\t{what}\n" for n, m, line, what in everything)


main()
