"""The canary: whether it caused its hazard, and why not."""

from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.preflight.canary_check import run_until_hazard
from mutator.preflight.check_run_problems import CheckRun
from mutator.results.note_without_canary import no_canary_note
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


def test_a_canary_that_cannot_be_injected_names_the_cause(toycar: Workspace, tmp_path: Path) -> None:
    """An ambiguous anchor must not read as a harmless fault."""
    canary = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar).canary
    assert canary is not None

    def refuse(_: object) -> CheckRun:
        raise MutatorError("2 assignments to gap", where="go.py", expected="one", remedy="add `nth`")

    verdict = run_until_hazard([canary], refuse, "H3")
    assert verdict.problem == "cannot be injected: go.py: 2 assignments to gap; expected one; add `nth`"
    assert verdict.remedy == "correct the fault spec of the `canary`"


def test_a_canary_that_was_tried_is_called_harmless(toycar: Workspace, tmp_path: Path) -> None:
    """Its values are named, with the way out."""
    canary = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar).canary
    assert canary is not None
    verdict = run_until_hazard([canary], lambda _: CheckRun(problem=""), "H3")
    assert verdict.problem.startswith("did not reach H3 with any of its values: ")
    assert "another fault" in verdict.remedy


def without_canary(toycar: Workspace, tmp_path: Path) -> RunFolder:
    path = toycar.campaign("small")
    lines = [line for line in path.read_text().splitlines() if not line.startswith("canary")]
    start, end = lines.index("faults:"), lines.index("methods: [guided, random]")
    selection = "  - {operators: [arithmetic], in: ['toycar/*.py'], sample: 2}"
    path.write_text("\n".join([*lines[: start + 1], selection, *lines[end:]]) + "\n")
    return freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)


def test_a_campaign_of_operators_can_leave_out_the_canary(toycar: Workspace, tmp_path: Path) -> None:
    """Results then begin with what its runs show."""
    pd = pytest.importorskip("pandas")
    folder = without_canary(toycar, tmp_path)
    assert folder.canary is None
    assert folder.early_end_note == ""
    plan = build_plan(toycar, "small")
    assert plan.digest == folder.head.plan
    first, second = plan.experiments[:2]
    rows = [
        {
            "experiment_id": experiment.id,
            "fault_id": experiment.fault.id,
            "scenario": experiment.scenario,
            "trigger": experiment.trigger.name,
            "outcome": outcome,
        }
        for experiment, outcome in ((first, "sdc"), (second, "hazard"))
    ]
    note = no_canary_note(folder, pd.DataFrame(rows))
    assert f"the first that reached one is {second.id[:8]}: {second.fault.label} in A" in note
    assert no_canary_note(folder, pd.DataFrame(rows[:1])).endswith("and none of them reached one.")


def test_a_campaign_of_specs_needs_a_canary(toycar: Workspace) -> None:
    """Its author knows a harmful fault."""
    path = toycar.campaign("small")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith("canary")))
    with pytest.raises(MutatorError, match="expected a `canary`, because `faults` has a `spec`"):
        build_plan(toycar, "small")
