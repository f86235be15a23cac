"""Expressions that anchors can name, and how a mutant changes their values."""

import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import VALUE_ANCHORS, Anchor, AnchorKind, FaultLocation
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, expression_edit, mutated_bytes, unsplice

SOURCE = '''\
LIMIT = 3


class Control:
    gain = 2

    def update(self, gap, *rest, low=0):
        if gap < low: return None
        self.gap, other = gap, -1
        command["gas"] = self.pid.update(gap - LIMIT, speed=rest[0])
        while (n := len(rest)) and not self.done():
            total = [x * 2 for x in rest if x > 0]
        assert other, f"{gap} is wrong"
        text = """
        long""" + str(low)
        value = 1 + \\
            2
        return (gap,
                low)

    def inner(self):
        def deeper(a):
            return a, 1
        return deeper
'''


def parsed(source: str = SOURCE) -> ParsedFile:
    return parse_file("m.py", source.encode(), Path())


def location(
    kind: str, name: str, nth: int | None = None, which: str | None = None, function: str = "Control.update"
) -> FaultLocation:
    anchor = Anchor(kind=AnchorKind(kind), name=name, nth=nth, which=which)
    return FaultLocation(path="m.py", function=function, anchor=anchor)


def changed(source: str, *changes: tuple[FaultLocation, str]) -> str:
    file = parsed(source)
    edits = [
        expression_edit(file, file.resolve_expression(place), text, f"a{number}")
        for number, (place, text) in enumerate(changes)
    ]
    data = mutated_bytes(apply_edits(file, as_line_edits(file, edits)))
    assert unsplice(data) == file.data
    return data.decode()


def test_every_value_has_a_name_for_each_role() -> None:
    """Exceptions are names of objects whose members are used, values inside strings, and values that begin or
    end on a line that cannot get a tag."""
    named = {
        kind: [
            (name, which) if which else name
            for one in parsed().expressions_by_function["Control.update"]
            for own, name, which in one.roles
            if own is kind
        ]
        for kind in VALUE_ANCHORS
    }
    assert named[AnchorKind.CONDITION] == [
        "gap < low",
        "(n := len(rest)) and (not self.done())",
        "x > 0",
        "other",
    ]
    assert named[AnchorKind.RETURN_VALUE] == ["None", "(gap, low)"]
    assert named[AnchorKind.ASSIGNED_VALUE] == ["(self.gap, other)", "command['gas']", "n", "total"]
    assert named[AnchorKind.ARGUMENT] == [
        ("self.pid.update", "1"),
        ("self.pid.update", "speed"),
        ("len", "1"),
        ("str", "1"),
    ]
    assert named[AnchorKind.RESULT] == ["self.pid.update", "len", "self.done", "str"]
    values = named[AnchorKind.VALUE]
    assert {"LIMIT", "rest[0]", "gap - LIMIT", "-1", "x * 2", "0", "None", "(gap, low)"} <= set(values)
    assert not {"self", "self.pid", "command", "1", "n := len(rest)", "1 + 2", "f'{gap} is wrong'"} & set(
        values
    )


def places_of_strings(prefix: str) -> list[object]:
    """The places of a function whose formatted strings have this prefix."""
    file = parsed(
        f"""def f(x):
    y = g({prefix}'{{x + 1}} {{h(x)!r:>{{x}}}}')
    z = {prefix}'''
    {{x}}''' + str(x)
    return y, {prefix}'{{y}}'
"""
    )
    statements = [
        s.has_multiline_string for function in file.functions_by_name["f"] for s in function.statements
    ]
    return [*statements, *((e.start, e.end, len(e.roles)) for e in file.expressions_by_function["f"])]


@pytest.mark.skipif(sys.version_info < (3, 14), reason="t-strings need Python 3.14")
def test_a_t_string_is_a_place_as_an_f_string_is() -> None:
    """It can be replaced as a whole; the values inside it are no places."""
    assert places_of_strings("t") == places_of_strings("f")


@pytest.mark.parametrize(
    ("place", "line"),
    [
        (location("condition", "gap<low"), 8),
        (location("condition", "", nth=3), 12),
        (location("return_value", "None"), 8),
        (location("assigned_value", 'command["gas"]'), 10),
        (location("argument", "self.pid.update", which="speed"), 10),
        (location("argument", "self.pid.update", which="1"), 10),
        (location("result", "self.done"), 11),
        (location("value", "x*2"), 12),
        (location("return_value", "", function="Control.inner.<locals>.deeper"), 23),
    ],
)
def test_an_anchor_matches_regardless_of_spaces_and_quotes(place: FaultLocation, line: int) -> None:
    assert parsed().line_span(place)[0] + 1 == line


@pytest.mark.parametrize(
    ("place", "pieces"),
    [
        (location("value", "gap"), ["m.py:8:", "`value: gap` names", "give `nth`, a number from 1 to"]),
        (location("value", "gap", nth=9), ["`nth` is 9"]),
        (location("condition", "gap > low"), ["no `condition: gap > low`", "`gap < low` (line 8)"]),
        (
            location("argument", "len", which="2"),
            ["no `argument: len` with `which: 2`", "`len` with `which: 1` (line 11)"],
        ),
        (location("argument", "self.pid.update"), ["names 2 expressions"]),
        (location("value", "1 + 2"), ["no `value: 1 + 2`", "exactly as in the source"]),
        (
            location("condition", "", function="Control.inner"),
            ["another kind of anchor: there is none"],
        ),
        (location("value", "a", function="deeper"), ["no function 'deeper'"]),
    ],
)
def test_an_anchor_with_no_match_or_several_is_an_error(place: FaultLocation, pieces: Iterable[str]) -> None:
    with pytest.raises(MutatorError) as caught:
        parsed().resolve_expression(place)
    assert all(piece in str(caught.value) for piece in pieces), str(caught.value)


def test_a_changed_expression_stays_in_its_place() -> None:
    source = "def f(a, b):  # go\r\n    c = a, b\r\n    return g(a,  # first\r\n        b) + c  # sum\r\n"
    at = {"function": "f"}
    assert changed(source, (location("assigned_value", "c", **at), "None")) == source.replace(
        "c = a, b\r\n", 'c = (None if _fi.active("a0") else (a, b))  # fi:a0 was:    c = a, b\r\n'
    )
    both = changed(
        source,
        (location("result", "g", **at), "0"),
        (location("value", "c", **at), "-c"),
    ).split("\r\n")
    assert both[2:4] == [
        '    return (0 if _fi.active("a0") else g(a,  # first  # fi:a0 was:    return g(a,  # first',
        '        b)) + (-c if _fi.active("a1") else c)  # sum  # fi:a0+a1 was:        b) + c  # sum',
    ]


@pytest.mark.parametrize(
    ("value", "kept"),
    [
        ("(a), b", "((a), b)"),
        ("(a), (b)", "((a), (b))"),
        ("(a, b)", "(a, b)"),
        ("((a), b)", "((a), b)"),
        ("()", "()"),
        ("a,", "(a,)"),
        ("(a, b), a", "((a, b), a)"),
        ("g(a)[0], (b)", "(g(a)[0], (b))"),
    ],
)
def test_a_tuple_is_changed_as_a_whole(value: str, kept: str) -> None:
    place = location("return_value", "", function="f")
    line = changed(f"def f(a, b):\n    return {value}\n", (place, "0")).splitlines()[1]
    assert line == f'    return (0 if _fi.active("a0") else {kept})  # fi:a0 was:    return {value}'
    several = changed("def f(a, b):\n    return g(a,\n        1), b\n", (place, "0"))
    assert ["else (g(a," in several, "1), b))" in several] == [True, True]
    index = location("value", "(a, b)", function="f")
    assert 'c[(0 if _fi.active("a0") else ((a), b))]' in changed(
        "def f(a, b):\n    return c[(a), b]\n", (index, "0")
    )


def test_a_huge_number_has_no_anchor() -> None:
    """Python refuses to convert a number with thousands of digits to text."""
    source = f"def f(a):\n    b = g(0x{'f' * 5000})\n    return a\n"
    assert 'return (0 if _fi.active("a0") else a)' in changed(
        source, (location("return_value", "a", function="f"), "0")
    )
    assert [one.anchor_name for one in parsed(source).expressions_by_function["f"]] == ["a"]


def test_two_injections_into_one_expression_are_refused() -> None:
    """The effects of the injections could not be separated."""
    with pytest.raises(MutatorError, match="two injections into one expression"):
        changed(SOURCE, (location("value", "gap - LIMIT"), "0"), (location("value", "LIMIT"), "0"))


def test_functions_with_the_same_name_have_separate_variables() -> None:
    source = "class A:\n    def x(self): return self.a\n    def x(self, value): return value + 1\n"
    file = parse_file("m.py", source.encode(), Path())
    first, second = (location("return_value", "", nth=nth, function="A.x") for nth in (1, 2))
    assert (file.names_used_in_function_at(first), file.names_used_in_function_at(second)) == (
        {"self"},
        {"self", "value"},
    )


def test_files_in_other_encodings_are_changed_at_the_right_column() -> None:
    source = '# coding: latin-1\ndef f(é):\n    return "ü" + é + 1\n'
    file = parse_file("m.py", source.encode("latin-1"), Path())
    place = location("value", "'ü' + é", function="f")
    edit = expression_edit(file, file.resolve_expression(place), "é", "a0")
    data = mutated_bytes(apply_edits(file, as_line_edits(file, [edit])))
    assert data.decode("latin-1").splitlines()[2] == (
        '    return (é if _fi.active("a0") else "ü" + é) + 1  # fi:a0 was:    return "ü" + é + 1'
    )
    assert unsplice(data) == file.data


def test_an_f_string_is_changed_as_a_whole() -> None:
    source = b'def f(x):\n    return g(f"{x:.2f} m", f"{x}" "b")\n'
    found = parse_file("m.py", source, Path()).expressions_by_function["f"]
    assert [one.anchor_name for one in found if one.anchor_name.startswith("f")] == [
        "f'{x:.2f} m'",
        "f'{x}b'",
    ]


def test_a_named_expression_as_a_condition_has_an_anchor() -> None:
    source = "def f(a):\n    while n := a.pop():\n        if (m := n + 1): return g(k := m)\n"
    places = [
        location("condition", "(n := a.pop())", function="f"),
        location("condition", "(m := n + 1)", function="f"),
        location("argument", "g", which="1", function="f"),
    ]
    written = [parsed(source).resolve_expression(place).one_line_source for place in places]
    assert written == ["(n := a.pop())", "(m := n + 1)", "(k := m)"]
    asked = [
        f'if _fi.active("a{number}") else ({text}))'
        for number, text in enumerate(("n := a.pop()", "m := n + 1", "k := m"))
    ]
    made = changed(source, *zip(places, ("not (n := a.pop())", "-(m := n + 1)", "3"), strict=True))
    code = [line.partition("  # fi:")[0].strip() for line in made.splitlines()]
    assert code == [
        "def f(a):",
        f"while (not (n := a.pop()) {asked[0]}:",
        f"if ((-(m := n + 1) {asked[1]}): return g((3 {asked[2]})",
    ]
    compile(made, "m.py", "exec")
