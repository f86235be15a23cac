"""A campaign that stays unfinished does not keep the others from being driven."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.errors import CheckFailed, MutatorError
from mutator.paper.reproduction import study_driving
from mutator.paper.reproduction.study_campaigns import STUDY, StudyCampaign
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

from .made_up_study import CLONE

DESCRIBED, CODED, *_ = STUDY


def drive(out: Path, lines: list[str]) -> None:
    workspace = Workspace.find(CLONE)
    study_driving.drive_study(workspace, STUDY, out, workers=1, tell=lines.append)


def test_a_failed_check_ends_only_its_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise CheckFailed("the canary reached no hazard")

    monkeypatch.setattr(study_driving, "run_campaign", fail)
    lines: list[str] = []
    with pytest.raises(MutatorError, match="ten_seeds: the canary reached no hazard"):
        drive(tmp_path, lines)
    assert sum(line.endswith("a check failed") for line in lines) == len(STUDY)


@pytest.mark.parametrize(
    ("problem", "is_interrupted", "driven_count"),
    [("", False, len(STUDY)), ("disk full", False, 1), ("", True, 1)],
)
def test_harness_errors_end_only_their_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, problem: str, is_interrupted: bool, driven_count: int
) -> None:
    """A full disk and an interrupt end the study."""
    summary = SimpleNamespace(
        problem=problem, interrupted=is_interrupted, describe_unfinished=lambda: "harness errors: 1"
    )
    monkeypatch.setattr(study_driving, "run_campaign", lambda *_, **__: summary)
    folder = SimpleNamespace(exists=lambda _: False, open=lambda _: SimpleNamespace(is_finished=False))
    monkeypatch.setattr(study_driving, "RunFolder", folder)
    lines: list[str] = []
    with pytest.raises(MutatorError, match="not finished: described: harness errors: 1"):
        drive(tmp_path, lines)
    assert sum(line.endswith("not finished") for line in lines) == driven_count


@pytest.mark.parametrize(
    ("campaign", "choices", "is_refused"),
    [(DESCRIBED, Choices(), False), (CODED, Choices(), True), (DESCRIBED, Choices(limit=100), True)],
)
def test_an_exchanged_run_folder_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    campaign: StudyCampaign,
    choices: Choices,
    is_refused: bool,
) -> None:
    """Before its rows are written under the name of another campaign."""
    workspace = Workspace.find(CLONE)
    path = study_driving.run_path(tmp_path, DESCRIBED)
    path.mkdir(parents=True)
    (path / "campaign.yaml").write_text(campaign.text(workspace))
    head = SimpleNamespace(choices=choices)
    folder: Any = SimpleNamespace(path=path, is_finished=True, problems=list, head=head)
    monkeypatch.setattr(
        study_driving, "RunFolder", SimpleNamespace(open=lambda _: folder, exists=lambda _: True)
    )
    if not is_refused:
        assert study_driving.finished_folder(tmp_path, DESCRIBED, workspace) is folder
        return
    with pytest.raises(MutatorError, match="not the campaign 'described' of the study"):
        study_driving.finished_folder(tmp_path, DESCRIBED, workspace)
    with pytest.raises(MutatorError, match="not the campaign 'described'"):  # also before driving others
        drive(tmp_path, [])
