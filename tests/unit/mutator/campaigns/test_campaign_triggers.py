"""Campaigns that list their triggers, and libraries without a hazard analysis."""

from pathlib import Path

import pytest

from mutator.api.mutant_files import MutantSet
from mutator.api.target_and_fault_selection import context_or_parsed_trigger
from mutator.campaigns.plan import build_plan
from mutator.checks.library_check import library_problems
from mutator.errors import MutatorError
from mutator.model import Hold, Method
from mutator.workspace import Workspace


def edit(pole: Workspace, old: str, new: str) -> Path:
    path = pole.library / "campaigns" / "upright.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


TRIGGERS = """triggers:
  list: [always, {at_s: 2}, {when: abs(angle) < 0.02 and t > 0.5, hold_s: 0.5}]
  armed_after_s: 0.1
  random_until_s: 5
"""


def listed(pole: Workspace, triggers: str, methods: str = "[guided]") -> Path:
    """Write the pole's campaign with the given triggers, which begin on line 9."""
    edit(pole, "methods: [guided, random]", f"methods: {methods}")
    return edit(pole, TRIGGERS, triggers)


def test_each_listed_trigger_is_planned(pole: Workspace) -> None:
    plan = build_plan(pole, "upright")
    assert len(plan.experiments) == 3 * 3 * 2
    found = {e.trigger.name: e.trigger for e in plan.experiments if e.method is Method.GUIDED}
    known = {n: (t.condition, t.hold, t.hold_s, t.armed_after_s) for n, t in found.items()}
    condition = "abs(angle) < 0.02 and t > 0.5"
    assert known == {
        "always": ("True", Hold.TO_END, None, 0.1),
        "at 2 s": ("t >= 2.0", Hold.TO_END, None, 0.0),
        condition: (condition, Hold.FOR, 0.5, 0.1),
    }
    random = [e.trigger for e in plan.experiments if e.method is Method.RANDOM]
    assert {trigger.name for trigger in random} == {f"random/{name}" for name in found}
    assert all(0.1 <= float(trigger.condition.removeprefix("t >= ")) <= 5.0 for trigger in random)


def test_triggers_can_be_a_plain_list(pole: Workspace) -> None:
    path = listed(pole, "triggers: [always, {when: angle > 0.1}]\n")
    path.write_text(path.read_text().replace("methods: [guided]\n", ""))
    manifest = pole.library / "targets" / "pole.yaml"
    manifest.write_text(manifest.read_text().replace("step_s: 0.02", "step_s: 0.02\narmed_after_s: 0.3"))
    plan = build_plan(pole, "upright")
    assert {(e.method, e.trigger.armed_after_s) for e in plan.experiments} == {(Method.GUIDED, 0.3)}
    edit(
        pole,
        "triggers: [always, {when: angle > 0.1}]",
        "triggers: {list: [{always: true}, {when: angle > 0.1}]}",
    )
    assert build_plan(pole, "upright").digest == plan.digest


def test_triggers_that_differ_only_in_the_hold_have_it_in_their_names(pole: Workspace) -> None:
    """Such triggers are different experiments; a trigger whose name is unique keeps it, and so its ids."""
    text = "triggers: [{at_s: 2}, {at_s: 2, hold_s: 1}, {at_s: 2, hold_s: 0.5}, {at_s: 3, hold_s: 1}]\n"
    listed(pole, text)
    plan = build_plan(pole, "upright")
    names = {e.trigger.name for e in plan.experiments}
    assert names == {"at 2 s", "at 2 s for 1 s", "at 2 s for 0.5 s", "at 3 s"}
    assert len({e.id for e in plan.experiments}) == len(plan.experiments)


@pytest.mark.parametrize(
    ("triggers", "methods", "said"),
    [
        ("triggers:\n  - always\n  - {when: angel > 0}\n", "[guided]", "11: unknown name 'angel' in"),
        ("triggers:\n  - always\n  - always\n", "[guided]", "11: 'always' is listed twice; expected each"),
        (
            "triggers:\n  - {at_s: 3, hold_s: 1}\n  - {at_s: 3, hold_s: 1}\n",
            "[guided]",
            "11: 'at 3 s for 1 s' is listed twice; expected each",
        ),
        ("triggers:\n  - always\n  - {at: 3}\n", "[guided]", "11: unknown key 'at'; expected one of always"),
        ("triggers:\n  - {hold_s: 3}\n", "[guided]", "10: .*one of `always`, `at_s` and `when`"),
        ("triggers:\n  - {at_s: 1, when: t > 3}\n", "[guided]", "10: .*one of `always`, `at_s` and `when`"),
        ("triggers:\n  - never\n", "[guided]", "10: 'never' for 'list'; expected a mapping"),
        ("triggers: []\n", "[guided]", "9: "),
        ("triggers: {random_until_s: 3}\n", "[guided]", "9: .*either a `table` or a `list`"),
        ("triggers: {table: x, list: [always]}\n", "[guided]", "9: .*either a `table` or a `list`"),
        ("triggers: {list: [always], rows: [C1]}\n", "[guided]", "9: .*`rows` only with a `table`"),
        ("triggers: [always]\n", "[random]", "`random_until_s` in `triggers` for random times"),
    ],
)
def test_a_mistake_in_the_list_is_reported_at_its_line(
    pole: Workspace, triggers: str, methods: str, said: str
) -> None:
    path = listed(pole, triggers, methods)
    with pytest.raises(MutatorError, match=said) as caught:
        build_plan(pole, "upright")
    assert caught.value.where == str(path)


def test_the_library_check_reports_invalid_conditions(pole: Workspace) -> None:
    assert library_problems(pole, "pole") == []
    listed(pole, "triggers: [{when: speed > 1}]\n")
    (problem,) = library_problems(pole, "pole")
    assert "unknown name 'speed'" in problem.got and problem.line == 9


def test_without_a_context_table_mutants_have_the_trigger_always(pole: Workspace) -> None:
    triggers = {trigger.name for _, trigger in MutantSet.of_specs(["sensor/angle"], workspace=pole).pairs}
    assert triggers == {"always"}
    with pytest.raises(MutatorError, match=r"expected a time in s, `always`, or a condition"):
        context_or_parsed_trigger(pole, "C1", 0.0, ("t",))
