"""Drives the campaigns of the study, or goes on with them, in the run folders of one study folder."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from mutator._common.files import make_folder, read_json, write_json
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.paper.reproduction.study_campaigns import StudyCampaign
from mutator.paper.reproduction.study_clone import StudyClone
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

STUDY_FILE, STUDY_SCHEMA = "study.json", "study/1"


def run_path(out: Path, campaign: StudyCampaign) -> Path:
    return out / "runs" / campaign.name


def is_driven(out: Path, campaign: StudyCampaign) -> bool:
    """Return whether a study folder has a finished run of the campaign."""
    run = run_path(out, campaign)
    return RunFolder.exists(run) and RunFolder.open(run).is_finished


def open_study(out: Path, clone: StudyClone) -> None:
    """Begin a study in a new folder, or go on with one. MutatorError if it belongs to another commit, or if
    the clone has changes.
    """
    clone.check_unchanged()
    file = out / STUDY_FILE
    if not file.exists():
        make_folder(out)
        write_json(file, {"schema": STUDY_SCHEMA, "commit": clone.commit})
        return
    if (commit := read_json(file, STUDY_SCHEMA).get("commit")) != clone.commit:
        raise MutatorError(
            f"a study of commit {str(commit)[:12]}",
            where=out,
            expected=f"one of {clone.commit[:12]}, the commit that is checked out",
            remedy="check out the commit of the study, or use a new folder",
        )


def drive_study(
    workspace: Workspace,
    campaigns: Iterable[StudyCampaign],
    out: Path,
    *,
    workers: int,
    choices: Choices,
    tell: Callable[[str], None],
) -> None:
    """Drive each campaign that is not finished, also after one with a failed check or harness errors.
    `choices.limit` is that of each seed. MutatorError at the end if one stays unfinished; at once if it is
    interrupted, the disk is full, or a worker died.
    """
    problems = []
    for campaign in campaigns:
        run = run_path(out, campaign)
        if is_driven(out, campaign):
            tell(f"{campaign.name}: finished")
            continue
        tell(f"{campaign.name}: driving, in {run}")
        file = campaign.write(workspace, out)
        of_campaign = replace(choices, limit=choices.limit and choices.limit * campaign.seed_count)
        try:
            summary = run_campaign(workspace, file, run, workers=workers, choices=of_campaign)
        except CheckFailed as err:
            problems.append(f"{campaign.name}: {err}")
            tell(f"{campaign.name}: a check failed")
            continue
        if RunFolder.open(run).is_finished:
            tell(f"{campaign.name}: finished, {summary.ran:,} experiments in {summary.elapsed_s:,.0f} s")
            continue
        problems.append(f"{campaign.name}: {summary.describe_unfinished()}")
        tell(f"{campaign.name}: not finished")
        if summary.interrupted or summary.problem:
            break
    if problems:
        raise MutatorError(
            f"not finished: {'. '.join(problems)}",
            where=out,
            remedy="repeat the command: it goes on where it stopped",
        )


def finished_folders(out: Path, campaigns: Iterable[StudyCampaign]) -> dict[str, RunFolder]:
    """Return the verified run folders by campaign. MutatorError if one is missing, unfinished or changed."""
    folders = {}
    for campaign in campaigns:
        folder = RunFolder.open(run_path(out, campaign))
        if not folder.is_finished:
            raise MutatorError("not finished", where=folder.path, remedy="drive it: leave out `--check`")
        if problems := folder.problems():
            raise problems[0]
        folders[campaign.name] = folder
    return folders
