"""Resolving an anchor finds one statement, or raises an error that lists the candidates."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file

SOURCE = '''\
"""Doc."""
import os


class A:
    @property
    def width(self): return self._width

    @width.setter
    def width(self, value):
        self._width = value

    async def run(self, x):
        """Run it."""
        a = b = await self.fetch(x)
        (c, self.d), *e = a
        self.total += len(a)
        f: int = 3
        g: int
        for i in range(3):
            a = i
        with open(x) as h:
            pass
        if a: b = 1
        u = 1; v = 2
        print(max(u, v))
        def inner():
            a = 5
            return a
        if (w := u):
            return inner()
        return a


def empty():
    """Only this."""
'''


def parsed(text: str = SOURCE) -> ParsedFile:
    return parse_file("m.py", text.encode(), Path("root"))


def lines(kind: AnchorKind, name: str, function: str = "A.run", nth: int | None = None) -> tuple[int, int]:
    site = parsed().resolve_statement(
        FaultLocation(path="m.py", function=function, anchor=Anchor(kind=kind, name=name, nth=nth))
    )
    return site.first_line + 1, site.end_line


@pytest.mark.parametrize(
    ("kind", "name", "nth", "line"),
    [
        (AnchorKind.AFTER_ASSIGN, "c", None, 16),
        (AnchorKind.AFTER_ASSIGN, "self.d", None, 16),
        (AnchorKind.AFTER_ASSIGN, "e", None, 16),
        (AnchorKind.BEFORE_ASSIGN, "self.total", None, 17),
        (AnchorKind.AFTER_ASSIGN, "f", None, 18),
        (AnchorKind.AFTER_ASSIGN, "a", 1, 15),
        (AnchorKind.AFTER_ASSIGN, "a", 2, 21),
        (AnchorKind.AFTER_ASSIGN, "v", None, 25),
        (AnchorKind.BEFORE_ASSIGN, "u", None, 25),
        (AnchorKind.AFTER_CALL, "self.fetch", None, 15),
        (AnchorKind.BEFORE_CALL, "print", None, 26),
        (AnchorKind.BEFORE_CALL, "inner", None, 31),
        (AnchorKind.BEFORE_RETURN, "inner", None, 31),
        (AnchorKind.BEFORE_RETURN, "a", None, 32),
        (AnchorKind.BEFORE_RETURN, "", 2, 32),
    ],
)
def test_anchors_find_statements_of_every_form(
    kind: AnchorKind, name: str, nth: int | None, line: int
) -> None:
    assert lines(kind, name, nth=nth) == (line, line)


@pytest.mark.parametrize(
    ("targets", "named"),
    [
        ("a[i], i", ["i"]),
        ("i, a[i]", ["i", "a[i]"]),
        ("self.x[self.i], self.i", ["self.i"]),
        ("a[0], b, a", ["b", "a"]),
        ("a['i'], i, a[j]", ["a['i']", "i", "a[j]"]),
    ],
)
def test_an_item_whose_index_the_statement_changes_has_no_name(targets: str, named: list[str]) -> None:
    """After the statement, the index's earlier value is unknown."""
    for source in (
        f"def f(self):\n    {targets} = g()\n",
        f"def f(self):\n    for {targets} in g():\n        h()\n",
    ):
        (function,) = parsed(source).functions_by_name["f"]
        assert [name for one in function.statements for name in one.assigned_names] == named


def test_the_head_of_a_block_is_the_last_candidate() -> None:
    """Anchors written before heads were candidates therefore keep their statements."""
    source = "def f(xs):\n    for x in xs:\n        pass\n    x = 1\n"
    source += "    with xs as y:\n        y = 2\n        y = 3\n"

    def line(name: str, nth: int | None = None) -> int:
        anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name=name, nth=nth)
        return (
            parsed(source).resolve_statement(FaultLocation(path="m.py", function="f", anchor=anchor)).end_line
        )

    assert (line("x"), line("x", 1), line("x", 2)) == (4, 4, 2)
    assert (line("y", 1), line("y", 2), line("y", 3)) == (6, 7, 5)


def test_a_function_is_found_by_its_qualified_name() -> None:
    assert lines(AnchorKind.AFTER_ASSIGN, "a", "A.run.inner") == (28, 28)
    assert lines(AnchorKind.AFTER_ASSIGN, "a", "A.run.<locals>.inner") == (28, 28)
    assert lines(AnchorKind.AFTER_ASSIGN, "self._width", "A.width") == (11, 11)


@pytest.mark.parametrize(
    ("kind", "name", "function", "nth", "pieces"),
    [
        (
            AnchorKind.AFTER_ASSIGN, "x", "A.run", None,
            ["m.py:13: no assignment to 'x' in A.run", "'a' (line 15)", "'self.d' (line 16)"],
        ),
        (
            AnchorKind.AFTER_ASSIGN, "a", "A.run", None,
            ["m.py:15: assignment to 'a' matches 2 statements", "lines 15, 21", "give `nth`, a number"],
        ),
        (AnchorKind.AFTER_ASSIGN, "a", "A.run", 3, ["`nth` is 3: give a number from 1 to 2"]),
        (AnchorKind.AFTER_ASSIGN, "g", "A.run", None, ["no assignment to 'g'"]),
        (AnchorKind.BEFORE_ASSIGN, "i", "A.run", None, ["m.py:20:", "is the head of a block"]),
        (AnchorKind.BEFORE_ASSIGN, "h", "A.run", None, ["m.py:22:", "is the head of a block"]),
        (AnchorKind.AFTER_ASSIGN, "w", "A.run", None, ["it is bound by `:=` inside an expression"]),
        (AnchorKind.BEFORE_CALL, "max", "A.run", None, ["m.py:26:", "the call is part of an expression"]),
        (AnchorKind.BEFORE_CALL, "nothing", "A.run", None, ["no call of 'nothing'", "'print' (line 26)"]),
        (AnchorKind.BEFORE_RETURN, "", "A.run", None, ["return matches 2 statements", "lines 31, 32"]),
        (AnchorKind.AFTER_CALL, "inner", "A.run", None, ["m.py:31:", "returns, so nothing after it runs"]),
        (AnchorKind.AFTER_ASSIGN, "u", "A.run", None, ["m.py:25:", "its line with statements after it"]),
        (AnchorKind.BEFORE_ASSIGN, "v", "A.run", None, ["shares its line with statements before it"]),
        (AnchorKind.AFTER_ASSIGN, "b", "A.run", 2, ["m.py:24:", "is on the line of its `if`"]),
        (AnchorKind.BEFORE_RETURN, "self._width", "A.width", None, ["m.py:7:", "`if`, `for` or `def`"]),
        (AnchorKind.AFTER_ASSIGN, "a", "A.runn", None, ["no function 'A.runn'", "A.run,", "mean 'A.run'"]),
        (AnchorKind.ENTRY, "", "A.width", None, ["2 functions named", "line 7, line 10", "from 1 to 2"]),
        (AnchorKind.ENTRY, "", "A.width", 1, ["nothing can be inserted at the entry"]),
        (AnchorKind.BEFORE_CALL, "x", "empty", None, ["another kind of anchor: there is none"]),
    ],
)  # fmt: skip
def test_an_anchor_with_no_match_or_several_is_an_error(
    kind: AnchorKind, name: str, function: str, nth: int | None, pieces: list[str]
) -> None:
    with pytest.raises(MutatorError) as caught:
        lines(kind, name, function, nth)
    for piece in pieces:
        assert piece in str(caught.value)


def test_the_entry_of_a_function_is_below_its_docstring() -> None:
    assert lines(AnchorKind.ENTRY, "") == (15, 14)
    assert lines(AnchorKind.ENTRY, "", "empty") == (37, 36)
    assert lines(AnchorKind.ENTRY, "", "A.width", 2) == (11, 10)


@pytest.mark.parametrize(
    ("source", "line"),
    [
        ('"""Doc."""\nfrom __future__ import annotations\nimport os\n', 3),
        ("#!/usr/bin/env python\n# coding: utf-8\n\nimport os\n", 4),
        ('"""Doc."""\n\n\ndef f():\n    pass\n', 2),
        ("# a comment\n@deco\n@other(1)\ndef f():\n    pass\n", 2),
        ('"""Two\nlines."""; from __future__ import division\nx = 1\n', 3),
        ("from __future__ import (\n    annotations,\n)\nx = 1\n", 4),
        ("x = 1\n", 1),
        ("", 1),
    ],
)
def test_the_probe_is_imported_below_the_head_of_the_file(source: str, line: int) -> None:
    assert parsed(source).import_insertion_line_index + 1 == line


@pytest.mark.parametrize(
    ("source", "piece"),
    [
        (b"def f(:\n    pass\n", "m.py:1: not valid Python"),
        (b"# coding: latin-9x\nx = 1\n", "unknown encoding"),
        (b"x = '\xff'\n", "not valid Python"),
        (b"x = 1\ry = 2\r", "a line ends in CR alone"),
        (b"import os\nfrom p import _fi\n", "m.py:2: the target uses the name `_fi`"),
        (b"import os\n\nx = 1  # fi:ab12\n", "m.py:3: the line ends in a `# fi:` tag"),
        (b"x = '''\n# fi:ab12\n'''\n", "m.py:2: the line ends in a `# fi:` tag"),
    ],
)
def test_an_invalid_or_already_injected_file_is_refused(source: bytes, piece: str) -> None:
    with pytest.raises(MutatorError) as caught:
        parse_file("m.py", source, Path("root"))
    assert piece in str(caught.value)


@pytest.mark.parametrize(
    "source",
    [
        "_fi = 1",
        "import _fi.a",
        "import a as _fi",
        "def f(a, *_fi): pass",
        "def f():\n    global _fi",
        "class A:\n    _fi = 1",
        "def _fi(): pass",
        "x = [_fi for _fi in a]",
        "try: pass\nexcept E as _fi: pass",
        "match a:\n    case {**_fi}: pass",
        "del _fi",
        "x = lambda: _fi",
        "_\ufb01 = 1",
    ],
)
def test_a_variable_with_the_name_of_the_probe_is_refused(source: str) -> None:
    """The compiler spells the letter U+FB01 as `fi`."""
    with pytest.raises(MutatorError, match=r"m\.py:\d: the target uses the name `_fi`;"):
        parse_file("m.py", source.encode(), Path("root"))


@pytest.mark.parametrize(
    "source",
    [
        "a._fi = a._fi",
        "x = '_fi'  # not _fi",
        "import a._fi",
        "f(_fi=1)",
        "class _:\n    __fi = 1",
        "_fir = 1",
    ],
)
def test_a_name_that_is_no_variable_may_be_that_of_the_probe(source: str) -> None:
    assert parse_file("m.py", source.encode(), Path("root"))
