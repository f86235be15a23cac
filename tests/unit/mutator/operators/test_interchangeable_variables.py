"""One variable read for another: only where both are of the same kind, and the other is bound."""

import ast
from pathlib import Path

import pytest

import mutator
from mutator.limits import Limits
from mutator.model import Status
from mutator.operators.executed_lines_and_types import GoldenRunInputs, measure_variable_types
from mutator.operators.interchangeable_variables import names_of_functions, replacements_of_name
from mutator.operators.mutation_selection import select_mutations
from mutator.operators.operator_lookup import names_in_all
from mutator.workspace import Workspace
from tests.small_loop import small_loop


def replacements(source: str, name: str, types: dict[str, str] | None = None) -> list[str]:
    """Return what can stand for the last read of a name."""
    module = ast.parse(source)
    nodes = [n for n in ast.walk(module) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)]
    node = max((n for n in nodes if n.id == name), key=lambda n: (n.lineno, n.col_offset))
    return replacements_of_name(names_of_functions(module), node, types)


@pytest.mark.parametrize(
    ("body", "name", "others"),
    [
        ("cx, cy = middle(p)\n    return cx", "cx", ["cy"]),
        ("x = self.place.x\n    y = self.place.y\n    z = self.speed.z\n    return x", "x", ["y"]),
        ("low = 0.0\n    high = 1.0\n    name = 'a'\n    return low", "low", ["high"]),
        ("for i, j in pairs:\n        print(i)\n    return i", "i", []),
        ("a = 1\n    if p:\n        b = 2\n        return b\n    return a", "b", ["a"]),
        ("if p:\n        b = 2\n    a = 1\n    return a", "a", []),
        ("a = 1\n    b = 2\n    del b\n    return a", "a", []),
        ("a = 1\n    b = 2\n    b = 'x'\n    return a", "a", []),
        ("global b\n    a = 1\n    b = 2\n    return a", "a", []),
        ("a = 1\n    return a\n    b = 2", "a", []),
        ("a = 1\n    b = 2\n    return [a for a in p]", "a", []),
        ("a = 1\n    b = 2\n    return [a for b in p]", "a", []),
        ("a = 1\n    def g(u, v):\n        return u\n    return a", "u", ["v"]),
        ("x1 = 1\n    x2 = 2\n    x3 = 3\n    x4 = 4\n    far = 5\n    return x1", "x1", ["x2", "x3", "x4"]),
    ],
)
def test_names_that_are_assigned_alike_can_stand_for_one_another(
    body: str, name: str, others: list[str]
) -> None:
    """Without a golden run, the other name is certainly bound, and every assignment of both is alike."""
    assert replacements(f"def f(self, p):\n    {body}\n", name) == others


def test_parameters_with_one_annotation_are_alike() -> None:
    """An annotation or a default tells parameters apart; the function's own object is never one of them."""
    source = "def f(self, a: float, b: float, c: str, d=1, e=2):\n    return a + d\n"
    assert (replacements(source, "a"), replacements(source, "d")) == (["b"], ["e"])
    assert replacements("def f(self, a):\n    return a\n", "a") == []


def test_types_of_a_golden_run_decide() -> None:
    """They replace what the source says; a name that has no type on the line is not bound there."""
    source = "def f(a, b):\n    if a:\n        c = b\n    return a\n"
    assert replacements(source, "a", {"a": "builtins.float", "b": "builtins.str", "c": "builtins.float"}) == [
        "c"
    ]
    assert replacements(source, "a", {"a": "builtins.float", "b": "builtins.float"}) == ["b"]
    assert replacements(source, "a", {}) == []


LAW = """\
class Control:
    def __init__(self):
        self.last = None

    def update(self, y, dt):
        last = y if self.last is None else self.last
        self.last = y
        rate = (y - last) / dt
        side = "left" if y > 0 else "right"
        return -2.0 * y - 2.5 * rate
"""


@pytest.fixture
def loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return small_loop(tmp_path, {"law.py": LAW})


def test_a_golden_run_notes_the_types_of_variables(loop: Workspace) -> None:
    """Each line has the variables that are bound whenever it begins, with all their types."""
    inputs = [GoldenRunInputs(scenario=loop.scenario("s"), changes=(), seed=0)]
    types = measure_variable_types(loop.manifest("t"), inputs, Limits())["law.py"]
    assert types[9] == {
        "self": "law.Control",
        "y": "builtins.float",
        "dt": "builtins.float",
        "last": "builtins.float",
        "rate": "builtins.float",
    }
    assert types[10]["side"] == "builtins.str" and "rate" not in types[8]
    assert measure_variable_types(loop.manifest("t"), inputs, Limits())["law.py"] == types


def test_mutants_read_variables_of_the_same_type_and_run(loop: Workspace) -> None:
    """With a golden run, `dt` is no `side`, and no mutant reads a variable that is not bound."""
    manifest, models = loop.manifest("t"), loop.fault_models()
    inputs = [GoldenRunInputs(scenario=loop.scenario("s"), changes=(), seed=0)]
    types = measure_variable_types(manifest, inputs, Limits())
    selected = select_mutations(manifest, models, ["variable"], ["law.py"], None, types)
    changes = {(m.line + 1, m.description) for m in selected.mutations}
    assert (10, "rate -> last") in changes and (8, "y -> last") in changes
    assert not any("side" in text or "self" in text for _, text in changes)
    assert not any(text.endswith("-> rate") for line, text in changes if line <= 8)
    faults = [m.to_fault("as_described") for m in selected.mutations if m.line == 9]
    for fault in faults:
        record = mutator.try_fault(fault, "s", "t>=0.2", workspace=loop).record
        assert (record.status, record.activation is not None) == (Status.OK, True)


def test_all_leaves_the_operator_out() -> None:
    """Draws of `all` stay as they were; the operator must be named."""
    assert "variable" not in names_in_all() and "argument" in names_in_all()
