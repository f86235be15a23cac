"""Injections that would change the meaning of a name in the target are refused before a mutant is built."""

import shutil
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.faults.fault_model_files import load_fault_models
from mutator.faults.fault_models import FaultModels
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection, Value
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes
from mutator.workspace import Workspace

MODELS = Workspace.find(root=Path(__file__).parents[4]).fault_models()
SOURCE = """\
from pack.rain import Rain, Snow
limit = 3.0
µ = 0.8

def reads(x):
    y = x + limit + self.gap
    return min(y, µ)

def sets(x):
    global limit
    limit = x
    z = x
    return limit

def outer(x):
    def count():
        nonlocal x
        x += 1
        return x
    def look():
        return x + limit
    return count, look

class _Car:
    def drive(self, x):
        __own = self.__gap
        return Rain(x)
"""


def test_a_fault_becomes_source_in_one_function() -> None:
    """All others use its list of edits; only examples of models have no target."""
    sources = Path(mutator.__file__).parent
    calling = {
        path.relative_to(sources).as_posix()
        for path in sources.rglob("*.py")
        if "injection_edit(" in path.read_text()
    }
    assert calling == {"mutants/injection_edits.py", "checks/library_check.py"}


def injected(
    models: FaultModels, function: str, anchor: Anchor | None = None, model: str = "stuck", **params: Value
) -> str:
    file = parse_file("m.py", SOURCE.encode(), Path("root"))
    place = FaultLocation(path="m.py", function=function, anchor=anchor or Anchor(kind=AnchorKind.ENTRY))
    given = {"value": 1.0, **params} if model == "stuck" else params
    injection = Injection(location=place, model=model, params=tuple(sorted(given.items())))
    return mutated_bytes(
        apply_edits(file, as_line_edits(file, [injection_edit(file, models, injection, "ab12")]))
    ).decode()


@pytest.mark.parametrize(
    ("function", "target", "line", "said"),
    [
        ("reads", "limit", 6, "make 'limit' local in reads, where it is global or built-in"),
        ("reads", "min", 6, "make 'min' local in reads, where it is global or built-in"),
        ("reads", "µ", 6, "make 'μ' local in reads, where it is global or built-in"),
        ("outer.look", "x", 21, "make 'x' local in look, where it is nonlocal"),
        ("_Car.drive", "Rain", 26, "make 'Rain' local in drive, where it is global or built-in"),
        ("reads", "gap", 6, "'gap' is not known in reads"),
        ("outer", "limit", 16, "'limit' is not known in outer"),
    ],
)
def test_setting_an_unknown_or_outer_variable_is_refused(
    function: str, target: str, line: int, said: str
) -> None:
    with pytest.raises(MutatorError) as caught:
        injected(MODELS, function, target=target)
    error = caught.value
    assert said in error.got
    assert (error.where, error.line) == ("root/m.py", line)
    assert error.remedy


@pytest.mark.parametrize(
    ("function", "anchor", "target"),
    [
        ("reads", None, "x"),
        ("reads", None, "self.gap"),
        ("sets", Anchor(kind=AnchorKind.AFTER_ASSIGN, name="z"), "limit"),
        ("outer.count", Anchor(kind=AnchorKind.AFTER_ASSIGN, name="x"), "x"),
        ("outer", None, "x"),
        ("_Car.drive", Anchor(kind=AnchorKind.AFTER_ASSIGN, name="__own"), "__own"),
        ("_Car.drive", None, "self.__gap"),
    ],
)
def test_local_declared_and_attribute_names_can_be_set(
    function: str, anchor: Anchor | None, target: str
) -> None:
    line = f"{target} = _fi.like({target}, 1.0)  # fi:ab12\n"
    assert line in injected(MODELS, function, anchor, target=target)


@pytest.fixture
def models(tmp_path: Path) -> FaultModels:
    workspace = Workspace.find(root=Path(__file__).parents[4])
    templates = Path(shutil.copytree(workspace.templates, tmp_path / "templates"))
    (templates / "stuck.py.j2").write_text(
        'if _fi.active("{{ fi }}"):\n    import pack.x as z\n    for y in [1]:\n'
        "        {{ target }} = {{ value }}\n"
    )
    return Workspace(library=workspace.library, templates=templates).fault_models()


def test_a_template_cannot_set_names_that_the_function_uses(models: FaultModels) -> None:
    assert "for y in [1]:" in injected(models, "outer", target="x")
    with pytest.raises(
        MutatorError, match=r"root/m.py:6: .* set 'y', a name that the function uses"
    ) as caught:
        injected(models, "reads", target="x")
    assert "rename it in stuck.py.j2" in str(caught.value)
    with pytest.raises(MutatorError, match="set 'z', a name that the function uses"):
        injected(models, "sets", Anchor(kind=AnchorKind.AFTER_ASSIGN, name="z"), target="x")
    assert "z = 1.0" in injected(models, "sets", Anchor(kind=AnchorKind.AFTER_ASSIGN, name="z"), target="z")


def test_an_expression_that_sets_a_name_is_refused(tmp_path: Path) -> None:
    """The name would become local to the function."""
    templates = Path(shutil.copytree(MODELS.folder, tmp_path / "templates"))
    (templates / "sign_flip.py.j2").write_text("(limit := -{{ original }})\n")
    place = Anchor(kind=AnchorKind.RETURN_VALUE)
    with pytest.raises(MutatorError, match=r"root/m.py:7: the template sets 'limit'"):
        injected(load_fault_models(templates), "reads", place, "sign_flip")


def test_an_imported_name_that_the_function_uses_is_refused() -> None:
    params = {"amount": 1.0, "camera": None, "scene": None, "seed": 1, "target": "x"}
    params |= {"camera": "x", "scene": "x"}
    with pytest.raises(MutatorError, match="set 'Rain', a name that the function uses"):
        injected(MODELS, "_Car.drive", model="image_effect", effect="pack.rain.Rain", **params)
    assert "import Snow" in injected(
        MODELS, "_Car.drive", model="image_effect", effect="pack.rain.Snow", **params
    )


def test_a_refused_injection_is_refused_again() -> None:
    file = parse_file("m.py", SOURCE.encode(), Path("root"))
    place = FaultLocation(path="m.py", function="reads", anchor=Anchor(kind=AnchorKind.ENTRY))
    injection = Injection(location=place, model="stuck", params=(("target", "limit"), ("value", 1.0)))
    for _ in range(2):
        with pytest.raises(MutatorError, match="would make 'limit' local"):
            injection_edit(file, MODELS, injection, "ab12")
