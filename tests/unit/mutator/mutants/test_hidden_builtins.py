"""Built-in functions that injected lines call, in targets that have other functions of these names."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection, Value
from mutator.mutants import hidden_builtins
from mutator.mutants.hidden_builtins import builtins_always_called
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.possible_places import places_of
from mutator.workspace import Workspace

MODELS = Workspace.find(root=Path(__file__).parents[4]).fault_models()
OFFSET = {"target": "x", "by": 1.0, "low": 0.0}
AFTER_X = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="x")
RETURNED = Anchor(kind=AnchorKind.RETURN_VALUE)


def edit(source: str, model: str, params: dict[str, Value], anchor: Anchor = AFTER_X) -> object:
    file = parse_file("m.py", source.encode(), Path("root"))
    place = FaultLocation(path="m.py", function="f", anchor=anchor)
    injection = Injection(location=place, model=model, params=tuple(sorted(params.items())))
    return injection_edit(file, MODELS, injection, "ab12")


@pytest.mark.parametrize(
    "source",
    [
        "def f(a, max):\n    x = a\n    return x\n",
        "def f(a):\n    max = 3.0\n    x = a\n    return x\n",
        "max = 3.0\ndef f(a):\n    x = a\n    return x\n",
        "from numpy import max\ndef f(a):\n    x = a\n    return x\n",
        "def g():\n    global max\n    max = 1\ndef f(a):\n    x = a\n    return x\n",
        "def f(a):\n    for i, max in a:\n        x = i\n    return x\n",
    ],
)
def test_a_variable_with_the_name_of_a_called_function_is_refused(source: str) -> None:
    """The line would call the variable, and fail while the fault is active."""
    with pytest.raises(MutatorError, match="calls Python's `max`, but the file has another `max` here"):
        edit(source, "offset", OFFSET)


@pytest.mark.parametrize(
    "source",
    [
        "def f(a):\n    x = max(a, 2)\n    return x\n",
        "def g(max):\n    return max\ndef f(a):\n    x = a\n    return x\n",
        "class C:\n    max = 3\ndef f(a):\n    x = a.max\n    return x\n",
        "def f(a, min):\n    x = a\n    return x\n",
    ],
)
def test_a_name_that_is_the_built_in_function_at_the_place_is_none(source: str) -> None:
    edit(source, "offset", OFFSET)


def test_a_file_is_searched_once_for_all_its_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Listing the places of a file with thousands of lines costs seconds, not minutes."""
    searched: list[object] = []
    monkeypatch.setattr(
        hidden_builtins, "names_of_module", lambda data: searched.append(data) or frozenset[str]()
    )
    source = "".join(f"def searched_{i}(a, max):\n    x = a\n    return x\n" for i in range(50))
    places = places_of(parse_file("m.py", source.encode(), Path("root")), MODELS)
    assert len(places) > 200 and len(searched) == 1


def test_an_offset_without_bounds_calls_no_function() -> None:
    edit("def f(a, max):\n    x = a\n    return x\n", "offset", {"target": "x", "by": 1.0})


def test_the_same_holds_for_values_of_expressions() -> None:
    source = "def f(a, float):\n    x = a\n    return x\n"
    with pytest.raises(MutatorError, match="Python's `float`"):
        edit(source, "nan", {}, RETURNED)
    edit(source.replace("float", "double"), "nan", {}, RETURNED)


@pytest.mark.parametrize(
    ("template", "names"),
    [
        ("{{ a }} = max(0, min(1, {{ b }}))", {"max", "min"}),
        ("{% if a %}max({{ a }}){% else %}min({{ a }}){% endif %}", set()),
        ("{% if a %}max(1){% elif b %}max(2) + abs(1){% else %}max(3){% endif %}", {"max"}),
        ("{% if a %}max(1){% endif %}", set()),
        ("_fi.max(1) + my_max(2) + max", set()),
    ],
)
def test_a_template_always_calls_what_is_in_all_its_branches(template: str, names: set[str]) -> None:
    assert builtins_always_called(template) == names
