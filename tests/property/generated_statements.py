"""Random simple statements of every shape, the content of generated modules."""

import random
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

GLOBALS = ("G0", "G1", "G2")
COMMENTS = ("# note", "# if x:", "#", "# \\", "# größe", "#:", "# (", '# """')
_TEXTS = (
    "'plain'",
    r'r"\d"',
    "'''a\n  b'''",
    '"""def f():\n    return 1\n"""',
    "\"a\" 'b'",
    '"\\\n  x"',
    "'\x0c'",
    "'a\x0bb\x1cc'",
    '"""\n# fi\n\n\tx = 1\n"""',
    "('a'\n 'b')",
    r"rf'{1}\d'",
    "f'''{\n1\n}\n'''",
    'f"{1:>{5}}"',
    "u'x'",
)


@dataclass(frozen=True, kw_only=True)
class Scope:
    """The variables that a statement may read (`known`) and set, and what else is allowed at its place."""

    level: int  # how deeply functions are nested
    kind: str  # module, class, function, or nested: in a lambda or a comprehension
    known: list[str]
    pool: Sequence[str]  # the names that its variables can have
    writable: tuple[str, ...] = ()  # declared global or nonlocal
    is_async: bool = False
    generator: bool = False
    loop: bool = False
    made: list[int] = field(default_factory=lambda: [0])  # statements so far

    def inside(self, **changes: Any) -> "Scope":
        """Return the scope of a block that might be skipped: variables set there are not known afterwards."""
        return replace(self, known=[*self.known], **changes)


class StatementWriter:
    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.count = 0

    def chance(self, probability: float) -> bool:
        return self.rng.random() < probability

    def number(self) -> str:
        return self.rng.choice(["0", "1", "2", "3", "0x10", "1_0", "-1"])

    def fresh(self, prefix: str) -> str:
        self.count += 1
        return f"{prefix}{self.count}"

    def gap(self, indent: str) -> list[str]:
        ways: list[tuple[list[str], float]] = [
            ([], 60),
            ([""], 12),
            ([indent + self.rng.choice(COMMENTS)], 10),
            (["   # elsewhere"], 5),
            (["# at the margin"], 4),
            (["\x0c"], 4),
            (["", indent + "  ", ""], 5),
            ([indent + "\\"], 0.03),
        ]
        return self.rng.choices([way for way, _ in ways], [weight for _, weight in ways])[0]

    def tail(self) -> str:
        ways = ["", "  # why", ";", " ; # why", "  ", "\t", " \\\n", "; \\\n"]
        return self.rng.choices(ways, [70, 9, 5, 3, 5, 2, 2, 1])[0]

    # Expressions; the value is a number

    def expression(self, scope: Scope, depth: int = 2) -> str:
        if depth <= 0 or self.chance(0.3):
            return self.rng.choice([self.number(), self.number(), *self.rng.choices(scope.known, k=3)])
        e, f = (self.expression(scope, depth - 1) for _ in "ef")
        nested = self.expression(replace(scope, kind="nested", is_async=False, generator=False), depth - 1)
        name = self.rng.choice(["i", "a", "G1", "j"])
        ways = [
            self.traced(e),
            f"{e} + {f}",
            f"({e}\n   +  {f})",
            f"(  # odd\n{e} -\n\n {f}  # odd\n)",
            f"{e} - \\\n  {f}",
            f"abs({e})",
            f"len([{e},\n{f},])",
            f"(lambda {name}: {name} + {nested})({e})",
            f"sum([{name} for {name} in range({self.number()}) if {name} < 5])",
            f"sum({name} + {nested} for {name} in (1, {nested}))",
            f"len({self.rng.choice(_TEXTS)})",
            f'len(f"{{{self.traced(self.number())}!r:>4}}")',
            f"({e} if {f} else {self.number()})",
            f"Box(n={e}).n",
            f"len({{**{{{e}: {f}}}}})",
            f"[{e}, {f}][0]",
        ]
        if scope.kind == "function":
            ways.append(f"({self.rng.choice(scope.pool)} := {e})")
        if scope.is_async:
            ways += [f"await later({e})", f"sum([{name} async for {name} in later.each(2)])"]
        if scope.generator:
            ways.append(f"((yield {e}) or 0)")
        if sys.version_info >= (3, 12):
            ways.append(f'len(f"{{len("x" + f"{{{self.number()}}}")}}")')
        return self.rng.choice(ways)

    def traced(self, value: str) -> str:
        self.count += 1
        return f"T({self.count}, {value})"

    # Simple statements: lines at a depth

    def target(self, scope: Scope) -> str:
        name = self.rng.choice([*scope.pool, *scope.writable])
        if name not in scope.known:
            scope.known.append(name)
        return name

    def assignment(self, scope: Scope, indent: str) -> list[str]:
        value = self.traced(self.expression(scope))
        if self.chance(0.15):
            value = f"call({self.rng.choice(['abs', 'later', 'lambda x: x'])}, {value})"
        if scope.is_async and self.chance(0.1):
            value = f"await later({value})"
        own = [name for name in scope.known if name in (*scope.pool, *scope.writable)]
        one, other = self.target(scope), self.target(scope)
        ways = [
            f"{one} = {value}",
            f"{one}={other} = {value}",
            f"{one}, {other} = {value}, 1",
            f"({one}, *{other}), box.x = (1, 2), {value}",
            f"[{one}, {other}] = [{value},\n 2]",
            f"{one} = abs({value})",
            f"box.a.b = {value}",
            f"box['k'] = {value}",
            f"(box).c = \\\n{value}",
        ]
        if own:
            ways += [f"{self.rng.choice(own)} += {value}"] * 2
        if not scope.writable:
            ways += [f"{one}: int = {value}"] * 2
            if self.chance(0.001):
                ways = [f"({one}): int = {value}"]
        if scope.kind == "function" and self.chance(0.05):
            ways = ["unset: int"]
        return [f"{indent}{self.rng.choice(ways)}{self.tail()}"]

    def call(self, scope: Scope, indent: str) -> list[str]:
        value = self.expression(scope)
        ways = [
            self.traced(value),
            f"box.note({value})",
            f"box.a.note(\n{value},\n\n  )",
            f"({self.traced(value)})",
            f"print(*(), end='' if {value} else '')",
            f"box.note('''\n  {self.number()}''')",
            f"box.chain().note({value})",
        ]
        if scope.is_async:
            ways.append(f"await later({value})")
        return [f"{indent}{self.rng.choice(ways)}{self.tail()}"]

    def semicolons(self, scope: Scope, indent: str) -> list[str]:
        parts = [self.assignment(scope, "")[0], self.call(scope, "")[0], "pass"]
        parts = [p for p in parts if "#" not in p.rpartition("\n")[2] and not p.endswith(("\n", ";"))]
        self.rng.shuffle(parts)
        return [indent + self.rng.choice(["; ", ";", " ;\\\n  "]).join(parts)]

    def comment(self, scope: Scope, indent: str) -> list[str]:
        return [indent + self.rng.choice(COMMENTS), f"{indent}pass"]

    def small(self, scope: Scope, indent: str) -> list[str]:
        ways = ["pass", "...", '"text"', "import os.path as pathlib", self.expression(scope)]
        ways.append(f"assert [{self.expression(scope)}], 'no'")
        if scope.loop:
            ways += ["continue", "break"]
        own = [name for name in scope.known if name in scope.pool]
        if own and self.chance(0.2):
            gone = self.rng.choice(own)
            scope.known.remove(gone)
            ways = [f"del {gone}", f"del ({gone})"]
        return [f"{indent}{self.rng.choice(ways)}{self.tail()}"]

    def returning(self, scope: Scope, indent: str) -> list[str]:
        if scope.kind != "function" or self.chance(0.4):
            return self.call(scope, indent)
        value = self.expression(scope)
        ways = ["return", f"return {value}", f"return abs({value})", f"return (\n{value})", "return box.a.b"]
        ways += [f"return {name}" for name in scope.known[:2]]
        if scope.generator and scope.is_async:
            ways = ["return"]
        head = f"{indent}if {self.expression(scope)} == 2:{self.rng.choice(['', '  # so'])}"
        return [head, f"{indent}  {self.rng.choice(ways)}{self.tail()}"]
