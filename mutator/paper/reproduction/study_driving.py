"""Drives the campaigns of the study, or goes on with them, in the run folders of one study folder."""

from collections.abc import Callable, Iterable
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import make_folder, read_json, write_json
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.paper.reproduction.study_campaigns import StudyCampaign
from mutator.paper.reproduction.study_clone import StudyClone, files_deciding_runs
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE
from mutator.workspace import Workspace

STUDY_FILE, STUDY_SCHEMA = "study.json", "study/1"


def run_path(out: Path, campaign: StudyCampaign) -> Path:
    return out / "runs" / campaign.name


def is_driven(out: Path, campaign: StudyCampaign) -> bool:
    """Return whether a study folder has a finished run of the campaign."""
    run = run_path(out, campaign)
    return RunFolder.exists(run) and RunFolder.open(run).is_finished


def open_study(out: Path, clone: StudyClone, commit_elsewhere: str = "") -> str:
    """Begin a study in a new folder, or go on with one; return the commit that its runs are of: in a new
    folder, that of runs elsewhere, if the same files decide them. MutatorError if the clone has changes, or
    if a file that decides runs has changed since the commit.
    """
    clone.check_unchanged()
    file = out / STUDY_FILE
    if not file.exists():
        make_folder(out)
        commit = commit_elsewhere if clone.decides_runs_as(commit_elsewhere) else clone.commit
        write_json(file, {"schema": STUDY_SCHEMA, "commit": commit})
    commit = commit_of_study(out)
    if changed := files_deciding_runs(clone.files_changed_since(commit)):
        raise MutatorError(
            f"a study of commit {commit[:12]}",
            where=out,
            expected=f"the files that decide runs as in {clone.commit[:12]}, which is checked out "
            f"({len(changed)} differ, such as {changed[0]})",
            remedy="check out the commit of the study, or use a new folder",
        )
    return commit


def commit_of_study(out: Path) -> str:
    """Return the commit that the runs of a study folder are of. MutatorError if the folder does not say."""
    commit = read_json(out / STUDY_FILE, STUDY_SCHEMA).get("commit")
    if not isinstance(commit, str):
        raise MutatorError("no commit", where=out / STUDY_FILE, expected="the commit of the study's runs")
    return commit


def drive_study(
    workspace: Workspace,
    campaigns: Iterable[StudyCampaign],
    out: Path,
    *,
    workers: int,
    tell: Callable[[str], None],
) -> None:
    """Drive each campaign that is not finished, also after one with a failed check or harness errors.
    MutatorError at the end if one stays unfinished; at once if it is interrupted, the disk is full, or a
    worker died.
    """
    problems = []
    for campaign in campaigns:
        run = run_path(out, campaign)
        if is_driven(out, campaign):
            finished_folder(out, campaign, workspace)
            tell(f"{campaign.name}: finished")
            continue
        tell(f"{campaign.name}: driving, in {run}")
        file = campaign.write(workspace, out)
        try:
            summary = run_campaign(workspace, file, run, workers=workers, choices=campaign.choices)
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


def finished_folder(out: Path, campaign: StudyCampaign, workspace: Workspace) -> RunFolder:
    """Return the verified run folder of a campaign. MutatorError if it is missing, unfinished or changed, or
    is that of another campaign.
    """
    folder = RunFolder.open(run_path(out, campaign))
    if not folder.is_finished:
        raise MutatorError("not finished", where=folder.path, remedy="drive it: leave out `--check`")
    if problems := folder.problems():
        raise problems[0]
    text = read_bounded(folder.path / CAMPAIGN_FILE)
    if text != campaign.text(workspace).encode() or folder.head.choices != campaign.choices:
        raise MutatorError(
            f"not the campaign '{campaign.name}' of the study",
            where=folder.path,
            expected="the campaign and the choices with which the study drives it",
            remedy="remove the folder, and drive it again",
        )
    return folder
