"""`--require-reviewed`: what is not approved as it is now does not start."""

from pathlib import Path

import pytest

from mutator.campaigns.freezing import freeze
from mutator.campaigns.plans import Choices, Plan, make_plan
from mutator.errors import CheckFailed
from mutator.execution.running import run_campaign
from mutator.review import gate
from mutator.review.catalogue import of_plan
from mutator.review.decisions import Verdict, load_review
from mutator.workspace import Workspace


@pytest.fixture
def plan(toycar: Workspace) -> Plan:
    return make_plan(toycar, "small", Choices(limit=2))


def decide(toy: Workspace, plan: Plan, verdict: Verdict = Verdict.APPROVED, count: int | None = None) -> None:
    """Approve or reject the groups of the plan, or the first `count` of them."""
    groups = of_plan(toy, plan)[:count]
    load_review(toy, "toycar").decided(groups, verdict, f"Reviewer {count}", "").write()


def test_what_is_approved_may_run(toycar: Workspace, plan: Plan, tmp_path: Path) -> None:
    """The run folder keeps who approved what, and a report can say so."""
    run = freeze(plan, tmp_path / "run", toycar).path
    assert gate.approval_summary(run) == ""
    decide(toycar, plan)
    decide(toycar, plan, count=1)
    gate.write_approvals(run, gate.approvals(toycar, plan))
    total = len(of_plan(toycar, plan))
    assert gate.approval_summary(run) == (
        f"all of {total} groups approved, by Reviewer 1 (1), Reviewer None ({total - 1})"
    )


def test_what_is_not_is_named(toycar: Workspace, plan: Plan) -> None:
    """New, rejected and changed groups, each with its number of experiments, and what to do."""
    decide(toycar, plan)
    decide(toycar, plan, Verdict.REJECTED, count=1)
    template = toycar.templates / "omission.py.j2"
    template.write_text(template.read_text().replace("not ", "not not not "))
    with pytest.raises(CheckFailed) as caught:
        gate.approvals(toycar, make_plan(toycar, "small", Choices(limit=2, reading="as_coded")))
    review = load_review(toycar, "toycar")
    refused = [group for group in of_plan(toycar, plan) if review.state(group) != "approved"]
    for group in refused:
        assert f"{group.id}  {review.state(group)}, {group.runs} experiment" in caught.value.got
    assert caught.value.got.startswith(f"{len(refused)} groups" if len(refused) > 1 else "a group")
    assert "`mutator review walk --campaign small --reading as_coded --by NAME`" in str(caught.value.remedy)
    assert caught.value.exit_code == 1


def test_what_the_canary_alone_needs_is_told_as_such(toycar: Workspace, plan: Plan) -> None:
    """A group that none of the experiments is of is not told with a number of them."""
    alone = [group for group in of_plan(toycar, plan) if not group.runs]
    with pytest.raises(CheckFailed) as caught:
        gate.approvals(toycar, plan)
    assert alone
    assert all(f"{group.id}  new, the canary: " in caught.value.got for group in alone)


def test_a_file_of_the_users_is_named_by_its_path(toycar: Workspace, tmp_path: Path) -> None:
    """A campaign that the library does not have under that name, or has with another text."""
    mine = tmp_path / "my own.yaml"
    mine.write_text(toycar.campaign("small").read_text() + "\n# mine\n")
    with pytest.raises(CheckFailed) as caught:
        gate.approvals(toycar, make_plan(toycar, mine, Choices(limit=1)))
    assert f"--campaign '{mine}'" in str(caught.value.remedy)


def test_nothing_is_planned_without_approval(toycar: Workspace, tmp_path: Path) -> None:
    """A refused run leaves no plan behind, so that it can be given other options."""
    with pytest.raises(CheckFailed):
        run_campaign(toycar, "small", tmp_path / "run", reviewed=True)
    assert not (tmp_path / "run" / "run.json").exists()
