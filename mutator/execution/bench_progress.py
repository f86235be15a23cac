"""How far an open bench is, for whoever watches it."""

import threading
import time
from collections import Counter
from collections.abc import Iterable

from mutator.model import Record
from mutator.store.run_progress import ProgressCallback, StagePace, progress_label

_NOTIFY_INTERVAL_S = 0.5  # as of a campaign
_IDLE = "waits for the next batch"


class BenchProgress:
    """Counts records, and passes the progress on at most twice a second, and whenever work begins or ends.

    Threads of workers call `note_record`. The rate is that since the last batch was planned.
    """

    def __init__(self, notify: ProgressCallback) -> None:
        self.notify = notify
        self._lock = threading.Lock()
        self._label_by_experiment: dict[str, str] = {}
        self._outcomes = Counter[str]()
        self._planned_count = 0
        self._pace = StagePace("experiments", 0)
        self._proof: StagePace | None = None
        self._proven_count = 0
        self._next_notice_s = 0.0

    def note_stored(self, records: Iterable[Record]) -> None:
        """Count records that an earlier command stored."""
        with self._lock:
            for record in records:
                self._count(record)

    def note_planned(self, planned_count: int) -> None:
        with self._lock:
            self._proof, self._planned_count = None, planned_count
            self._pace = StagePace("experiments", planned_count, len(self._label_by_experiment))
            self._pass_on()

    def note_proof(self, count: int) -> None:
        """Count records from now on as those of the proof."""
        with self._lock:
            self._proof, self._proven_count = StagePace("proof", count), 0
            self._pass_on()

    def note_proof_ended(self) -> None:
        self.note_planned(self._planned_count)

    def note_record(self, record: Record) -> None:
        with self._lock:
            if self._proof:
                self._proven_count += 1
            else:
                self._count(record)
            is_idle = self._proof is None and len(self._label_by_experiment) == self._planned_count
            if is_idle or time.monotonic() >= self._next_notice_s:
                self._pass_on()

    def _count(self, record: Record) -> None:
        label = progress_label(record.status, record.outcome)
        if (earlier := self._label_by_experiment.get(record.experiment_id)) is not None:
            self._outcomes[earlier] -= 1
        self._label_by_experiment[record.experiment_id] = label
        self._outcomes[label] += 1

    def _pass_on(self) -> None:
        self._next_notice_s = time.monotonic() + _NOTIFY_INTERVAL_S
        if self._proof:
            self.notify(self._proof.progress_at(self._proven_count))
            return
        count = len(self._label_by_experiment)
        detail = _IDLE if count == self._planned_count else ""
        self.notify(self._pace.progress_at(count, detail=detail, outcomes=+self._outcomes))
