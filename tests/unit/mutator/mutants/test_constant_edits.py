"""Edits for faults in constants and defaults: the lines after which they stand, and refusals."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import FaultLocation, Injection
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.workspace import Workspace
from tests.unit.mutator.mutants.changed_constants import PLACES, SOURCE, at, mutant


def test_tagged_lines_follow_the_statement_that_sets_the_value(clone: Workspace) -> None:
    lines = mutant(clone, *dict.fromkeys(location for location, _ in PLACES.values())).decode().splitlines()
    tagged = [i for i, line in enumerate(lines) if "# fi:" in line][1:]
    assert [lines[i - 1].strip() for i in tagged if i - 1 not in tagged] == [
        "LIMIT = 5",
        "LOW = 2",
        "P = 1.0; I = 2.0",
        "return x + y",
        "def g(self, z=9): return z",
        "a: float = 1.0",
        "c: int = field(default=3, kw_only=True)",
        "d: int = 4",
        "e: float = 1.0",
        "_f: int = attrs.field(default=2, kw_only=True)",
        "h: float = 1.0",
        "k: float = 1.0",
        "l: float = 1.0",
        "m: float = 1.0",
        "n = 1.0",
        "p: float = 1.0",
        "q: float = 1.0",
        "return q",
    ]
    assert lines[7:9] == ["", "LIMIT = 5"]
    assert lines[9] == '_fi.constant("a", globals(), "LIMIT", lambda original: original + 10)  # fi:a'


@pytest.mark.parametrize(
    ("location", "words"),
    [
        (at("LIMITS"), "no constant 'LIMITS'; expected one of LIMIT, LOW, .*did you mean 'LIMIT'"),
        (at("q", "Gains.f"), "no default 'q' in Gains.f; expected one of x, y"),
        (at("self", "Gains.h"), "there is none of this kind"),
        (at("x", "Gains.gone"), "no function 'Gains.gone'"),
        (at("Field.b"), "m.py:32: the constant 'Field.b' cannot be set: the field has no default"),
        (at("Gear.DRIVE"), "its class derives from Enum"),
        (at("COUNT"), "a function also sets it"),
    ],
)
def test_an_unsuitable_value_is_refused(clone: Workspace, location: FaultLocation, words: str) -> None:
    with pytest.raises(MutatorError, match=words):
        mutant(clone, location)


def test_a_model_that_changes_no_value_is_refused(clone: Workspace) -> None:
    file = parse_file("m.py", SOURCE.encode(), Path("x"))
    for model, params in (("omission", ()), ("offset", (("by", 1.0), ("target", "LOW")))):
        with pytest.raises(MutatorError, match=r"cannot change the value|expected no variable"):
            injection_edit(
                file, clone.fault_models(), Injection(location=at("LIMIT"), model=model, params=params), "a"
            )
