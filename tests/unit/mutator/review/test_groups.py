"""Shapes of patches: the parts that vary become holes, and the rest is text."""

from dataclasses import replace

import pytest

from mutator.faults.expansion import expand
from mutator.model import Fault, Hold, Trigger
from mutator.mutants.building import build
from mutator.review.groups import Shape, group_label, parameter_values, shapes, without_values
from mutator.triggers.kinds import always, at_time
from mutator.workspace import Workspace

NEAR = Trigger(name="near", condition="hwt <= 2.0")
FAR = replace(NEAR, name="far", condition="hwt > 2.0 and rs > 0.0")


def faults(toy: Workspace, name: str, spec: str = "sensor/distance") -> list[Fault]:
    manifest, models = toy.manifest("toycar"), toy.fault_models()
    found = expand(toy.spec(spec), 7, models=models, manifest=manifest)
    return [fault for fault in found if fault.spec == f"{spec}/{name}"]


def grouped(toy: Workspace, pairs: list[tuple[Fault, Trigger]]) -> list[Shape]:
    manifest, models = toy.manifest("toycar"), toy.fault_models()
    return shapes(
        (f"{i}", group_label(fault), build(manifest, models, fault, trigger).patch)
        for i, (fault, trigger) in enumerate(pairs)
    )


def test_a_shape_is_its_members_patches(toycar: Workspace) -> None:
    """The faults of a variant share a diff with holes. Filled with the values of one fault, it is the
    patch of that fault."""
    pairs = [(fault, trigger) for fault in faults(toycar, "longer") for trigger in (NEAR, FAR)]
    (shape,) = grouped(toycar, pairs)
    assert shape.members == tuple(str(i) for i in range(8))
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    for i, pair in enumerate(pairs):
        assert shape.patch(i) == build(manifest, models, *pair).patch


def test_holes_are_what_varies_by_its_name(toycar: Workspace) -> None:
    """The table has the ids, the trigger's condition and the fault's parameter. Parts that all share stay
    text."""
    pairs = [(fault, NEAR) for fault in faults(toycar, "nearer")]
    (shape,) = grouped(toycar, pairs)
    named = shape.with_named_holes(parameter_values(fault) for fault, _ in pairs)
    assert named.holes == ("mutant", "id", "by")
    assert "gap = gap ⟨by⟩  # fi:⟨id⟩" in named.diff
    assert "gap = max(gap, _fi.like(gap, 0.0))" in named.diff
    assert [row[2] for row in named.values] == [f"- {-dict(parameter_values(f))['by']:.0f}" for f, _ in pairs]


def test_a_sign_is_part_of_the_value(toycar: Workspace) -> None:
    """`+ 3` and `- 3` fill the same hole of the same diff."""
    first, second, *_ = faults(toycar, "longer")
    (injection,) = second.injections
    less = replace(second, injections=(replace(injection, params=(("by", -3.0), ("target", "gap"))),))
    (shape,) = grouped(toycar, [(first, NEAR), (less, NEAR)])
    assert shape.values[1][shape.holes.index("1")] == "- 3"


def test_not_a_number_is_a_value(toycar: Workspace) -> None:
    """NaN fills a hole like any number."""
    first, second, *_ = faults(toycar, "longer")
    (injection,) = second.injections
    params = (("by", float("nan")), ("target", "gap"))
    wrong = replace(second, injections=(replace(injection, params=params),))
    (shape,) = grouped(toycar, [(first, NEAR), (wrong, NEAR)])
    named = shape.with_named_holes(map(parameter_values, (first, wrong)))
    assert named.values[1][named.holes.index("by")] == "+ float('nan')"


def test_what_must_be_in_common(toycar: Workspace) -> None:
    """Another place or another model gives another shape, and so does a bound that is set or not set."""
    longer, nearer = faults(toycar, "longer")[0], faults(toycar, "nearer")[0]
    shifted = faults(toycar, "shifted", "sensor/lane")[0]
    silent = faults(toycar, "no_data", "sensor/silence")[0]
    pairs = [(fault, NEAR) for fault in (longer, nearer, shifted, silent)]
    assert len(grouped(toycar, pairs)) == len(pairs)


def test_what_triggers_a_change_makes_no_other_shape(toycar: Workspace) -> None:
    """Faults share a diff whether they have a context, a time or neither, and whether they hold for a time
    or to the end."""
    longer = faults(toycar, "longer")[0]
    triggers = (NEAR, replace(NEAR, hold=Hold.TO_END), at_time(3.0), always())
    assert len(grouped(toycar, [(longer, trigger) for trigger in triggers])) == 1


def test_the_id_is_that_of_any_members(toycar: Workspace) -> None:
    """The id of a shape does not depend on the faults from which it was built."""
    one, other, *_ = faults(toycar, "longer")
    (first,), (second,) = grouped(toycar, [(one, NEAR)]), grouped(toycar, [(other, FAR)])
    assert first.id == second.id
    assert first.diff != second.diff  # for a single member, all parts are text


@pytest.mark.parametrize(
    "patch",
    [
        "",
        "no diff at all\n",
        "diff --git a/a.py b/a.py\n+a = '\0'  # fi:01234567\n",
        "+x = 3.0  # fi:01234567",
    ],
)
def test_any_text_is_given_back(patch: str) -> None:
    (shape,) = shapes([("a", "", patch), ("b", "", patch)])
    assert shape.patch(1) == patch


def test_pristine_lines_are_never_cut() -> None:
    """Numbers outside injected lines belong to the target, so patches that differ in them have different
    shapes."""
    patch = (
        "diff --git a/a.py b/a.py\n--- a/a.py\n+++ b/a.py\n@@ -1,1 +1,2 @@\n x = 3\n+y = 4  # fi:01234567\n"
    )
    assert without_values(patch).count("\0") == 2
    assert without_values(patch) != without_values(patch.replace("x = 3", "x = 5"))
    assert without_values(patch) == without_values(patch.replace("y = 4", "y = -5.5e-7"))


def test_a_tag_of_several_injections_has_no_numbers() -> None:
    """Mutants that change the same two values in a line have the same shape, regardless of the ids in its
    tag."""
    patch = (
        "diff --git a/a.py b/a.py\n--- a/a.py\n+++ b/a.py\n@@ -1,1 +1,1 @@\n-x = y, z\n"
        '+x = (0 if _fi.active("0123456a") else y), (0 if _fi.active("0123456b") else z)'
        "  # fi:0123456a+0123456b was:x = y, z\n"
    )
    assert without_values(patch) == without_values(patch.replace("012345", "fedcba"))
