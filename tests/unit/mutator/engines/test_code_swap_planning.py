"""The functions of a loaded program that a mutant changes, and the reasons for not swapping them."""

import re
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from mutator.engines.code_swap_planning import CodeSwap, plan_swap
from mutator.errors import MutantNotSwappable
from mutator.mutants.probe_contract import ProbeSource
from mutator.targets.source_tree import SourceTree

PROBE = ProbeSource(settings_parts=("",), code_parts=("def observe(): pass\n",), armed_after_s=0.0)
PRISTINE = """
import math
from functools import wraps

class Car:
    def __init__(self, speed):
        self.speed = speed

    def go(self, x):
        y = x * math.pi
        return [value + y for value in (1.0, 2.0)]

    def way(self):
        yield self.speed

def outer():
    def inner(x):
        y = x
        return y
    return inner

limit = 3.0
"""
Changes = Callable[..., CodeSwap]


@pytest.fixture
def changes() -> Changes:
    """Insert lines into PRISTINE before the line that contains a given text, and return the code swap."""

    def make(*inserted: tuple[str, str], reads_itself: tuple[str, ...] = ()) -> CodeSwap:
        text = "from car import _fi  # fi:probe\n" + PRISTINE
        for before, lines in inserted:
            (line,) = re.findall(rf"^.*{re.escape(before)}.*\n", text, re.MULTILINE)
            indent = line[: len(line) - len(line.lstrip())]
            new = "".join(f"{indent}{one}  # fi:abc\n" for one in lines.split("\n"))
            text = text.replace(line, new + line)
        tree = SourceTree(None, {"car/car.py": PRISTINE.encode()}, "", {})  # type: ignore[arg-type]
        manifest = SimpleNamespace(probe_package="car", globs_read_by_runs=reads_itself, tree=tree)
        return plan_swap(manifest, {"car/car.py": text.encode(), "car/_fi.py": b""}, PROBE, "/tree")  # type: ignore[arg-type]

    return make


GUARDED = 'if _fi.active("abc"):\n    y = y + 1.0'


def test_changed_functions_are_found(changes: Changes) -> None:
    found = changes(
        ("return [value", GUARDED), ("self.speed = speed", 'if not _fi.active("abc"):\n    speed = 0.0')
    )
    assert [(f.module, f.name_path) for f in found.functions] == [
        ("car.car", ("Car", "__init__")),
        ("car.car", ("Car", "go")),
    ]
    go = found.functions[1]
    assert (go.old_code.co_filename, go.new_code.co_filename) == ("/tree/car/car.py", "/tree/car/car.py")
    assert "_fi" in go.new_code.co_names and "_fi" not in go.old_code.co_names
    assert found.imported_modules == ()


def test_imports_of_injected_lines_are_listed(changes: Changes) -> None:
    lines = 'if _fi.active("abc"):\n    from car.rain import Rain\n    y = Rain(y)'
    assert changes(("return [value", lines)).imported_modules == ("car.rain",)


@pytest.mark.parametrize(
    ("before", "lines", "why"),
    [
        ("return [value", "y = y + 1.0", "does not ask the probe first"),
        ("return [value", 'if _fi.active("abc") or y:\n    y = 1.0', "does not ask the probe first"),
        ("return [value", GUARDED + "\nelse:\n    y = 2.0", "does not ask the probe first"),
        ("return [value", GUARDED + "\ny = 2.0", "does not ask the probe first"),
        ("yield self.speed", 'if _fi.active("abc"):\n    self.speed = 0.0', "may be suspended"),
        ("return y", GUARDED, "a function inside"),
        ("limit = 3.0", 'if _fi.active("abc"):\n    limit = 0.0', None),
    ],
)
def test_changes_that_cannot_be_swapped_are_refused_with_a_reason(
    changes: Changes, before: str, lines: str, why: str | None
) -> None:
    if why is None:
        assert changes((before, lines)).functions == ()
        return
    with pytest.raises(MutantNotSwappable, match=re.escape(why)):
        changes((before, lines))


@pytest.mark.parametrize(("kept", "swappable"), [(1, True), (0, False)])
def test_a_guard_must_keep_the_original_statement_in_its_else_branch(kept: int, swappable: bool) -> None:
    guarded = "".join(
        f"        {line}  # fi:abc guard:1\n" for line in ('if _fi.active("abc"):', "    y = x", "else:")
    )
    line = "        y = x * math.pi\n"
    added = "" if kept else "            y = 0.0  # fi:abc guard:1\n"
    text = "from car import _fi  # fi:probe\n" + PRISTINE.replace(line, f"{guarded}{added}    {line}")
    tree = SourceTree(None, {"car/car.py": PRISTINE.encode()}, "", {})  # type: ignore[arg-type]
    manifest = SimpleNamespace(probe_package="car", globs_read_by_runs=(), tree=tree)
    files = {"car/car.py": text.encode(), "car/_fi.py": b""}
    if swappable:
        assert [f.name_path for f in plan_swap(manifest, files, PROBE, "/tree").functions] == [("Car", "go")]  # type: ignore[arg-type]
        return
    with pytest.raises(MutantNotSwappable):
        plan_swap(manifest, files, PROBE, "/tree")  # type: ignore[arg-type]


def test_a_file_that_the_run_reads_itself_is_not_swapped(changes: Changes) -> None:
    with pytest.raises(MutantNotSwappable, match="read by the run itself"):
        changes(reads_itself=("car/*.py",))


def test_a_change_beyond_inserted_lines_is_not_swapped(changes: Changes) -> None:
    manifest = SimpleNamespace(
        probe_package="car",
        globs_read_by_runs=(),
        tree=SimpleNamespace(files={"car/car.py": b"x = 1\n"}),
    )
    with pytest.raises(MutantNotSwappable, match="more than inserted lines"):
        plan_swap(manifest, {"car/car.py": b"x = 2\n"}, PROBE, "/tree")  # type: ignore[arg-type]
    with pytest.raises(MutantNotSwappable, match="new file"):
        plan_swap(manifest, {"car/new.py": b"x = 2\n"}, PROBE, "/tree")  # type: ignore[arg-type]
