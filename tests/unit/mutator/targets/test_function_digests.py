"""Parts of source files: what counts as a change of a function, and of the code around functions."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from mutator.targets.function_digests import MODULE_PART, FilePart, part_name, parts_of_file
from mutator.targets.source_tree import read_tree

SOURCE = '''\
"""A controller."""

from math import inf

LIMIT = 1.0


@property
def plain(speed=LIMIT):
    """Return the speed."""
    return min(speed, inf)


class Control:
    gain = 2.0

    def update(self, error):
        def scaled(value):
            return value * self.gain

        return [scaled(e) for e in error]

    @property
    def state(self):
        return self._state

    @state.setter
    def state(self, value):
        self._state = value


double = lambda value: 2 * value

if LIMIT:
    def chosen():
        return 1
else:
    async def chosen():
        return 2
'''


def parts(tmp_path: Path, text: str) -> Mapping[str, FilePart]:
    (tmp_path / "car.py").write_text(text)
    return parts_of_file(read_tree(tmp_path, ["*.py"]), "car.py")


def changed_parts(tmp_path: Path, old: str, new: str) -> set[str]:
    assert SOURCE.count(old) == 1
    before, after = parts(tmp_path, SOURCE), parts(tmp_path, SOURCE.replace(old, new))
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


def test_each_named_function_is_a_part(tmp_path: Path) -> None:
    """Functions of functions belong to the outer ones; functions of the same name are one part."""
    assert parts(tmp_path, SOURCE).keys() == {
        MODULE_PART,
        "plain",
        "Control.update",
        "Control.state",
        "chosen",
    }


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ("LIMIT = 1.0", "# the limit\n\n\nLIMIT = (\n    1.0\n)", set()),
        ("return min(speed, inf)", "return min(  # of both\n        speed, inf)", set()),
        ("return min(speed, inf)", "return max(speed, inf)", {"plain"}),
        ('"""Return the speed."""', '"""Return it."""', {"plain"}),
        ("return value * self.gain", "return value + self.gain", {"Control.update"}),
        ("for e in error]", "for e in error if e]", {"Control.update"}),
        ("self._state = value", "self._state = -value", {"Control.state"}),
        ("return 2\n", "return 3\n", {"chosen"}),
        ("LIMIT = 1.0", "LIMIT = 1", {MODULE_PART}),
        ("gain = 2.0", "gain = -2.0", {MODULE_PART}),
        ("2 * value", "3 * value", {MODULE_PART}),
        ("(speed=LIMIT)", "(speed=2.0)", {MODULE_PART, "plain"}),
        ("@property\ndef plain", "def plain", {MODULE_PART, "plain"}),
        ("def update(self, error)", "def update(self, error, /)", {MODULE_PART, "Control.update"}),
        ("from math import inf", "from __future__ import annotations", {MODULE_PART}),
    ],
)
def test_a_change_is_a_change_of_its_part(tmp_path: Path, old: str, new: str, changed: set[str]) -> None:
    """Comments, layout and line numbers are no change; what runs when the file is imported is one part."""
    assert changed_parts(tmp_path, old, new) == changed


def test_a_new_function_changes_the_code_around_it(tmp_path: Path) -> None:
    """It is defined when the file is imported, and can replace another one."""
    assert changed_parts(tmp_path, "double = lambda", "def more(): pass\ndouble = lambda") == {
        MODULE_PART,
        "more",
    }


def test_code_without_a_name_of_its_own_belongs_to_the_module(tmp_path: Path) -> None:
    found = parts(tmp_path, SOURCE)
    names = ("Control.update", "Control", "<lambda>", "<module>")
    assert [part_name(found, name) for name in names] == ["Control.update", *[MODULE_PART] * 3]


def test_a_file_that_does_not_parse_is_one_part(tmp_path: Path) -> None:
    """Each of its bytes counts, because nobody knows what it does."""
    first, second = parts(tmp_path, "def ("), parts(tmp_path, "def  (")
    assert first.keys() == second.keys() == {MODULE_PART}
    assert first != second


@pytest.mark.parametrize("code", ["frame.f_lineno", "traceback.print_exc()", "f.__code__.co_positions()"])
def test_code_that_reads_line_numbers_is_marked(tmp_path: Path, code: str) -> None:
    found = parts(tmp_path, f"def f(): return {code}\ndef g(): return 'lines'\n")
    assert {name for name, part in found.items() if part.reads_lines} == {"f"}
