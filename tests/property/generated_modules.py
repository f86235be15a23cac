"""Generated modules of every shape that Python allows, which terminate and trace what they do. They need the
names that `behaviour` provides, such as `T`, which records and returns a value, and `call`."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

from .generated_statements import COMMENTS, GLOBALS, Scope, StatementWriter

MOST_STATEMENTS = 30  # after this number, only simple statements are written
_UNITS = ("    ", "    ", "    ", "  ", " ", "\t", "  \t", "        ")
_VARIABLES = ("a", "b", "total", "größe", "µ", "ﬁx", "match", "case", "type", "_", "__own", "max")
_PLAIN = ('"""Doc."""', "'''Two\n    lines.\n'''", '"a" "b"', r'r"""Raw \."""')
_DOCSTRINGS = (
    *_PLAIN,
    'f"no {1} doc"',
    "b'no doc'",
    "('doc')",
    '"doc";',
    '"doc"; a = 1',
    '"doc" \\\n',
    '"doc"; \\\n',
    '"""\ndef f():\n    x = 1"""  # doc',
    '"a" f"b"',
    '"a" \\\n  "b"',
)
_ENCODINGS = {
    "utf-8": 70,
    "bom": 8,
    "latin-1": 6,
    "cp1252": 4,
    "shift_jis": 4,
    "UTF_8": 4,
    "no-such-one": 0.3,
}
_LINE_ENDS = {"\n": 76, "\r\n": 16, "mixed": 7, "\r": 0.4}
_Maker = Callable[[Scope, str], list[str]]


class ModuleWriter(StatementWriter):
    """Writes one module: the same bytes for the same seed and Python version."""

    def module(self) -> bytes:
        encoding = self._drawn(_ENCODINGS)
        lines = self._head(encoding)
        scope = Scope(level=0, kind="module", known=[*GLOBALS], pool=("m0", "m1"))
        lines += [f"{name} = {i}" for i, name in enumerate(GLOBALS)]
        callees: list[str] = []
        for _ in range(self.rng.randint(1, 3)):
            make = self.rng.choice([self.function, self.function, self.class_, self.condition])
            lines += [*self.gap(""), *make(scope, "")]
            callees = [f"call({name}, {self.number()})" for name in _top_level(lines)]
        lines += callees
        ends = [[], [""], ["# the end"], ["\x0c"], ["if G0: pass"], ["", "  "]]
        lines += self.rng.choices(ends, [40, 20, 15, 5, 15, 0.5])[0]
        return self._bytes("\n".join(lines) + ("\n" if self.chance(0.75) else ""), encoding)

    def _drawn(self, ways: dict[str, float]) -> str:
        return self.rng.choices(list(ways), list(ways.values()))[0]

    def _head(self, encoding: str) -> list[str]:
        lines = self.rng.choice([[], [], ["#!/usr/bin/env python"], ["# head", ""], ["", ""]])
        if encoding not in ("utf-8", "bom"):
            cookie = self.rng.choice(["# -*- coding: {} -*-", "# vim: set fileencoding={} :"])
            lines = [*lines[:1], cookie.format(encoding)]
        if encoding == "bom" and self.chance(0.5):
            lines = ["# head"]
        if self.chance(0.4):
            lines += [self.rng.choice(_PLAIN), *self.gap("")]
        if self.chance(0.2):
            plain = "from __future__ import annotations"
            lines.append(
                self.rng.choice(
                    [
                        plain,
                        plain + "; import os",
                        plain + " \\\n",
                        "from __future__ import (\n  division,\n)",
                    ]
                )
            )
        return lines

    def _bytes(self, text: str, encoding: str) -> bytes:
        way = self._drawn(_LINE_ENDS)
        if way == "mixed":
            text = "".join("\r\n" if c == "\n" and self.chance(0.5) else c for c in text)
        else:
            text = text.replace("\n", way)
        if encoding == "bom":
            return b"\xef\xbb\xbf" + text.encode()
        if encoding in ("latin-1", "cp1252", "shift_jis"):
            return b"".join(c.encode(encoding, "ignore") or b"x" for c in text)
        return text.encode()

    # Blocks

    def block(self, scope: Scope, indent: str) -> list[str]:
        inner = indent + self.rng.choice(_UNITS)
        lines: list[str] = []
        for _ in range(self.rng.randint(1, 3)):
            lines += [*self.gap(inner), *self.statement(scope, inner)]
        return lines + (self.gap(inner) if self.chance(0.1) else [])

    def statement(self, scope: Scope, indent: str) -> list[str]:
        simple: dict[_Maker, int] = {
            self.assignment: 10,
            self.call: 6,
            self.semicolons: 2,
            self.comment: 2,
            self.small: 2,
            self.returning: 2,
        }
        compound: dict[_Maker, int] = {
            self.condition: 3,
            self.loop: 2,
            self.trying: 2,
            self.managed: 2,
            self.matching: 2,
            self.function: 2,
            self.class_: 1,
            self.one_line_suite: 2,
        }
        scope.made[0] += 1
        deep = len(indent.expandtabs(4)) > 24 or scope.level > 2 or scope.made[0] > MOST_STATEMENTS
        ways = simple if deep else simple | compound
        lines = self.rng.choices(list(ways), list(ways.values()))[0](scope, indent)
        return [("\x0c" if self.chance(0.0003) else "") + lines[0], *lines[1:]]

    def one_line_suite(self, scope: Scope, indent: str) -> list[str]:
        inside = scope.inside()
        parts = "; ".join(
            self.rng.choice([f"{self.target(inside)} = 1", self.traced("2"), "pass"]) for _ in "ab"
        )
        heads = [f"if {self.expression(scope)}:", "for i in range(2):", "with context():", "if G0: \\\n "]
        head = self.rng.choice(heads)
        other = [f"{indent}else: {self.traced('3')}"] if head != heads[2] and self.chance(0.3) else []
        return [f"{indent}{head} {parts}", *other]

    def condition(self, scope: Scope, indent: str) -> list[str]:
        comment = self.rng.choice(["", "  # if so"])
        lines = [f"{indent}if {self.expression(scope)}:{comment}", *self.block(scope.inside(), indent)]
        if self.chance(0.3):
            lines += [f"{indent}elif {self.expression(scope)}:", *self.block(scope.inside(), indent)]
        if self.chance(0.4):
            lines += [*self.gap(indent), f"{indent}else:", *self.block(scope.inside(), indent)]
        return lines

    def loop(self, scope: Scope, indent: str) -> list[str]:
        inside = scope.inside(loop=True)
        one, other = self.target(inside), self.target(inside)
        heads = [
            f"for {one} in range({self.rng.randint(0, 3)}):",
            f"for {one}, {other} in [(1, 2),\n (3, 4)]:",
            f"while {self.traced(self.expression(scope))}:",
        ]
        if scope.is_async:
            heads += [f"async for {one} in later.each(2):"] * 2
        head = self.rng.choice(heads)
        if head is heads[2]:
            inside = scope.inside(loop=True)
        other_block = [f"{indent}else:", *self.block(scope.inside(), indent)] if self.chance(0.2) else []
        return [indent + head, *self.block(inside, indent), *other_block]

    def trying(self, scope: Scope, indent: str) -> list[str]:
        lines = [f"{indent}try:", *self.block(scope.inside(), indent)]
        if self.chance(0.3):
            return [*lines, f"{indent}finally:", *self.block(scope.inside(), indent)]
        star = "*" if self.chance(0.3) else ""
        kinds = self.rng.choice(["ValueError", "(ValueError,\n TypeError)", "Exception"])
        name = self.rng.choice(scope.pool)
        lines += [*self.gap(indent), f"{indent}except{star} {kinds} as {name}:"]
        if star:  # `except*` allows no `break`, `continue` or `return`
            inner = indent + self.rng.choice(_UNITS)
            lines += [*self.assignment(scope.inside(), inner), *self.call(scope, inner)]
        else:
            lines += self.block(scope.inside(), indent)
        if self.chance(0.3):
            lines += [f"{indent}else:", *self.block(scope.inside(), indent)]
        if name in scope.known and name in scope.pool:
            scope.known.remove(name)
        return lines

    def managed(self, scope: Scope, indent: str) -> list[str]:
        name = self.target(scope)
        heads = [
            f"with context() as {name}:",
            f"with context(), \\\n context() as {name}:",
            f"with (context() as {name},\n  context(),  # two\n):",
            "with context():  # one",
        ]
        if scope.is_async:
            heads.append(f"async with context() as {name}:")
        return [indent + self.rng.choice(heads), *self.block(scope.inside(), indent)]

    def matching(self, scope: Scope, indent: str) -> list[str]:
        inner = indent + self.rng.choice(_UNITS)
        rest = self.fresh("rest")
        patterns = ["1", "2 | 3", f"int({self.rng.choice(scope.pool)})", f"[1, *{rest}]", "Box(n=1)"]
        patterns += [f"{{'k': 1, **{rest}}}", f"{self.fresh('got')} if {self.expression(scope)}"]
        lines = [f"{indent}match {self.expression(scope)}:"]
        for pattern in self.rng.sample(patterns, 2):
            lines += [*self.gap(inner), f"{inner}case {pattern}:", *self.block(scope.inside(), inner)]
        if self.chance(0.3):
            lines.append(f"{inner}case _: {self.traced('1')}")
        return lines

    # Functions and classes

    def function(self, scope: Scope, indent: str) -> list[str]:
        method = scope.kind == "class"
        name = self.fresh("__m" if method and self.chance(0.2) else "größe" if self.chance(0.1) else "f")
        head = f"{'async ' if self.chance(0.2) else ''}def {name}"
        if self.chance(0.06):
            lines = [f"{indent}{head}({self._parameters(method)}): return T(0, 1)"]
        else:
            comment = self.rng.choice(["", "  # go", " "])
            head = f"{head}{self._type_parameters()}({self._parameters(method)}){self._result()}:{comment}"
            lines = [*self._decorators(indent), indent + head, *self._body(scope, head, indent)]
        if scope.kind == "function":
            lines.append(f"{indent}call({name}, {self.number()})")
        return lines

    def _decorators(self, indent: str) -> list[str]:
        ways = ["@deco", "@deco.some(1)", "@deco.some(\n 1,\n)", "@(deco)  # why", "@(lambda f: deco(f))"]
        return [indent + self.rng.choice(ways), *self.gap(indent)] if self.chance(0.25) else []

    def _type_parameters(self) -> str:
        known = sys.version_info >= (3, 12) and self.chance(0.2)
        return self.rng.choice(["[K]", "[K: int, *Ks]", "[\n**P]"]) if known else ""

    def _parameters(self, method: bool) -> str:
        ways = ["x=1", "x: int = 2", "x=T(0, 3), *args", "x=1, /, *, y=2, **more", "\n  x=1,  # one\n"]
        return ("self, " if method else "") + self.rng.choice([*ways, "x=(lambda: 1)()"])

    def _result(self) -> str:
        return self.rng.choices(["", " -> int", " -> \\\n  'int'"], [85, 10, 5])[0]

    def _body(self, outer: Scope, head: str, indent: str) -> list[str]:
        inner = indent + self.rng.choice(_UNITS)
        pool = self._variables(outer.level + 1)
        declaration, writable = self._declaration(outer, pool)
        scope = Scope(
            level=outer.level + 1,
            kind="function",
            known=["x", *GLOBALS, *(outer.known if outer.kind == "function" else ())],
            pool=pool,
            writable=writable,
            is_async=head.startswith("async"),
            generator=self.chance(0.12),
            made=outer.made,
        )
        lines = self.gap(inner)
        if self.chance(0.35):
            lines += [inner + self.rng.choice(_DOCSTRINGS), *self.gap(inner)]
        lines += [inner + text for text in declaration]
        if self.chance(0.85):
            lines.append(f"{inner}box = Box()")
        if self.chance(0.05):
            return [*lines, f"{inner}pass", inner + self.rng.choice(COMMENTS)]
        for _ in range(self.rng.randint(1, 5)):
            lines += [*self.gap(inner), *self.statement(scope, inner)]
        return lines

    def _variables(self, level: int) -> list[str]:
        """Return variable names, which differ in inner functions, except for private ones."""
        names = self.rng.sample(_VARIABLES, 4)
        return [name if level == 1 or name[0] == "_" else f"{name}{level}" for name in names]

    def _declaration(self, outer: Scope, pool: Sequence[str]) -> tuple[list[str], tuple[str, ...]]:
        """Return a `global` or `nonlocal` statement, if any, and the names that it makes writable."""
        if self.chance(0.75):
            return [], ()
        own = [n for n in outer.pool if n in outer.known and n not in (*outer.writable, *pool)]
        if outer.kind == "function" and own and self.chance(0.5):
            return [f"nonlocal {own[0]}"], (own[0],)
        return ["global G0" + self.rng.choice(["", ", G9"])], ("G0",)

    def class_(self, scope: Scope, indent: str) -> list[str]:
        name = self.fresh("_C" if self.chance(0.3) else "C")
        inner = indent + self.rng.choice(_UNITS)
        body = replace(
            scope, kind="class", known=[*GLOBALS], pool=("c0", "c1", "__c"), writable=(), loop=False
        )
        body = replace(body, is_async=False, generator=False)
        base = self.rng.choice(["", "(Box)", "(Box,\n)"])
        lines = [*self._decorators(indent), f"{indent}class {name}{base}:"]
        if self.chance(0.3):
            lines.append(inner + self.rng.choice(_PLAIN))
        lines += [f"{inner}box = Box()", *self.assignment(body, inner)]
        for _ in range(self.rng.randint(1, 2)):
            lines += [*self.gap(inner), *self.function(body, inner)]
        return [*lines, *([f"{indent}call({name})"] if scope.kind == "function" else [])]


def _top_level(lines: Sequence[str]) -> list[str]:
    names = []
    for line in lines:
        words = line.replace("(", " ").replace("[", " ").replace(":", " ").split(" ")
        if words[0] in ("def", "class"):
            names.append(words[1])
        elif words[:2] == ["async", "def"]:
            names.append(words[2])
    return names
