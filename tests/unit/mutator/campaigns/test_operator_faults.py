"""Campaigns with operator mutants: plans, active times and refusals."""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from mutator.campaigns import operator_faults
from mutator.campaigns.campaign_files import load_campaign
from mutator.campaigns.plan import Plan, build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.limits import Limits
from mutator.model import Hold, Method
from mutator.operators.executed_lines_and_types import ExecutedLinesByFile, GoldenRunInputs
from mutator.review.mutant_groups import groups_of_plan
from mutator.store.plan_choices import Choices
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

ENTRY = "  - {operators: [arithmetic, branch], in: ['toycar/driver.py::Driver.*'], sample: 12}"


@pytest.fixture(autouse=True)
def lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pretend that golden runs execute lines 1 to 16 of the driver, instead of running them."""

    def known(
        manifest: TargetManifest, drives: Sequence[GoldenRunInputs], limits: Limits
    ) -> list[ExecutedLinesByFile]:
        return [{"toycar/driver.py": frozenset(range(1, 17))} for _ in drives]

    monkeypatch.setattr(operator_faults, "measure_executed_lines", known)


@pytest.fixture
def campaign(toycar: Workspace, tmp_path: Path) -> Path:
    """A campaign with only operator mutants."""
    text = toycar.campaign("small").read_text()
    begin, end = text.index("faults:"), text.index("methods:")
    text = f"{text[:begin]}faults:\n{ENTRY}\n{text[end:]}".replace("[guided, random]", "[random]")
    text = text.replace("  table: near_far\n", "  list: [always]\n  hold_s: 0.5\n")
    path = tmp_path / "operators.yaml"
    path.write_text(text)
    return path


def _edited(campaign: Path, old: str, new: str) -> Path:
    text = campaign.read_text()
    assert old in text
    campaign.write_text(text.replace(old, new))
    return campaign


def test_each_mutant_is_planned_as_permanent_and_as_transient(toycar: Workspace, campaign: Path) -> None:
    plan = build_plan(toycar, campaign)
    assert len({one.fault.id for one in plan.experiments}) == 12 == len(plan.experiments) / 2
    found = Counter((one.method, one.trigger.hold) for one in plan.experiments)
    assert found == {(Method.GUIDED, Hold.TO_END): 12, (Method.RANDOM, Hold.FOR): 12}
    permanent = [one for one in plan.experiments if one.trigger.name == "always"]
    assert len(permanent) == 12
    assert build_plan(toycar, campaign).digest == plan.digest
    [told] = plan.operator_notes
    assert told.startswith("toycar/driver.py::Driver.*: 12 draws of ")
    assert "in lines that no golden run executes" in told


def test_the_frozen_plan_lists_left_out_mutants(toycar: Workspace, campaign: Path, tmp_path: Path) -> None:
    plan = build_plan(toycar, campaign)
    folder = freeze_plan(plan, tmp_path / "run", toycar)
    assert load_plan(folder).operator_notes == plan.operator_notes == folder.head.operators
    other = freeze_plan(build_plan(toycar, "small"), tmp_path / "other", toycar)
    assert "operators" not in json.loads((other.path / "run.json").read_text())


def test_the_key_when_selects_permanent_or_transient_mutants(toycar: Workspace, campaign: Path) -> None:
    _edited(campaign, "sample: 12}", "sample: 2, when: [permanent]}\n  - spec: sensor/silence/no_data")
    kinds = Counter((one.fault.module, one.trigger.name) for one in build_plan(toycar, campaign).experiments)
    assert kinds == {("operators", "always"): 2, ("sensor", "random/always"): 1}
    _edited(campaign, "when: [permanent]", "when: [transient]")
    _edited(campaign, "list: [always]", "table: near_far")
    _edited(campaign, "[random]", "[guided]")
    kinds = Counter((one.fault.module, one.trigger.name) for one in build_plan(toycar, campaign).experiments)
    assert kinds[("operators", "near")] == 2 == kinds[("operators", "far")]


def test_selections_of_the_same_mutants_are_merged(toycar: Workspace, campaign: Path) -> None:
    both = {one.id for one in build_plan(toycar, campaign).experiments}
    entry = ENTRY.removesuffix("}")
    _edited(campaign, ENTRY, "\n".join(f"{entry}, when: [{name}]}}" for name in ("permanent", "transient")))
    assert {one.id for one in build_plan(toycar, campaign).experiments} == both


def test_another_seed_draws_other_mutants(toycar: Workspace, campaign: Path) -> None:
    drawn = [
        {one.fault.id for one in build_plan(toycar, campaign, Choices(seed=seed)).experiments}
        for seed in (3, 4)
    ]
    assert drawn[0] != drawn[1] and len(drawn[0]) == len(drawn[1])


def test_review_groups_do_not_depend_on_the_draw(toycar: Workspace, campaign: Path) -> None:
    def groups(plan: Plan) -> dict[str, object]:
        return {
            one.label: one.basis_digests for one in groups_of_plan(toycar, plan) if ": operator" in one.label
        }

    some = groups(build_plan(toycar, campaign))
    assert set(some) == {
        f"toycar/driver.py Driver.drive: operator {name}" for name in ("arithmetic", "branch")
    }
    _edited(campaign, "sample: 12", "sample: 30")
    assert groups(build_plan(toycar, campaign)) == some


def test_a_campaign_can_name_an_operator_of_another_package(
    toycar: Workspace, campaign: Path, door_examples: Path
) -> None:
    plan = build_plan(toycar, _edited(campaign, "[arithmetic, branch]", "[zero]"))
    assert {one.fault.fault_type for one in plan.experiments} == {"zero"}
    assert [one for one in groups_of_plan(toycar, plan) if one.label.endswith(": operator zero")]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("operators: [arithmetic, branch], ", "", "either a `spec` or `operators`"),
        ("{operators", "{spec: 'sensor/*', operators", "either a `spec` or `operators`"),
        ("in: ['toycar/driver.py::Driver.*'], ", "", "`operators` with `in`"),
        ("sample: 12", "sample: 12, values: 3", "without `values`"),
        ("sample: 12", "sample: 0", "greater than or equal to 1"),
        ("arithmetic, branch", "arithmetics", "'arithmetic', 'comparison'"),
        ("sample: 12", "when: [sometimes]", "'permanent' or 'transient'"),
        ("seed: 3", "seed: 3\nsample: 4\nproportional: true", "have their own `sample`"),
    ],
)
def test_a_wrong_selection_is_refused_with_its_line(campaign: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(MutatorError, match=r"operators\.yaml:\d+") as caught:
        load_campaign(_edited(campaign, old, new))
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("toycar/drivers.py", "no Python file 'toycar/drivers.py'"),
        ("toycar/driver.py::Drive", "no function 'Drive' in"),
        ("toycar/sensing.py", "no mutant in toycar/sensing.py"),
    ],
)
def test_a_place_without_mutants_is_refused_with_its_line(
    toycar: Workspace, campaign: Path, place: str, said: str
) -> None:
    _edited(campaign, "toycar/driver.py::Driver.*", place)
    with pytest.raises(MutatorError, match=r"operators\.yaml:7: ") as caught:
        build_plan(toycar, campaign)
    assert said in str(caught.value)
