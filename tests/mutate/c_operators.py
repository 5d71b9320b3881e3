"""Finds the mutants of a C file in its syntax tree, each with the exact range of the source that it replaces.

operator     what is changed
arithmetic   + with -, * with /, % with /, << with >>, & with |; an operand left out; += with -= and with =, *= with /=
comparison   a limit one further or one less (< and <=, > and >=), the opposite; == with !=
logical      && with ||; ! dropped; true with false
constant     one more, one less, 0
condition    of if, while, do and ?: negated
statement    an expression, break, continue or empty return deleted; SF_TRY whose failure is ignored
sign         - and ~ dropped; ++ with --
return       a number one more, a bool negated, a pointer NULL, a status without its error
Not mutated: declarations, labels, texts, what stands inside another macro, and calls that only release memory.
"""
import bisect
import collections
import re

import campaign

try:
    import clang.cindex as cindex
    from clang.cindex import CursorKind as K
    from clang.cindex import TypeKind as T
except ImportError:
    cindex = None

# first, last: lines, of which a test has to run one; before is source[start:end]
Edit = collections.namedtuple("Edit", "operator start end new first last function what")
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "/", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "^": "|"}
COMPARISON = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)}
LOGICAL = {"&&": "||", "||": "&&"}
ASSIGNMENT = {"+=": ("-=", "="), "-=": ("+=", "="), "*=": ("/=", "="), "/=": ("*=",), "%=": ("/=",), "&=": ("|=",),
              "|=": ("&=", "="), "^=": ("|=",), "<<=": (">>=",), ">>=": ("<<=",)}
RELEASE = re.compile(r"(\w*_)?(free|close_memory|destroy)$")
COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)
INTEGER = re.compile(r"(0[xX][0-9a-fA-F]+|\d+)([uUlL]*)$")
FLOAT = re.compile(r"(.*?)([fFlL]?)$")


class File:
    """The edits of one file. arguments: those of its compiler that decide what it means."""

    def __init__(self, path, arguments):
        self.path, self.edits = path, []
        with open(path, "rb") as f:
            self.source = f.read()
        unit = cindex.Index.create().parse(path, arguments, options=cindex.TranslationUnit.PARSE_DETAILED_PROCESSING_RECORD)
        for message in unit.diagnostics:
            if message.severity >= cindex.Diagnostic.Error:
                raise campaign.Stop(f"{message.location.file}:{message.location.line}: libclang: {message.spelling}")
        self.lines = [0] + [m.end() for m in re.finditer(rb"\n", self.source)]
        self.macros, self.function = [], ""
        top = [c for c in unit.cursor.get_children() if c.location.file and c.location.file.name == path]
        for cursor in top:
            if cursor.kind == K.MACRO_INSTANTIATION:
                self.macros.append((cursor.extent.start.offset, cursor.extent.end.offset, cursor.spelling))
        for cursor in top:
            if cursor.kind in (K.FUNCTION_DECL, K.VAR_DECL):
                self.function = cursor.spelling
                self.flags_of(cursor)
                self.walk(cursor, None)
        self.edits.sort(key=lambda e: (e.start, e.end))

    def text(self, start, end):
        return self.source[start:end].decode()

    def of(self, cursor):
        return self.text(cursor.extent.start.offset, cursor.extent.end.offset)

    def line(self, offset):
        return bisect.bisect_right(self.lines, offset)

    def in_macro(self, cursor):
        start, end = cursor.extent.start.offset, cursor.extent.end.offset
        return any(s <= start and end <= e for s, e, _ in self.macros)

    def add(self, operator, start, end, new, what, around=None):
        """what: of the change; around: the cursor that shows where."""
        if around is not None:
            what += " in `%s`" % short(self.of(around), 60)
        self.edits.append(Edit(operator, start, end, new, self.line(start), self.line(max(start, end - 1)), self.function,
                               f"{self.function}: {what}"))

    def replace(self, operator, cursor, new, what=None, around=None):
        old = short(self.of(cursor), 40)
        self.add(operator, cursor.extent.start.offset, cursor.extent.end.offset, new, what or f"{old} -> {short(new, 40)}", around)

    def flags_of(self, function):
        """true and false are macros."""
        start, end = function.extent.start.offset, function.extent.end.offset
        for s, e, name in self.macros:
            if start <= s < end and name in ("true", "false") and self.text(s, e) == name:
                self.add("logical", s, e, "false" if name == "true" else "true", f"{name} at `{self.around(s)}`")

    def around(self, offset):
        line = self.line(offset) - 1
        end = self.lines[line + 1] if line + 1 < len(self.lines) else len(self.source)
        return short(self.text(self.lines[line], end), 60)

    def walk(self, cursor, parent):
        children = list(cursor.get_children())
        if cursor.kind == K.VAR_DECL:
            equals = self.source.find(b"=", cursor.location.offset, cursor.extent.end.offset)
            children = [c for c in children if 0 <= equals < c.extent.start.offset]
        elif cursor.kind in (K.STRUCT_DECL, K.UNION_DECL, K.ENUM_DECL, K.TYPEDEF_DECL, K.PARM_DECL, K.TYPE_REF):
            return
        self.statements(cursor, children)
        if cursor.kind == K.CASE_STMT:
            children = children[1:]
        elif cursor.kind == K.CXX_UNARY_EXPR:
            return  # sizeof
        elif not self.in_macro(cursor):
            method = METHODS.get(cursor.kind)
            if method:
                method(self, cursor, children, parent)
        for child in children:
            if not self.in_macro(child):
                self.walk(child, parent if child.extent == cursor.extent else cursor)

    def statements(self, cursor, children):
        """Those that stand directly in the cursor."""
        if cursor.kind == K.COMPOUND_STMT:
            inside = children
        elif cursor.kind == K.IF_STMT:
            inside = children[1:]
        elif cursor.kind in (K.FOR_STMT, K.WHILE_STMT, K.CASE_STMT, K.DEFAULT_STMT):
            inside = children[-1:]
        else:
            return
        for child in inside:
            start, end = child.extent.start.offset, child.extent.end.offset
            macro = next(((s, e, n) for s, e, n in self.macros if s == start and end <= e), None)
            if macro:
                end = max(end, macro[1])
            semicolon = re.match(rb"\s*;", self.source[end:])
            if not semicolon or (not macro and not self.deletable(child)):
                continue
            end += semicolon.end()
            shown = short(self.text(start, end), 70)
            self.add("statement", start, end, ";", f"deleted `{shown}`")
            if macro and macro[2] == "SF_TRY":
                self.add("statement", start, start + len("SF_TRY"), "(void)", f"failure ignored of `{shown}`")

    @staticmethod
    def deletable(child):
        if child.kind == K.CALL_EXPR:
            return not RELEASE.match(child.spelling)
        if child.kind == K.RETURN_STMT:
            return not list(child.get_children())
        return child.kind in (K.BINARY_OPERATOR, K.COMPOUND_ASSIGNMENT_OPERATOR, K.UNARY_OPERATOR, K.BREAK_STMT, K.CONTINUE_STMT)

    def operator_between(self, left, right):
        """(text, start, end) of what stands between two operands."""
        start, end = left.extent.end.offset, right.extent.start.offset
        blank = COMMENT.sub(lambda m: " " * len(m[0]), self.text(start, end))
        text = blank.strip()
        start += len(blank) - len(blank.lstrip())
        return text, start, start + len(text)

    def binary(self, cursor, children, parent):
        if len(children) != 2:
            return
        left, right = children
        op, start, end = self.operator_between(left, right)
        if op in COMPARISON:
            for new in COMPARISON[op]:
                self.add("comparison", start, end, new, f"{op} -> {new}", cursor)
        elif op in LOGICAL:
            self.replace("logical", cursor, f"({self.of(left)} {LOGICAL[op]} {self.of(right)})", f"{op} -> {LOGICAL[op]}", cursor)
        elif op in ARITHMETIC:
            new = ARITHMETIC[op]
            if op in "&|^":
                self.replace("arithmetic", cursor, f"({self.of(left)} {new} {self.of(right)})", f"{op} -> {new}", cursor)
            elif not (op in "*%" and kind_of(cursor) == T.POINTER):
                self.add("arithmetic", start, end, new, f"{op} -> {new}", cursor)
            self.replace("arithmetic", cursor, self.of(left), f"without {op} {short(self.of(right), 30)}", cursor)
            if op in "+*&|^" and kind_of(cursor) != T.POINTER:
                self.replace("arithmetic", cursor, self.of(right), f"without {short(self.of(left), 30)} {op}", cursor)

    def compound(self, cursor, children, parent):
        op, start, end = self.operator_between(*children)
        for new in ASSIGNMENT.get(op, ()):
            self.add("arithmetic", start, end, new, f"{op} -> {new}", cursor)

    def unary(self, cursor, children, parent):
        start, end, inside = cursor.extent.start.offset, cursor.extent.end.offset, children[0].extent
        before, behind = self.text(start, inside.start.offset).strip(), self.text(inside.end.offset, end).strip()
        if before in ("-", "~", "!"):
            self.add("logical" if before == "!" else "sign", start, inside.start.offset, "", f"{before} dropped", cursor)
        elif before in ("++", "--"):
            self.add("sign", start, start + 2, "--" if before == "++" else "++", f"{before} turned", cursor)
        elif behind in ("++", "--"):
            self.add("sign", end - 2, end, "--" if behind == "++" else "++", f"{behind} turned", cursor)

    def integer(self, cursor, children, parent):
        match = INTEGER.match(self.of(cursor))
        if not match:
            return
        value = int(match[1], 16 if match[1][:2].lower() == "0x" else 8 if match[1][0] == "0" and len(match[1]) > 1 else 10)
        for new in sorted({value + 1, max(value - 1, 0), 0} - {value}):
            self.replace("constant", cursor, f"{new}{match[2]}", None, parent)

    def floating(self, cursor, children, parent):
        text = self.of(cursor)
        digits, suffix = FLOAT.match(text).groups()
        self.replace("constant", cursor, f"({text} + 1)", None, parent)
        if (float.fromhex if digits.startswith("0x") else float)(digits):
            self.replace("constant", cursor, f"0.0{suffix}", None, parent)

    def condition(self, cursor, children, parent):
        found = children[-1] if cursor.kind == K.DO_STMT else children[0]
        if self.in_macro(found):
            return
        if found.kind == K.BINARY_OPERATOR:
            inside = list(found.get_children())
            if len(inside) == 2 and self.operator_between(*inside)[0] in COMPARISON:
                return  # its opposite is there
        if found.kind == K.UNARY_OPERATOR and self.of(found).startswith("!"):
            return
        self.replace("condition", found, f"!({self.of(found)})", f"negated `{short(self.of(found), 60)}`")

    def returned(self, cursor, children, parent):
        if not children:
            return
        value = children[0]
        text, shown = self.of(value), short(self.of(cursor), 60)
        kind = kind_of(value)
        name = value.type.get_canonical().spelling
        if name.endswith("sf_status"):
            if not text.startswith("sf_ok("):
                self.replace("return", value, f"(void)({text}), sf_ok()", f"without its error: `{shown}`")
        elif self.in_macro(value) or value.kind in (K.INTEGER_LITERAL, K.FLOATING_LITERAL):
            return
        elif kind == T.BOOL:
            self.replace("return", value, f"!({text})", f"negated: `{shown}`")
        elif kind == T.POINTER:
            self.replace("return", value, "0", f"NULL: `{shown}`")
        elif T.CHAR_U.value <= kind.value <= T.LONGDOUBLE.value:
            self.replace("return", value, f"({text}) + 1", f"one more: `{shown}`")


METHODS = {} if cindex is None else {
    K.BINARY_OPERATOR: File.binary, K.COMPOUND_ASSIGNMENT_OPERATOR: File.compound, K.UNARY_OPERATOR: File.unary,
    K.INTEGER_LITERAL: File.integer, K.FLOATING_LITERAL: File.floating, K.IF_STMT: File.condition, K.WHILE_STMT: File.condition,
    K.DO_STMT: File.condition, K.CONDITIONAL_OPERATOR: File.condition, K.RETURN_STMT: File.returned}


def kind_of(cursor):
    return cursor.type.get_canonical().kind


def short(text, most):
    """On one line, at most so long."""
    text = " ".join(COMMENT.sub(" ", text).split())
    return text if len(text) <= most else text[:most - 3] + "..."


def arguments_of(command):
    """Of a compiler's command: what libclang needs, and where the compiler's own headers lie (omp.h)."""
    kept, words = [], iter(command)
    for word in words:
        if word in ("-I", "-isystem", "-D", "-iquote"):
            kept += [word, next(words)]
        elif re.match(r"-(I|isystem|D|std=|iquote)", word):
            kept.append(word)
    return kept


def mutants(path, arguments):
    """[(campaign.Mutant, Edit)] of a file in the order of its source; the number is `path what`."""
    edits = list(dict(((e.start, e.end, e.new), e) for e in File(path, arguments).edits).values())
    named = campaign.unique([campaign.Mutant(None, path, f"{path}:{e.first}", e.what) for e in edits])
    return [(m._replace(number=f"{path} {m.what}"), e) for m, e in zip(named, edits)]
