"""Run a campaign again whenever its files are edited, and tell which verdicts have changed."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from mutator.campaigns.source_edits import SourceEdits, describe_edits
from mutator.engines.engine_choice import check_engine_is_offered
from mutator.errors import EXIT_CHECK_FAILED, EXIT_OK, EXIT_WRONG_INPUT, CheckFailed, MutatorError
from mutator.execution.earlier_run import CAN_RECORD_CODE, NO_RECORDING_TEXT
from mutator.execution.edit_watch import EditWatch
from mutator.execution.session_summary import Summary
from mutator.execution.watched_campaign import (
    PlannedPass,
    Verdict,
    WatchedCampaign,
    lock_watch_folder,
    verdict_of,
)
from mutator.model import Experiment, Record
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_columns import result_columns_of
from mutator.results.table_reader import frame_of_finished
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress
from mutator.workspace import Workspace

# what a user of this Python must know; empty if runs note what they execute
PYTHON_NOTE = (
    ""
    if CAN_RECORD_CODE
    else f"{NO_RECORDING_TEXT}: after an edit of the target, everything runs that is not stored"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewVerdict:
    """A verdict that the last pass did not have. `before`: what it had for this experiment, if anything."""

    experiment: Experiment
    row: ResultRow
    before: Verdict | None


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictChanges:
    """A part of a pass: new verdicts, worst first, and how many experiments have the verdict of before."""

    new: Sequence[NewVerdict]
    unchanged: int


class WatchDisplay(Protocol):
    """Shows what happens. All calls but `progress` come from the main thread."""

    def begin_pass(self, planned: PlannedPass, is_first: bool) -> None: ...
    def verdicts(self, changes: VerdictChanges) -> None: ...
    def end_pass(self, summary: Summary, removed: int) -> None: ...
    def nothing_affected(self) -> None: ...
    def edited(self, names: str, *, is_restart: bool) -> None: ...
    def error(self, error: MutatorError) -> None: ...
    def progress(self, progress: Progress) -> None: ...


def watch_campaign(
    workspace: Workspace,
    campaign: str | Path,
    folder: Path,
    display: WatchDisplay,
    *,
    choices: Choices,
    workers: int,
    engine: str | None = None,
) -> int:
    """Run the campaign, and again after each edit, until Ctrl-C; return the exit code of the last pass.

    `folder` gets the runs `now` and `before`. MutatorError before the first pass: for a folder that has
    something else or is in use, and an engine that does not exist.
    """
    check_engine_is_offered(engine)
    with lock_watch_folder(folder):
        workspace.campaign(campaign)  # raises if there is none
        passes = WatchedCampaign(workspace, campaign, folder, choices=choices, workers=workers, engine=engine)
        with EditWatch(SourceEdits(workspace, campaign).find) as edits:
            loop = _WatchLoop(passes, edits, display, workspace.library.parent)
            with suppress(KeyboardInterrupt):
                loop.run()
    return loop.exit_code


class _WatchLoop:
    def __init__(
        self, passes: WatchedCampaign, edits: EditWatch, display: WatchDisplay, names_folder: Path
    ) -> None:
        self._passes, self._edits, self._display, self._names_folder = passes, edits, display, names_folder
        self.exit_code = EXIT_OK  # of the last pass that ended, or could not begin
        self._finished_exit_code = EXIT_OK
        self._has_passed = False

    def run(self) -> None:
        """Run passes until KeyboardInterrupt."""
        while True:
            is_restart = not self._try_pass()
            names = describe_edits(self._edits.wait(), self._names_folder)
            self._display.edited(names, is_restart=is_restart)

    def _try_pass(self) -> bool:
        """Run a pass; return whether it ended, or cannot begin before an edit."""
        try:
            self._pass()
        except MutatorError as error:
            if self._edits.settle():  # it was edited while it was read
                return False
            if error.argument is not None and not self._has_passed:  # no edit makes it right
                raise
            is_failed_check = isinstance(error, CheckFailed)
            self.exit_code = EXIT_CHECK_FAILED if is_failed_check else EXIT_WRONG_INPUT
            self._display.error(error)
        except KeyboardInterrupt:
            if self._edits.has_interrupted:
                return False
            raise
        return True

    def _pass(self) -> None:
        planned = self._passes.plan()
        if self._passes.is_finished(planned):
            self.exit_code = self._finished_exit_code
            self._display.nothing_affected()
            return
        self._display.begin_pass(planned, not self._has_passed)
        before = dict(self._passes.verdicts)
        by_id = {experiment.id: experiment for experiment in planned.plan.experiments}

        def show(records: Sequence[Record]) -> None:
            folder = RunFolder(self._passes.run_path)
            new = [r for r in records if before.get(r.experiment_id) != verdict_of(r)]
            rows = _rows_worst_first(folder, [(by_id[r.experiment_id], r) for r in new])
            verdicts = [
                NewVerdict(experiment=by_id[row.experiment_id], row=row, before=before.get(row.experiment_id))
                for row in rows
            ]
            self._display.verdicts(VerdictChanges(new=verdicts, unchanged=len(records) - len(new)))

        self._passes.make_room()
        with self._edits.interrupting():
            summary = self._passes.run(planned, show, self._display.progress)
        self._has_passed, self.exit_code = True, summary.exit_code
        self._finished_exit_code = summary.exit_code
        self._display.end_pass(summary, len(before.keys() - by_id.keys()))


def _rows_worst_first(folder: RunFolder, ended: Sequence[tuple[Experiment, Record]]) -> list[ResultRow]:
    if not ended:
        return []
    scale = folder.severity_scale
    finished = [FinishedExperiment(experiment, record, scale) for experiment, record in ended]
    head = folder.head
    frame = frame_of_finished(result_columns_of(folder), finished, head.hazards, head.families)
    order = worst_first_ranks(frame).argsort().tolist()
    return rows_of(frame.iloc[order], {e.fault.id: e.fault for e, _ in ended})
