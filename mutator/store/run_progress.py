"""The progress of a run."""

import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from mutator.model import Status
from mutator.store.line_tail import LineTail


@dataclass(kw_only=True)
class Progress:
    """The progress of a run in its current stage."""

    stage: str  #: `plan`, `checks`, `golden`, `experiments`, `proof`, `tables`, `pictures` or `report`
    detail: str = ""  #: the step on which the stage is working
    done: int = 0  #: completed steps of the stage
    total: int = 0  #: total steps of the stage; 0: nothing to count
    outcomes: Counter[str] = field(default_factory=Counter)  #: experiments by outcome or status
    per_s: float | None = None  #: steps per second since the first was finished
    remaining_s: float | None = None  #: estimated time in s to the end of the stage


ProgressCallback = Callable[[Progress], None]
FIRST_STEPS_S = 1.0  # workers that started together finish their first steps within this time


class StagePace:
    """Measure the rate of a stage; `finished_before` of `total` steps were completed earlier.

    The clock starts with the first finished steps, because the time before includes the workers' start. There
    is a rate as soon as as many steps again are finished.
    """

    def __init__(self, stage: str, total: int, finished_before: int = 0) -> None:
        self._stage, self._total = stage, total
        self._finished_before = self._finished_first = finished_before
        self._started_at: float | None = None

    def progress_at(
        self, finished: int, *, detail: str = "", outcomes: Counter[str] | None = None
    ) -> Progress:
        per_s = self._measure(finished, time.monotonic())
        return Progress(
            stage=self._stage,
            detail=detail,
            done=finished,
            total=self._total,
            outcomes=outcomes or Counter(),
            per_s=per_s,
            remaining_s=(self._total - finished) / per_s if per_s else None,
        )

    def _measure(self, finished: int, now: float) -> float | None:
        """Return the number of steps per second since the first ones were finished; None if not yet known."""
        if finished == self._finished_before:
            return None
        if self._started_at is None:
            self._started_at = now
        elapsed_s = now - self._started_at
        if elapsed_s < FIRST_STEPS_S:
            self._finished_first = finished
        finished_since = finished - self._finished_first
        is_measured = finished_since and finished_since >= self._finished_first - self._finished_before
        return finished_since / elapsed_s if is_measured else None


class RecordTail:
    """Follow the records of a run as workers append them, reading each byte once."""

    def __init__(self, stage: str, run: Path, kind: str, total: int) -> None:
        self._lines = LineTail(run, kind)
        self._label_by_experiment: dict[str, str] = {}
        self._read_new_lines()
        self._pace = StagePace(stage, total, len(self._label_by_experiment))

    def poll(self) -> Progress:
        self._read_new_lines()
        return self._pace.progress_at(
            len(self._label_by_experiment), outcomes=Counter(self._label_by_experiment.values())
        )

    def _read_new_lines(self) -> None:
        for line in self._lines.read_new_lines():
            self._count_record(line)

    def _count_record(self, line: bytes) -> None:
        try:
            data = json.loads(line)
            name = progress_label(data["status"], data["outcome"])
            if name != Status.HARNESS_ERROR or data["experiment_id"] not in self._label_by_experiment:
                self._label_by_experiment[data["experiment_id"]] = name
        except (ValueError, KeyError):  # a head, or damage that `load_records` reports
            return


def progress_label(status: str, outcome: str | None) -> str:
    """Return an experiment's label in Progress: its outcome or, without one, its status."""
    return str(outcome or status)
