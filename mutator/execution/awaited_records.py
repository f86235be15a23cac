"""What a bench waits for: experiments that its workers have, and records that somebody asked for."""

from collections import Counter, deque
from collections.abc import Callable, Iterable


class AwaitedRecords:
    """Ids of experiments that run, and of those whose records `next_arrived` gives, in order of arrival."""

    def __init__(self) -> None:
        self.running: set[str] = set()
        self._requested = Counter[str]()  # how often the record of each running experiment is asked for
        self._arrived: deque[str] = deque()

    @property
    def is_any_requested(self) -> bool:
        """Whether a record that was asked for has not arrived."""
        return bool(self._requested)

    def request(self, experiment_ids: Iterable[str]) -> None:
        """Ask for the record of each experiment, as often as it is in the list."""
        for name in experiment_ids:
            if name in self.running:
                self._requested[name] += 1
            else:
                self._arrived.append(name)

    def note_record(self, experiment_id: str) -> None:
        self.running.discard(experiment_id)
        self._arrived.extend([experiment_id] * self._requested.pop(experiment_id, 0))

    def stop(self, has_record: Callable[[str], bool]) -> None:
        """Note that nothing runs any longer. What has no record is not awaited further."""
        for name in sorted(filter(has_record, self._requested)):
            self.note_record(name)
        self.running.clear()
        self._requested.clear()

    def next_arrived(self) -> str | None:
        """Return the next experiment whose record has arrived; None if none has."""
        return self._arrived.popleft() if self._arrived else None
