"""Shapes of patches: text with holes for the parts that vary."""

from dataclasses import replace

import pytest

from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault, Hold, Trigger
from mutator.mutants.mutant_building import build
from mutator.review.patch_shapes import (
    PatchShape,
    group_label,
    parameter_values,
    shapes_of_patches,
    without_values,
)
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace

NEAR = Trigger(name="near", condition="hwt <= 2.0")
FAR = replace(NEAR, name="far", condition="hwt > 2.0 and rs > 0.0")


def faults(toy: Workspace, name: str, spec: str = "sensor/distance") -> list[Fault]:
    manifest, models = toy.manifest("toycar"), toy.fault_models()
    found = expand_spec(toy.spec(spec), 7, models=models, manifest=manifest)
    return [fault for fault in found if fault.spec == f"{spec}/{name}"]


def grouped(toy: Workspace, pairs: list[tuple[Fault, Trigger]]) -> list[PatchShape]:
    manifest, models = toy.manifest("toycar"), toy.fault_models()
    return shapes_of_patches(
        (f"{i}", group_label(fault), build(manifest, models, fault, trigger).patch)
        for i, (fault, trigger) in enumerate(pairs)
    )


def test_a_shape_with_a_faults_values_is_its_patch(toycar: Workspace) -> None:
    pairs = [(fault, trigger) for fault in faults(toycar, "longer") for trigger in (NEAR, FAR)]
    (shape,) = grouped(toycar, pairs)
    assert shape.member_ids == tuple(str(i) for i in range(8))
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    for i, pair in enumerate(pairs):
        assert shape.patch_of(i) == build(manifest, models, *pair).patch


def test_holes_have_names(toycar: Workspace) -> None:
    pairs = [(fault, NEAR) for fault in faults(toycar, "nearer")]
    (shape,) = grouped(toycar, pairs)
    named = shape.with_named_holes(parameter_values(fault) for fault, _ in pairs)
    assert named.hole_names == ("mutant", "id", "by")
    assert "gap = gap ⟨by⟩  # fi:⟨id⟩" in named.diff
    assert "gap = max(gap, _fi.like(gap, 0.0))" in named.diff
    assert [row[2] for row in named.values_by_member] == [
        f"- {-dict(parameter_values(f))['by']:.0f}" for f, _ in pairs
    ]


def test_a_sign_is_part_of_the_value(toycar: Workspace) -> None:
    first, second, *_ = faults(toycar, "longer")
    (injection,) = second.injections
    less = replace(second, injections=(replace(injection, params=(("by", -3.0), ("target", "gap"))),))
    (shape,) = grouped(toycar, [(first, NEAR), (less, NEAR)])
    assert shape.values_by_member[1][shape.hole_names.index("1")] == "- 3"


def test_nan_fills_a_hole(toycar: Workspace) -> None:
    first, second, *_ = faults(toycar, "longer")
    (injection,) = second.injections
    params = (("by", float("nan")), ("target", "gap"))
    wrong = replace(second, injections=(replace(injection, params=params),))
    (shape,) = grouped(toycar, [(first, NEAR), (wrong, NEAR)])
    named = shape.with_named_holes(map(parameter_values, (first, wrong)))
    assert named.values_by_member[1][named.hole_names.index("by")] == "+ float('nan')"


def test_place_model_and_bound_are_part_of_the_shape(toycar: Workspace) -> None:
    longer, nearer = faults(toycar, "longer")[0], faults(toycar, "nearer")[0]
    shifted = faults(toycar, "shifted", "sensor/lane")[0]
    silent = faults(toycar, "no_data", "sensor/silence")[0]
    pairs = [(fault, NEAR) for fault in (longer, nearer, shifted, silent)]
    assert len(grouped(toycar, pairs)) == len(pairs)


def test_triggers_are_not_part_of_the_shape(toycar: Workspace) -> None:
    longer = faults(toycar, "longer")[0]
    triggers = (NEAR, replace(NEAR, hold=Hold.TO_END), trigger_at_time(3.0), always_trigger())
    assert len(grouped(toycar, [(longer, trigger) for trigger in triggers])) == 1


def test_the_id_of_a_shape_does_not_depend_on_its_members(toycar: Workspace) -> None:
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
def test_a_patch_of_any_text_round_trips(patch: str) -> None:
    (shape,) = shapes_of_patches([("a", "", patch), ("b", "", patch)])
    assert shape.patch_of(1) == patch


def test_numbers_outside_injected_lines_are_part_of_the_shape() -> None:
    patch = (
        "diff --git a/a.py b/a.py\n--- a/a.py\n+++ b/a.py\n@@ -1,1 +1,2 @@\n x = 3\n+y = 4  # fi:01234567\n"
    )
    assert without_values(patch).count("\0") == 2
    assert without_values(patch) != without_values(patch.replace("x = 3", "x = 5"))
    assert without_values(patch) == without_values(patch.replace("y = 4", "y = -5.5e-7"))


def test_the_ids_in_a_tag_are_not_part_of_the_shape() -> None:
    """Mutants that change the same two values have the same shape."""
    patch = (
        "diff --git a/a.py b/a.py\n--- a/a.py\n+++ b/a.py\n@@ -1,1 +1,1 @@\n-x = y, z\n"
        '+x = (0 if _fi.active("0123456a") else y), (0 if _fi.active("0123456b") else z)'
        "  # fi:0123456a+0123456b was:x = y, z\n"
    )
    assert without_values(patch) == without_values(patch.replace("012345", "fedcba"))
