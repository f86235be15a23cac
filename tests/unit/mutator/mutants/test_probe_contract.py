"""The contract with the probe: the harness recognizes the text of a probe and reads its report."""

import json
import math
import random
import types
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mutator._common.hashing import digest
from mutator.engines.first_activation import is_active_at_observations
from mutator.errors import MutatorError
from mutator.faults.fault_model_files import load_fault_models
from mutator.faults.probe_template_parts import CODE_TEMPLATE_FILE, SETTINGS_TEMPLATE_FILE
from mutator.model import Hold, ObservedActivation, Trigger
from mutator.mutants import probe_contract as contract
from mutator.mutants.injected_line_syntax import probe_setting_spans
from mutator.mutants.mutant_building import build
from mutator.mutants.template_rendering import render_template
from mutator.workspace import Workspace

TRIGGER = Trigger(name="near", condition="hwt < 2.0 and rs > 0.0", armed_after_s=0.25)


MUTANT, IDS = "0123456789abcdef", ("0a1b2c3d", "4e5f6071")


def probe(clone: Workspace, trigger: Trigger = TRIGGER) -> contract.ProbeSource:
    models, observation = clone.fault_models(), clone.manifest("openpilot").observation
    settings = contract.build_probe_settings(MUTANT, trigger, trigger.hold, IDS, observation, 0.1)
    return contract.render_probe(models.probe_templates, settings)


def module(clone: Workspace) -> Any:
    made = types.ModuleType("_fi")
    exec(probe(clone).text, made.__dict__)
    return made


def see(fi: Any, *, near: bool) -> None:
    fi.observe(t=1.0 if near else 0.5, d_rel=20.0 if near else 200.0, v_ego=20.0, v_lead=15.0)
    assert fi.active(IDS[0]) is near


def test_the_decision_of_the_harness_agrees_with_the_probe(clone: Workspace) -> None:
    made = probe(clone)
    module: dict[str, Any] = {}
    exec(made.text, module)
    draw = random.Random(7)
    rows = [
        (draw.uniform(0.0, 0.5), draw.uniform(0.0, 50.0), draw.choice((0.0, 20.0)), 15.0) for _ in range(200)
    ]
    for values, is_active in zip(
        rows, is_active_at_observations(made.armed_condition, np.array(rows).T), strict=True
    ):
        module["_run"] = module["_Run"]()
        module["observe"](*values)
        assert module["_run"].active == is_active


def test_the_templates_of_settings_and_code_make_one_template(clone: Workspace) -> None:
    """The ids of all mutants depend on its text, so whoever changes the probe changes this digest, too."""
    text = clone.fault_models().probe_templates.whole_text
    assert digest(text.encode()) == "f7fd453196acd9ef0857e4c1a8f95095e4a811ebf8979f053311b6cc01f266cd"


@pytest.mark.parametrize("counted", [False, True])
@pytest.mark.parametrize("sets", [False, True])
def test_parts_rendered_alone_equal_the_whole_template_rendered(
    clone: Workspace, sets: bool, counted: bool
) -> None:
    models, observation = clone.fault_models(), clone.manifest("openpilot").observation
    if counted:
        observation = replace(observation, time=None)
    settings = contract.build_probe_settings(MUTANT, TRIGGER, TRIGGER.hold, IDS, observation, 0.1, sets=sets)
    assert contract.render_probe(models.probe_templates, settings).text == render_template(
        models.probe_templates.whole_text, vars(settings), models.folder
    )


def test_templates_whose_marks_do_not_fit_are_refused(toycar: Workspace) -> None:
    path = toycar.templates / CODE_TEMPLATE_FILE
    path.write_text(path.read_text().replace("{# settings #}\n", "", 1))
    with pytest.raises(
        MutatorError,
        match=rf"{SETTINGS_TEMPLATE_FILE}: 3 parts of settings; expected 2, .* in {CODE_TEMPLATE_FILE}",
    ):
        load_fault_models(toycar.templates)


@pytest.mark.parametrize(
    ("name", "text"), [(CODE_TEMPLATE_FILE, "class _Run:"), (SETTINGS_TEMPLATE_FILE, "def _condition(")]
)
def test_an_error_in_a_part_names_the_line_of_its_file(toycar: Workspace, name: str, text: str) -> None:
    path = toycar.templates / name
    before = path.read_text()
    path.write_text(before.replace(text, "{{ missing }}\n" + text))
    with pytest.raises(
        MutatorError, match=f"{name}:{before[: before.index(text)].count(chr(10)) + 1}: .*missing"
    ):
        build(toycar.manifest("toycar"), toycar.fault_models(), None, TRIGGER)


def test_probes_of_two_triggers_differ_only_in_their_settings(clone: Workspace) -> None:
    other = Trigger(name="x", condition="t >= 3.0", hold=Hold.FOR, hold_s=2.5, armed_after_s=1.0)
    rests, found = [], []
    for trigger in (TRIGGER, other):
        patch = "".join(f"+{line}\n" for line in probe(clone, trigger).text.splitlines())
        spans = list(probe_setting_spans(patch, 0, len(patch)))
        found.append({name: patch[begin:end] for begin, end, name in spans})
        for begin, end, _ in reversed(spans):
            patch = patch[:begin] + patch[end:]
        rests.append(patch)
    assert rests[0] == rests[1]
    assert found[1] == {
        "mutant": "0123456789abcdef",
        "id": "4e5f6071",
        "hold": "for",
        "hold_s": "2.5",
        "armed_after_s": "1.0",
        "condition": "t >= 3.0",
    }


def test_holding_a_fault_for_a_time_requires_a_duration(clone: Workspace) -> None:
    observation = clone.manifest("openpilot").observation
    with pytest.raises(MutatorError, match="without a time"):
        contract.build_probe_settings(
            "m", Trigger(name="x", condition="True"), Hold.FOR, (), observation, 0.1
        )


def test_a_condition_with_an_unknown_name_is_refused(clone: Workspace) -> None:
    observation, trigger = clone.manifest("openpilot").observation, Trigger(name="x", condition="speed > 1.0")
    with pytest.raises(MutatorError, match=r"unknown name 'speed' in 'speed > 1.0'; .* d_rel, v_ego, v_lead"):
        contract.build_probe_settings("m", trigger, Hold.WHILE, (), observation, 0.1)


NEVER = {"first": None, "last": None, "count": 0}
RAN = {"first": 0.5, "last": 2.0, "count": 3}


@pytest.mark.parametrize(
    "report", [{}, {"injections": {}}, {"injections": {"a": NEVER}}, {"injections": None}]
)
def test_a_report_without_an_active_injection_has_no_activation(report: dict[str, Any]) -> None:
    assert contract.activation_of(report) is None


def test_activations_of_all_injections_are_added(clone: Workspace) -> None:
    early = {"first": 0.25, "last": 0.75, "count": 1}
    report = {"injections": {"a": RAN, "b": early, "c": NEVER}}
    assert contract.activation_of(report) == ObservedActivation(first=0.25, last=2.0, count=4)
    fi = module(clone)
    for read in (contract.was_triggered, contract.activation_of):
        assert read(fi.report()) == read(contract.untriggered_report(MUTANT))  # type: ignore[operator]
    see(fi, near=True)
    assert contract.was_triggered(fi.report())
    assert not contract.was_triggered(None)


SOUND = {
    "mutant": "m",
    "triggered": {"first": 0.5, "last": 2.0, "steps": 9},
    "injections": {"a": RAN, "b": NEVER},
}


def test_valid_reports_have_no_findings(clone: Workspace) -> None:
    assert contract.report_problem(SOUND, "m", ("a", "b")) == ""
    fi = module(clone)
    for near in (False, True):
        see(fi, near=near)
        assert contract.report_problem(json.loads(json.dumps(fi.report())), MUTANT, IDS) == ""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (None, "no report"),
        ("x", "no report"),
        ([1], "no report"),
        ({"mutant": "n"}, "not the one of this mutant"),
        ({"mutant": None}, "not the one of this mutant"),
        ({"injections": None}, "not its own"),
        ({"injections": {"a": RAN}}, "not its own"),
        ({"injections": {"a": RAN, "b": NEVER, "c": NEVER}}, "not its own"),
        ({"injections": {"a": RAN, "b": None}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"first": None}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"first": math.nan}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"last": math.inf}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"last": 0.25}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"last": "2"}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"count": 2.0}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"count": True}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"count": -1}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": RAN | {"count": 0}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": NEVER | {"count": False}}}, "the injections is damaged"),
        ({"injections": {"a": RAN, "b": {}}}, "the injections is damaged"),
        ({"triggered": {}}, "the trigger is damaged"),
        ({"triggered": {"first": None, "last": None, "steps": 0}}, "the trigger is damaged"),
        ({"triggered": 7}, "the trigger is damaged"),
        ({"triggered": None}, "its trigger was not"),
    ],
)
def test_damaged_reports_are_detected(change: Any, said: str) -> None:
    report = SOUND | change if isinstance(change, dict) else change
    assert said in contract.report_problem(report, "m", ("a", "b"))
