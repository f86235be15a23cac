"""With `--require-reviewed`, all groups of a plan must be approved."""

from pathlib import Path

import pytest

from mutator._common.version import VERSION
from mutator.campaigns.plan import Plan, build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import CheckFailed
from mutator.execution.campaign_running import run_campaign
from mutator.review import approval_gate
from mutator.review.mutant_groups import groups_of_plan
from mutator.review.review_state_and_actions import (
    ReviewAction,
    ReviewActionKind,
    load_review,
    record_actions,
)
from mutator.store.plan_choices import Choices
from mutator.store.recorded_approvals import approval_summary, write_approvals
from mutator.workspace import Workspace


@pytest.fixture
def plan(toycar: Workspace) -> Plan:
    return build_plan(toycar, "small", Choices(limit=2))


def decide(
    toy: Workspace, plan: Plan, kind: ReviewActionKind = ReviewActionKind.APPROVE, count: int | None = None
) -> None:
    changes = [
        ReviewAction(group=one, kind=kind, by=f"Reviewer {count}")
        for one in groups_of_plan(toy, plan)[:count]
    ]
    review = load_review(toy, "toycar")
    record_actions(
        toy, "toycar", changes, {change.group.id: review.revision(change.group.id) for change in changes}
    )


def test_the_run_folder_of_an_approved_plan_names_its_reviewers(
    toycar: Workspace, plan: Plan, tmp_path: Path
) -> None:
    run = freeze_plan(plan, tmp_path / "run", toycar).path
    assert approval_summary(run) == ""
    decide(toycar, plan)
    decide(toycar, plan, count=1)
    write_approvals(run, approvals := approval_gate.require_approvals(toycar, plan))
    for kept in approvals["groups"]:
        assert (kept["verdict"], kept["tool"], kept["commit"]) == ("approved", VERSION, None)
        assert kept["at"] and set(kept["bound"]) == {"diff", "function", "template", "calls"}
    total = len(groups_of_plan(toycar, plan))
    assert approval_summary(run) == (
        f"{total} groups approved by Reviewer 1 (1), Reviewer None ({total - 1})"
    )


SPEC_IN_DEFENCE = """\
schema: fault_spec/1
module: sensor
fault_type: weak
about: The emergency brake does not brake.
variants:
  brake:
    aim: H1
    about: The brake fails.
    as_described:
      injections:
        - at: {defence: emergency_brake, function: Model.update, entry: true}
          model: stuck
          unit: "1"
          params: {target: since_s, value: 0.0}
"""


def test_approvals_hold_with_defences_but_not_for_faults_in_them(toycar: Workspace) -> None:
    """A fault has the same lines in a defended tree; one in a defence is in no group's diff."""
    plan = build_plan(toycar, "defended", Choices(limit=2))
    decide(toycar, plan)
    assert approval_gate.require_approvals(toycar, plan)["groups"]
    (toycar.library / "faults" / "sensor" / "weak.yaml").write_text(SPEC_IN_DEFENCE)
    campaign = toycar.campaign("defended")
    text = campaign.read_text().replace("spec: sensor/silence/no_data", "spec: sensor/weak/brake")
    campaign.write_text(text)
    plan = build_plan(toycar, "defended")
    with pytest.raises(CheckFailed, match="sensor/weak/brake changes the defence emergency_brake"):
        approval_gate.require_approvals(toycar, plan)


def test_groups_without_approval_are_named(toycar: Workspace, plan: Plan) -> None:
    groups = groups_of_plan(toycar, plan)
    missing, changed, rejected = groups[0], groups[1], groups[-1]
    decide(toycar, plan)
    decide(toycar, plan, ReviewActionKind.CLEAR, count=1)
    review = load_review(toycar, "toycar")
    no = ReviewAction(group=rejected, kind=ReviewActionKind.REJECT, by="Joe")
    record_actions(toycar, "toycar", [no], {rejected.id: review.revision(rejected.id)})
    template = toycar.templates / f"{changed.models[0]}.py.j2"
    template.write_text(template.read_text() + "{# another #}\n")
    with pytest.raises(CheckFailed) as caught:
        approval_gate.require_approvals(
            toycar, build_plan(toycar, "small", Choices(limit=2, reading="as_coded"))
        )
    told = [line.split("  ")[2].partition(": ")[0] for line in caught.value.got.splitlines()[1:]]
    assert told[0].startswith("missing, ")
    assert all(line.startswith("changed (template), ") for line in told[1:-1]) and told[1:-1]
    assert told[-1].startswith("rejected by Joe on ") and told[-1].endswith(", 2 experiments")
    assert caught.value.got.startswith(f"{len(told)} groups")
    assert f"  {missing.id}  missing" in caught.value.got
    assert "`mutator review walk --campaign small --reading as_coded --by NAME`" in str(caught.value.remedy)
    assert caught.value.exit_code == 1


def test_groups_used_only_by_the_canary_have_no_count(toycar: Workspace, plan: Plan) -> None:
    alone = [group for group in groups_of_plan(toycar, plan) if not group.experiment_count]
    with pytest.raises(CheckFailed) as caught:
        approval_gate.require_approvals(toycar, plan)
    assert alone
    assert all(f"{group.id}  missing, the canary: " in caught.value.got for group in alone)


def test_a_users_own_file_is_named_by_its_path(toycar: Workspace, tmp_path: Path) -> None:
    mine = tmp_path / "my own.yaml"
    mine.write_text(toycar.campaign("small").read_text() + "\n# mine\n")
    with pytest.raises(CheckFailed) as caught:
        approval_gate.require_approvals(toycar, build_plan(toycar, mine, Choices(limit=1)))
    assert f"--campaign '{mine}'" in str(caught.value.remedy)


def test_a_refused_run_leaves_no_plan(toycar: Workspace, tmp_path: Path) -> None:
    with pytest.raises(CheckFailed):
        run_campaign(toycar, "small", tmp_path / "run", reviewed=True)
    assert not (tmp_path / "run" / "run.json").exists()


def test_a_resumed_run_does_not_need_the_campaigns_spec_file(toycar: Workspace, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    spec = (toycar.library / "faults/sensor/lane.yaml").read_text()
    (mine / "lane.yaml").write_text(spec.replace("fault_type: lane", "fault_type: mine"))
    campaign = toycar.campaign("small").read_text()
    (mine / "mine.yaml").write_text(
        campaign.replace("spec: sensor/lane/shifted, values", "spec: lane.yaml, values")
    )
    plan = build_plan(toycar, mine / "mine.yaml", Choices(only='fault_type == "mine"'))
    lane = groups_of_plan(toycar, plan)[0]
    assert lane.value_ranges == {"by": (0.0, 2.5)} and mine / "lane.yaml" in lane.source_files
    run = freeze_plan(plan, tmp_path / "run", toycar)
    decide(toycar, plan)
    (mine / "lane.yaml").unlink()
    assert approval_gate.require_approvals(toycar, load_plan(run))["groups"]
