"""A changed line invalidates exactly the approvals that depend on it."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.review.mutant_groups import Group, groups_of_library
from mutator.review.review_state_and_actions import (
    ReviewAction,
    ReviewActionKind,
    ReviewState,
    load_review,
    record_actions,
)
from mutator.workspace import Workspace

EFFECTS = """\
from toycar.optics import dim

class Veil:
    def __init__(self, amount, seed, eye):
        self.amount = amount

    def apply(self, gap, world):
        return dim(gap) + self.amount

class Glare(Veil):
    def apply(self, gap, world):
        return gap - self.amount
"""
OPTICS = """\
LOSS = 0.5

def dim(value):
    return value * (1.0 - LOSS)

def unused(value):
    return value
"""
SPEC = """\
schema: fault_spec/1
module: sensor
fault_type: seen
about: The sensor sees something else.
variants:
{variants}
"""
VARIANT = """\
  {name}:
    aim: H1
    about: By {name}.
    draw:
      amount: {{values: [1.0, 2.0]}}
    as_described:
      injections:
        - at: {{file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}}
          model: {model}
          unit: '1'
          params: {{{params}}}
"""
EFFECT = "effect: {0}, amount: amount, camera: self, scene: world"
HELPED_YAML = """\
schema: fault_model/1
name: helped
kind: insert
about: Calls a helper of the target.
params:
  target: {type: variable, about: what is changed}
  by: {type: number, about: how much}
examples:
  - about: the helper is called
    injection:
      at: {file: example.py, function: measure, after_assign: gap}
      model: helped
      params: {by: 3}
    before: |
      def measure(gap):
          gap = gap
    after: |
      def measure(gap):
          gap = gap
          if _fi.active("example"):  # fi:example
              from toycar.optics import dim  # fi:example
              gap = dim(gap) + 3.0  # fi:example
"""
HELPED = """\
if _fi.active("{{ fi }}"):
    from toycar.optics import dim
    {{ target }} = dim({{ target }}) + {{ by }}
"""
VEIL, GLARE, HELPER, GAP, LOW, LANE, SILENCE, PROBE = (
    "effect=toycar.effects.Veil",
    "effect=toycar.effects.Glare",
    "helped(",
    "gap: offset(by, target",
    "gap: offset(by, low",
    "offset: offset(",
    "omission(",
    "the probe",
)
IN_SENSE = {VEIL, GLARE, HELPER, GAP, LOW, LANE, SILENCE}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    toycar = copy_toycar(tmp_path_factory.mktemp("approved"))
    car = toycar.library.parent / "tree" / "toycar"
    (car / "effects.py").write_text(EFFECTS)
    (car / "optics.py").write_text(OPTICS)
    (toycar.templates / "helped.yaml").write_text(HELPED_YAML)
    (toycar.templates / "helped.py.j2").write_text(HELPED)
    variants = [
        VARIANT.format(
            name=name, model="image_effect", params=EFFECT.format(f"toycar.effects.{name.title()}")
        )
        for name in ("veil", "glare")
    ] + [VARIANT.format(name="helper", model="helped", params="by: amount")]
    spec = toycar.library / "faults" / "sensor" / "seen.yaml"
    spec.write_text(SPEC.format(variants="".join(variants)))
    changes = [
        ReviewAction(group=group, kind=ReviewActionKind.APPROVE, by="Jane") for group in groups(toycar)
    ]
    review = record_actions(toycar, "toycar", changes, {})
    assert len(review.entry_by_group) == len(IN_SENSE) + 1
    return toycar.library.parent


@pytest.fixture
def approved(original: Path, tmp_path: Path) -> Workspace:
    root = shutil.copytree(original, tmp_path / "toy")
    return Workspace(library=root / "fault_library", templates=root / "templates")


def groups(toy: Workspace) -> tuple[Group, ...]:
    return groups_of_library(toy, toy.manifest("toycar"), specs=["sensor/*"])


@pytest.mark.parametrize(
    ("file", "old", "new", "stale", "why"),
    [
        ("tree/toycar/effects.py", "gap - self.amount", "gap - 2.0", {GLARE}, "called code"),
        ("tree/toycar/effects.py", "self.amount = amount", "self.amount = 0", {VEIL, GLARE}, "called code"),
        ("tree/toycar/optics.py", "(1.0 - LOSS)", "LOSS", {VEIL, GLARE, HELPER}, "called code"),
        ("tree/toycar/optics.py", "LOSS = 0.5", "LOSS = 0.4", {VEIL, GLARE, HELPER}, "called code"),
        ("tree/toycar/optics.py", "return value\n", "return 1\n", set(), ""),
        ("tree/toycar/effects.py", "import dim\n", "import dim\nMORE = 1\n", set(), ""),
        ("tree/toycar/sensing.py", "(100.0, 0.0", "(99.0, 0.0", set(), ""),
        ("tree/toycar/sensing.py", "gap = world.gap", "gap = 1 * world.gap", IN_SENSE, "target function"),
        ("tree/toycar/go.py", "class ", "class Another:\n    pass\n\n\nclass ", set(), ""),
        ("templates/helped.py.j2", "+ {{ by }}", "- {{ by }}", {HELPER}, "template"),
        ("templates/omission.py.j2", "not ", "not not not ", {SILENCE}, "template"),
        ("templates/offset.py.j2", "{{ low }}", "1 * {{ low }}", {GAP, LOW, LANE}, "template"),
        ("templates/_fi.py.j2", "_TINY = 1e-9", "_TINY = 1e-8", {PROBE}, "template"),
        ("fault_library/faults/sensor/seen.yaml", "[1.0, 2.0]", "[1.0, 3.0]", {VEIL}, "values (amount: 1 "),
        ("fault_library/faults/sensor/lane.yaml", "[2.4, 2.5]", "[1.6, 1.7]", set(), ""),
    ],
)  # fmt: skip
def test_a_change_makes_exactly_its_groups_stale(
    approved: Workspace, file: str, old: str, new: str, stale: set[str], why: str
) -> None:
    path = approved.library.parent / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    review, now = load_review(approved, "toycar"), groups(approved)
    changed = {
        group.label: review.stale_parts(group) for group in now if review.state(group) is ReviewState.CHANGED
    }
    assert len(changed) == len(stale)
    assert all(any(words in what for what in changed) for words in stale)
    assert all(reasons[0].startswith(why) for reasons in changed.values())


@pytest.mark.slow
def test_a_change_in_a_shipped_effect_makes_exactly_its_groups_stale(
    clone: Workspace, tmp_path: Path
) -> None:
    target = tmp_path / "target"
    shutil.copytree(clone.library.parent / "target", target, ignore=shutil.ignore_patterns("__pycache__"))
    library = tmp_path / "fault_library"
    shutil.copytree(clone.library, library)
    here = replace(clone, library=library, target=target)

    def found() -> dict[str, Group]:
        return {
            one.id: one for one in groups_of_library(here, here.manifest("openpilot"), specs=["vision*/*"])
        }

    before = found()
    record_actions(
        here,
        "openpilot",
        [ReviewAction(group=g, kind=ReviewActionKind.APPROVE, by="Jane") for g in before.values()],
        {},
    )
    review = load_review(here, "openpilot")

    def stale(file: str, old: str, new: str) -> set[str]:
        path = target / "selfdrive" / "sim" / "effects" / file
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))
        changed = {name: review.stale_parts(group) for name, group in found().items()}
        path.write_text(text)
        assert {tuple(why) for why in changed.values()} <= {(), ("called code",)}
        return {name for name, why in changed.items() if why}

    def uses(*names: str) -> set[str]:
        groups = before.values()
        return {g.id for g in groups if any(f"effects.{name}" in g.label for name in names)}

    def calls(place: str) -> set[str]:
        return {g.id for g in before.values() if f"-- selfdrive/sim/effects/{place}\n" in g.reviewed_text}

    assert stale("air.py", "class Fog(Effect):\n", "class Fog(Effect):\n    # another line\n") == uses("Fog,")
    assert len(uses("Fog,")) == 2  # the effect alone, and together with rain
    base = stale("effect.py", "    MOVING: ClassVar", "    # another line\n    MOVING: ClassVar")
    assert base == {g.id for g in before.values() if "image_effect" in g.models}
    assert uses("AveragingBlur", "MedianBlur") <= (helper := calls("canvas.py filtered")) < base
    assert stale("canvas.py", "def filtered(", "def  filtered(") == helper
    kernel = stale("gaussian.c", "/*", "/* another line\n")
    assert kernel == {
        g.id for g in before.values() if "-- selfdrive/sim/effects/gaussian.c\n" in g.reviewed_text
    }
    assert uses("GaussianBlur") <= kernel < base
