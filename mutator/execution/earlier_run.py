"""The run folder of `--since` and `--last-failed`, as a session uses it."""

import sys
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mutator.engines.engine_jobs import RunMode
from mutator.errors import MutatorError
from mutator.model import Outcome, Status
from mutator.store.records import endings_of
from mutator.store.run_folder import RunFolder

_MOST_LISTED_REASONS = 3
NOT_RECORDED_REASON = "what they executed was not recorded"
CAN_RECORD_CODE = sys.version_info >= (3, 12)  # with `sys.monitoring`
NO_RECORDING_TEXT = (
    f"Python {sys.version_info[0]}.{sys.version_info[1]} cannot tell what a run executes, as Python 3.12 can"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class EarlierRunUse:
    """What a session does with an earlier run: leave out what a change cannot affect, run what failed there.

    `since` is the earlier run, if there is one; otherwise, what failed is what failed in the own folder.
    `unproved_records` is as in `ReuseAssignment`.
    """

    since: RunFolder | None = None
    last_failed: bool = False
    unproved_records: Mapping[str, str] = field(default_factory=dict)

    def check_target(self, folder: RunFolder) -> None:
        """Raise MutatorError if the earlier run has another target than the folder."""
        if self.since and self.since.head.target != folder.head.target:
            raise MutatorError(
                f"a run of the target {self.since.head.target}",
                where=self.since.path,
                argument="since",
                expected=f"a run of the target {folder.head.target}",
                remedy="give an earlier run of this target",
            )

    def selected_ids(self, folder: RunFolder) -> Collection[str] | None:
        """Return the experiments to run; None for all: as with pytest, also if none has failed."""
        return _failed_experiments(self.since or folder) or None if self.last_failed else None

    def count_left_out(self, folder: RunFolder, worker_prefix: str) -> tuple[int, str]:
        """Return how many experiments the workers whose names begin so left out, and a sentence about them;
        0 and an empty text without an earlier run.
        """
        if not self.since:
            return 0, ""
        left_out, reasons = _left_out_and_reasons(folder, worker_prefix)
        return left_out, f"since {self.since.path.name}: {describe_left_out(left_out, reasons)}"


def open_earlier_run(earlier_run: Path, out: Path) -> RunFolder:
    """Open and verify the run folder of `--since`; MutatorError if it is none, or `out` itself."""
    if earlier_run.resolve() == out.resolve():
        raise MutatorError(
            "the folder of this run itself",
            where=earlier_run,
            argument="since",
            expected="the folder of an earlier run",
            remedy="leave out `since` to resume a run, or give another folder for the new one",
        )
    return RunFolder.open(earlier_run)


def left_out_of_whole_run(folder: RunFolder) -> str:
    """Return what `--since` left out in all sessions of a run; empty if none had an earlier run."""
    left_out, reasons = _left_out_and_reasons(folder, "")
    return describe_left_out(left_out, reasons) if left_out or reasons else ""


def _left_out_and_reasons(folder: RunFolder, worker_prefix: str) -> tuple[int, Counter[str]]:
    """Return how many experiments were left out, and how many ran for each reason."""
    left_out, reasons = 0, Counter[str]()
    for line in folder.timings().values():
        if line["worker"].startswith(worker_prefix):
            left_out += line["engine"] == RunMode.UNAFFECTED.value
            if reason := line.get("affected"):
                reasons[reason] += 1
    return left_out, reasons


def describe_left_out(left_out: int, reasons: Mapping[str, int]) -> str:
    """Return how many experiments `--since` left out, and why the others ran."""
    count = left_out + sum(reasons.values())
    text = f"{left_out:,} of {count:,} left out"
    if not CAN_RECORD_CODE and reasons.keys() <= {NOT_RECORDED_REASON} and not left_out:
        return f"{text}: {NO_RECORDING_TEXT}"
    text += ", because nothing that they executed has changed" if left_out else ""
    listed = sorted(reasons.items(), key=lambda item: (-item[1], item[0]))
    texts = [f"{reason} ({number:,})" for reason, number in listed[:_MOST_LISTED_REASONS]]
    if more := sum(number for _, number in listed[_MOST_LISTED_REASONS:]):
        texts.append(f"other reasons ({more:,})")
    return f"{text}; the others ran: {', '.join(texts)}" if texts else text


def _failed_experiments(folder: RunFolder) -> frozenset[str]:
    """Return the ids of the experiments with a hazard, and of those whose run did not end normally."""
    return frozenset(
        ending.experiment_id
        for ending in endings_of(folder.records())
        if ending.status not in (Status.OK.value, Status.LEFT_OUT.value)
        or ending.outcome == Outcome.HAZARD.value
    )
