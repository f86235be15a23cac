"""The groups that a library or a campaign injects, and the parts that a decision about a group depends on."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.review.decision_basis_texts import fault_hunks
from mutator.review.mutant_groups import Group, groups_of_library, groups_of_plan
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

SENSOR = ("sensor/*",)
Groups = dict[str, Group]


def of_toy(toy: Workspace, *specs: str) -> Groups:
    groups = groups_of_library(toy, toy.manifest("toycar"), specs=specs or SENSOR)
    return {group.id: group for group in groups}


@pytest.fixture(scope="module")
def groups(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Groups:
    return of_toy(copy_toycar(tmp_path_factory.mktemp("groups")))


def test_variants_are_grouped_by_place_model_and_arguments(groups: Groups) -> None:
    sense = "toycar/sensing.py Sensor.sense"
    assert {group.label: (group.trigger_kinds, group.hold_kinds) for group in groups.values()} == {
        f"{sense} after_assign gap: offset(by, low, target=gap)": ("state or time", "to_end or while"),
        f"{sense} after_assign gap: offset(by, target=gap)": ("state or time", "to_end or while"),
        f"{sense} after_assign offset: offset(by, target=offset)": ("state or time", "to_end or while"),
        f"{sense} before_call self.publish: omission()": ("state or time", "to_end"),
        "the probe, observing at toycar/go.py Drive.step after_assign now": ("", ""),
    }


def test_a_group_is_the_same_in_a_campaign(toycar: Workspace, groups: Groups) -> None:
    picked = groups_of_plan(toycar, build_plan(toycar, "small", Choices(limit=3)))
    assert 1 < len(picked) <= 5
    for group in picked:
        assert group.basis_digests == groups[group.id].basis_digests
    probe = picked[-1]
    assert probe.label.startswith("the probe")
    assert probe.experiment_count == 3 == sum(group.experiment_count or 0 for group in picked[:-1])


def test_the_canary_is_reviewed_too(toycar: Workspace) -> None:
    """The canary runs before all experiments."""
    plan = build_plan(toycar, "small", Choices(only='fault_type == "silence" and method == "guided"'))
    canary = next(g for g in groups_of_plan(toycar, plan) if "after_assign offset" in g.label)
    assert canary.experiment_count == 0


def test_the_diff_has_only_the_lines_of_the_fault(groups: Groups) -> None:
    for group in groups.values():
        is_probe = group.label.startswith("the probe")
        assert ("_fi.observe" in group.diff) is ("+from toycar import _fi" in group.diff) is is_probe
    assert fault_hunks("") == ""


@pytest.mark.parametrize(
    ("file", "old", "new", "changed", "untouched"),
    [
        ("templates/offset.py.j2", "signed }}", "signed }} + 0.0", ["template", "diff"], "omission"),
        ("templates/omission.py.j2", "not ", "not not not ", ["template", "diff"], "offset"),
        ("tree/toycar/sensing.py", "gap = world.gap", "gap = world.gap * 1", ["target function", "diff"], ""),
        ("tree/toycar/sensing.py", "self.reading = (100.0", "self.reading = (99.0", [], "omission"),
        ("tree/toycar/sensing.py", '"""What', '"""Nearly all of what', [], "offset"),
        ("templates/_fi.py.j2", "_TINY = 1e-9", "_TINY = 1e-8", [], "offset"),
    ],
)
def test_a_decision_depends_on_template_function_and_diff(
    toycar: Workspace, groups: Groups, file: str, old: str, new: str, changed: list[str], untouched: str
) -> None:
    before = groups
    path = toycar.library.parent / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    after = of_toy(toycar)
    assert before.keys() == after.keys()
    found = {name: before[name].basis_digests.changed_parts(after[name].basis_digests) for name in before}
    faults = {name: what for name, what in found.items() if before[name].trigger_kinds}
    assert [] in faults.values() or untouched == ""
    assert {tuple(what) for what in faults.values()} <= {(), tuple(changed)}
    assert any(faults.values()) is bool(changed)
    for name, group in before.items():
        if untouched and untouched in group.label:
            assert not found[name]
    probe = next(name for name in before if not before[name].trigger_kinds)
    assert bool(found[probe]) is file.endswith("_fi.py.j2")


def test_a_decision_does_not_depend_on_drawn_values(toycar: Workspace, groups: Groups) -> None:
    other = groups_of_library(toycar, toycar.manifest("toycar"), specs=SENSOR, seed=1)
    assert [group.basis_digests for group in other] == [group.basis_digests for group in groups.values()]
    assert [group.value_ranges for group in other] == [group.value_ranges for group in groups.values()]
    assert [group.faults for group in other] != [group.faults for group in groups.values()]


def test_a_drawn_choice_has_a_diff_for_each_choice(toycar: Workspace) -> None:
    template = toycar.templates / "offset.py.j2"
    text = template.read_text()
    template.write_text(text + "{% if by > 30 %}\n    {{ target }} = {{ target }}\n{% endif %}\n")
    found = of_toy(toycar, "sensor/distance").values()
    both = next(group for group in found if "offset(by, target=gap)" in group.label)
    assert len(both.shapes) == 2
    assert sorted(m for shape in both.shapes for m in shape.member_ids) == sorted(f.id for f in both.faults)


def test_specs_are_selected_by_globs_and_files(toycar: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text((toycar.library / "faults/sensor/lane.yaml").read_text())
    by_file, by_name = of_toy(toycar, str(path)), of_toy(toycar, "sensor/l*")
    assert by_file.keys() == by_name.keys()
    with pytest.raises(MutatorError, match="no fault spec 'sensor/none'"):
        of_toy(toycar, "sensor/none")


def test_an_id_includes_the_target(toycar: Workspace, groups: Groups) -> None:
    other = groups_of_library(toycar, replace(toycar.manifest("toycar"), name="other"), specs=SENSOR)
    assert {group.label for group in other} == {group.label for group in groups.values()}
    assert not {group.id for group in other} & groups.keys()


@pytest.mark.slow
def test_the_whole_library_has_at_most_80_groups(clone: Workspace) -> None:
    groups = groups_of_library(clone, clone.manifest("openpilot"))
    assert 50 < len(groups) <= 80
    assert len({group.id for group in groups}) == len(groups)
    grouped = sorted(fault.id for group in groups for fault in group.faults)
    readings = clone.readings().names
    assert grouped == sorted({fault.id for reading in readings for fault in clone.faults(reading=reading)})
