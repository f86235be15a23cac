"""Mutants from reused changes equal spliced ones byte for byte."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels, ParamSchema, SnippetKind
from mutator.faults.spec_expansion import expand_spec
from mutator.model import AnchorKind, Fault, Hold, Injection, Trigger, Value
from mutator.mutants.mutant_building import Mutant, build, build_without_reusing_changed_files
from mutator.mutants.parsed_files_and_anchors import parsed_file
from mutator.store.plan_choices import Choices
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

ROOT = Path(__file__).parents[2]
READINGS = Workspace.find(root=ROOT).readings().names
VARIABLES = ("t", "d_rel", "v_ego", "v_lead", "hwt", "rs")
NUMBERS = st.floats() | st.sampled_from([0.0, -0.0, 35.0, 1e22, 5e-324, math.nan, math.inf])
CONDITIONS = st.one_of(
    st.floats(-1e3, 1e9).map(lambda t: f"t >= {t!r}"),
    st.tuples(st.sampled_from(VARIABLES), st.floats(-1e9, 1e9)).map(
        lambda p: f"{p[0]} <= {p[1]!r} and rs > 0.0"
    ),
    st.sampled_from(["True", "not hwt / 2.0 > 1.0", "abs(d_rel) < max(v_ego, 3)"]),
)


@cache
def paper() -> tuple[TargetManifest, FaultModels]:
    workspace = Workspace.find(root=ROOT)
    return workspace.manifest("openpilot"), workspace.fault_models()


@cache
def faults() -> list[Fault]:
    manifest, models = paper()
    specs = Workspace.find(root=ROOT).specs()
    return [
        fault
        for reading in READINGS
        for spec in specs
        for fault in expand_spec(spec, 1, reading, models=models, manifest=manifest)
    ]


@st.composite
def triggers(draw: st.DrawFn) -> Trigger:
    return Trigger(
        name=draw(st.sampled_from(["a", "random/C1"])),
        condition=draw(CONDITIONS),
        hold=draw(st.sampled_from(Hold)),
        hold_s=draw(st.floats(0.0, 1e6)),
        armed_after_s=draw(st.floats(0.0, 1e6)),
    )


@st.composite
def varied(draw: st.DrawFn) -> Fault:
    fault = draw(st.sampled_from(faults()))
    injections = []
    for injection in fault.injections:
        params = [
            (name, draw(NUMBERS) if isinstance(value, float) else value) for name, value in injection.params
        ]
        injections.append(replace(injection, params=tuple(params)))
    return replace(fault, injections=tuple(injections))


@st.composite
def others(draw: st.DrawFn) -> Fault:
    """Return a fault of any model at a location in the library. Optional fields can be missing."""
    manifest, models = paper()
    model = models.get(draw(st.sampled_from(sorted(models.models))))
    fault = draw(st.sampled_from(faults()))
    location = draw(st.sampled_from(fault.injections)).location
    if model.kind is SnippetKind.GUARD:
        kind = AnchorKind(location.anchor.kind.replace("after_", "before_"))
        location = replace(location, anchor=replace(location.anchor, kind=kind))
    names = sorted(parsed_file(manifest.tree, location.path).names_used_in_function_at(location))
    given = [p for p in model.params if not (p.optional and draw(st.booleans()))]
    params = tuple((p.name, draw(values(p, names))) for p in given)
    return replace(fault, injections=(Injection(location=location, model=model.name, params=params),))


def values(param: ParamSchema, names: list[str]) -> st.SearchStrategy[Value]:
    return {
        "variable": st.sampled_from(names),
        "import": st.just("selfdrive.sim.effects.Rain"),
        "number": NUMBERS,
        "integer": st.integers(0, 63),
        "boolean": st.booleans(),
        "constant": NUMBERS | st.booleans() | st.none() | st.text(),
        "choice": st.sampled_from(param.choices or ("",)),
        "unit": st.sampled_from(("m", "km", "mps", "kph", "rad", "deg")),
        "seed": st.integers(0, 2**53),
        "expression": st.sampled_from(("message[0]", "message.topic", "message")),
    }[param.type]


def made(way: object, fault: Fault, trigger: Trigger) -> Mutant | tuple[type, str]:
    try:
        return way(*paper(), fault, trigger)
    except MutatorError as error:
        return type(error), str(error)


@settings(max_examples=50, deadline=None)
@given(varied() | others(), triggers())
def test_reused_changes_give_the_same_mutants_as_splicing(fault: Fault, trigger: Trigger) -> None:
    made(build, fault, trigger)  # leaves a reusable change if it is the first of its kind
    assert made(build, fault, trigger) == made(build_without_reusing_changed_files, fault, trigger)


@pytest.mark.slow
@pytest.mark.parametrize("reading", READINGS)
def test_mutants_of_the_papers_campaign_equal_spliced_ones(reading: str) -> None:
    plan = build_plan(Workspace.find(root=ROOT), "paper", Choices(reading=reading))
    pairs = {(e.fault.id, e.trigger): e for e in plan.experiments}
    assert len(pairs) > 6000
    for experiment in pairs.values():
        key = experiment.fault, experiment.trigger
        assert build(*paper(), *key) == build_without_reusing_changed_files(*paper(), *key)
