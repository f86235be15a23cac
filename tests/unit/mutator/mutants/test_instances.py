"""Faults limited to some instances or executions."""

import types
from pathlib import Path
from typing import Any

import pytest

from mutator.config.instance_conditions import canonical_instance_condition
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults.injection_model import InjectionModel
from mutator.faults.injection_specs import InjectionSpec
from mutator.model import Anchor, AnchorKind, FaultLocation, Hold, Injection, Trigger
from mutator.mutants import injected_line_syntax
from mutator.mutants import probe_contract as contract
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, probe_import_edit, unsplice
from mutator.targets.observed_values import Observation
from mutator.workspace import Workspace

SOURCE = """def drive(lanes, seen):
    for index, lane in enumerate(lanes):
        gap = lane["gap"]
        seen.append((index, gap))
    return lanes
"""
AFTER = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="gap")
VALUE = Anchor(kind=AnchorKind.ASSIGNED_VALUE, name="gap")
SENT = Anchor(kind=AnchorKind.BEFORE_CALL, name="seen.append")


def mutant(clone: Workspace, anchor: Anchor, model: str = "offset", **given: Any) -> bytes:
    if model == "offset":
        target = (("target", "gap"),) if anchor is AFTER else ()
        given = {"params": (("by", 10.0), *target)} | given
    location = FaultLocation(path="m.py", function="drive", anchor=anchor)
    file = parse_file("m.py", SOURCE.encode(), Path("x"))
    edit = injection_edit(file, clone.fault_models(), Injection(location=location, model=model, **given), "a")
    data = mutated_bytes(apply_edits(file, as_line_edits(file, [probe_import_edit(file, None), edit])))
    assert unsplice(data) == file.data
    return data


def drive(clone: Workspace, data: bytes, times: tuple[float, ...]) -> tuple[list[list[int]], Any]:
    """Run steps at the given times, with a fault that is active from 1 s to 3 s. Return the three gaps of
    each step and the probe's report."""
    nowhere = FaultLocation(path="", function="f", anchor=Anchor(kind=AnchorKind.ENTRY))
    observation = Observation(location=nowhere, time="t", values=(), derived=())
    trigger = Trigger(name="test", condition="t >= 1 and t < 3")
    settings = contract.build_probe_settings("m", trigger, Hold.WHILE, ("a",), observation, 1.0)
    fi, models = types.ModuleType("_fi"), clone.fault_models()
    exec(contract.render_probe(models.probe_templates, settings).text, vars(fi))
    names: dict[str, Any] = {"_fi": fi}
    exec(data.replace(b"import _fi", b"pass"), names)
    seen = []
    for t in times:
        fi.observe(t=t)
        step: list[tuple[int, int]] = []
        names["drive"]([{"gap": 1}, {"gap": 2}, {"gap": 3}], step)
        seen.append([gap for _, gap in step])
    return seen, fi.report()["injections"]["a"]


@pytest.mark.parametrize("anchor", [AFTER, VALUE], ids=["statement", "value"])
@pytest.mark.parametrize(
    ("given", "active", "count"),
    [
        ({"where": "index == 1"}, [[1, 12, 3], [1, 12, 3]], 2),
        ({"where": "lane['gap'] in (1, 3) and not index == 0"}, [[1, 2, 13], [1, 2, 13]], 2),
        ({"where": "index > 5"}, [[1, 2, 3], [1, 2, 3]], 0),
        ({"call": 2}, [[1, 12, 3], [1, 2, 3]], 1),
        ({"call": 5}, [[1, 2, 3], [1, 12, 3]], 1),
        ({"every": 2}, [[1, 12, 3], [11, 2, 13]], 3),
        ({"where": "index > 0", "every": 3}, [[1, 2, 3], [1, 12, 3]], 1),
    ],
)
def test_a_fault_can_be_limited_to_instances_and_executions(
    clone: Workspace, anchor: Anchor, given: dict[str, Any], active: list[list[int]], count: int
) -> None:
    """Only executions that meet the condition are numbered, starting at the activation."""
    seen, told = drive(clone, mutant(clone, anchor, **given), (0.0, 1.0, 2.0, 3.0))
    assert seen == [[1, 2, 3], *active, [1, 2, 3]]
    assert told["count"] == count


def test_executions_are_counted_anew_in_each_run(clone: Workspace) -> None:
    seen, told = drive(clone, mutant(clone, AFTER, call=2), (0.0, 1.0, 3.0, 0.0, 1.0, 2.0))
    assert [step[1] for step in seen] == [2, 12, 2, 2, 12, 2]
    assert told["count"] == 1, "only the last run is counted"


def test_a_guard_omits_one_instance(clone: Workspace) -> None:
    data = mutant(clone, SENT, "omission", where="index == 0")
    assert drive(clone, data, (0.0, 1.0, 3.0))[0] == [[1, 2, 3], [2, 3], [1, 2, 3]]


def test_the_injected_line_checks_the_fault_first(clone: Workspace) -> None:
    lines = {
        AFTER: b'if _fi.on() and (index == 2) and _fi.every("a", 5) and _fi.active("a"):  # fi:a',
        VALUE: b'gap = (lane["gap"] + 10 if _fi.on() and (index == 2) and _fi.every("a", 5) and '
        b'_fi.active("a") else lane["gap"])  # fi:a was:        gap = lane["gap"]',
    }
    for anchor, line in lines.items():
        found = mutant(clone, anchor, where="index == 2", every=5).splitlines()
        assert line in [one.strip() for one in found]
    guarded = mutant(clone, SENT, "omission", call=3).splitlines()
    assert b'        if not (_fi.call("a", 3) and _fi.active("a")):  # fi:a guard:1' in guarded


def test_lines_with_a_selection_are_recognized_as_checking_the_probe(clone: Workspace) -> None:
    for anchor, model in ((AFTER, "offset"), (SENT, "omission")):
        data = mutant(clone, anchor, model, where="lane['gap'] == 2 or (index == 1)", call=2)
        tags = [
            tag for line in data.splitlines() if (tag := injected_line_syntax.tag_of(line)) and tag.id == "a"
        ]
        assert tags[0].is_guard
    data = mutant(clone, VALUE, where="lane['gap'] == 2", every=3)
    (tag,) = [
        t
        for line in data.splitlines()
        if (t := injected_line_syntax.tag_of(line)) and t.replaced_line is not None
    ]
    assert tag.changed_value_ids == ["a"]
    ((name, line, first, end),) = injected_line_syntax.changed_value_positions(data)
    assert name == "a"
    assert data.splitlines()[line - 1][first:end].endswith(
        b"""lane["gap"] + 10 if _fi.on() and (lane['gap'] == 2) and """
    )


@pytest.mark.parametrize(
    "text",
    [
        "f(x)",
        "x + 1 == 2",
        "(y := 2)",
        "[i for i in x]",
        "_fi.t == 1",
        "a = 1",
        "x == '# fi:a'",
        "lambda: 0",
        "",
    ],
)
def test_an_invalid_instance_condition_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".*"):
        canonical_instance_condition(text)


def test_an_unknown_name_or_an_unsuitable_model_is_refused(clone: Workspace) -> None:
    with pytest.raises(MutatorError, match=r"m.py:3: 'side' in `where` is not known in drive; .*index"):
        mutant(clone, AFTER, where="side == 'left'")
    params = (("per_step", 1.0), ("stays", True), ("target", "gap"))
    with pytest.raises(MutatorError, match=r"model drift, with these parameters, cannot be limited"):
        mutant(clone, AFTER, "drift", params=params, call=1)


def read(**given: Any) -> InjectionSpec:
    at = {"file": "m.py", "function": "f", "after_assign": "gap"}
    model = InjectionModel.model_validate({"at": at, "model": "omission", **given})
    return model.injection_spec(YamlSource(path=Path("spec.yaml"), data={}, lines={}), ())


def test_a_condition_is_stored_in_canonical_form() -> None:
    found = read(where='name=="left"  and not (index < 2)', every=3)
    assert (found.where, found.call, found.every) == ("name == 'left' and (not index < 2)", None, 3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"where": "f(x)"}, "f\\(x\\).*expected names, attributes"),
        ({"where": ""}, "expected names, attributes"),
        ({"call": 2, "every": 3}, "`call` and `every`; expected one of them"),
        (
            {"at": {"file": "m.py", "constant": "C"}, "where": "x == 1"},
            "`where` at a constant; expected no `where`",
        ),
        ({"at": {"file": "m.py", "function": "f", "default": "x"}, "call": 1}, "`call` at a default"),
    ],
)
def test_invalid_selections_in_yaml_are_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(MutatorError, match=words):
        read(**given)
