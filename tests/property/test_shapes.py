"""Patches grouped by shape can be restored for any values, and one label means one shape."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault, Hold, Trigger
from mutator.mutants.mutant_building import build
from mutator.review.patch_shapes import group_label, parameter_values, shapes_of_patches
from mutator.workspace import Workspace

WORKSPACE = Workspace.find(root=Path(__file__).parents[2])
SOME = [0.0, -0.0, 35.0, 10000000.0, 1e22, 5e-324, math.nan, -math.inf]  # one has eight digits, like an id
NUMBERS = st.floats() | st.sampled_from(SOME)
CONDITIONS = ["hwt <= 2.0 and rs > 0.0", "not hwt / 2.0 > 1.0", "abs(d_rel) < max(v_ego, 3.0)"]


@cache
def setting() -> tuple[object, object, list[Fault]]:
    manifest, models = WORKSPACE.manifest("openpilot"), WORKSPACE.fault_models()
    found = {}
    for reading in WORKSPACE.readings().names:
        for spec in WORKSPACE.specs():
            for fault in expand_spec(spec, 1, reading, models=models, manifest=manifest):
                found[reading, fault.spec] = fault
    return manifest, models, list(found.values())


@st.composite
def alike(draw: st.DrawFn) -> list[tuple[Fault, Trigger]]:
    fault = draw(st.sampled_from(setting()[2]))
    found = []
    for _ in range(draw(st.integers(1, 4))):
        injections = []
        for injection in fault.injections:
            params = [(k, draw(NUMBERS) if isinstance(v, float) else v) for k, v in injection.params]
            injections.append(replace(injection, params=tuple(params)))
        condition = draw(st.sampled_from(CONDITIONS))
        hold_s = draw(st.floats(0.0, 1e6))
        trigger = Trigger(name="c", condition=condition, hold=Hold.FOR, hold_s=hold_s, armed_after_s=hold_s)
        found.append((replace(fault, injections=tuple(injections)), trigger))
    return found


@settings(max_examples=15, deadline=None)
@given(st.lists(alike(), min_size=1, max_size=3))
def test_each_patch_can_be_restored_from_its_shape(families: list[list[tuple[Fault, Trigger]]]) -> None:
    manifest, models, _ = setting()
    made = {}
    for family in families:
        for fault, trigger in family:
            patch = build(manifest, models, fault, trigger).patch  # type: ignore[arg-type]
            made[str(len(made))] = (fault, group_label(fault), patch)
    found = shapes_of_patches((key, name, patch) for key, (_, name, patch) in made.items())
    assert len(found) == len({name for _, name, _ in made.values()})
    for shape in found:
        named = shape.with_named_holes(parameter_values(made[key][0]) for key in shape.member_ids)
        assert len(set(named.hole_names)) == len(named.hole_names)
        for i, key in enumerate(named.member_ids):
            assert named.patch_of(i) == made[key][2]
