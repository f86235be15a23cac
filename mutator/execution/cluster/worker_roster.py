"""The workers of a run: which are admitted, which are refused and why, and how fast they are."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mutator._common.message_text import counted
from mutator._common.version import VERSION
from mutator.store.session_environments import SessionEnvironment, version_differences

_MOST_RECENT_PIECES = 20  # finished pieces used to measure a worker's rate


@dataclass
class _AdmittedWorker:
    """An admitted worker: its machine, and the time and number of experiments for each of its last pieces."""

    host: str
    finished_pieces: deque[tuple[float, int]] = field(
        default_factory=lambda: deque(maxlen=_MOST_RECENT_PIECES)
    )


class WorkerRoster:
    """The workers of a run, present and refused. `now` returns the time in seconds."""

    def __init__(
        self, stretch: SessionEnvironment, *, accept: bool, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._stretch, self._accept_versions, self._now = stretch, accept, now
        self._admitted_workers: dict[str, _AdmittedWorker] = {}
        self.refusal_reasons: dict[str, str] = {}

    @property
    def packages(self) -> list[str]:
        """The packages whose versions must equal those of the stretch."""
        return sorted(self._stretch.packages)

    def admit_worker(self, name: str, facts: Mapping[str, Any]) -> None:
        self._admitted_workers[name] = _AdmittedWorker(str(facts["host"]))

    def remove_worker(self, name: str) -> None:
        self._admitted_workers.pop(name, None)

    def refuse_worker(self, name: str, reason: str) -> None:
        self.refusal_reasons[name] = reason

    def reason_to_refuse(self, facts: Mapping[str, Any]) -> str:
        """Return why a worker is refused; empty if it is admitted.

        The same reasons would prevent resuming the run on the worker's machine.
        """
        if facts["mutator"] != VERSION:
            return f"mutator {facts['mutator']}, here {VERSION}"
        differing_versions = version_differences(self._stretch, facts["python"], facts["packages"])
        return (
            ""
            if self._accept_versions
            else "; ".join(text.replace(", here", ", there") for text in differing_versions)
        )

    def note_finished_piece(self, name: str, experiment_count: int) -> None:
        if name in self._admitted_workers:
            self._admitted_workers[name].finished_pieces.append((self._now(), experiment_count))

    def describe_workers(self) -> str:
        """Return a summary: `3 workers on alpha (2.4 a second), beta (0.9 a second)`."""
        hosts: dict[str, list[float | None]] = {}
        for member in self._admitted_workers.values():
            hosts.setdefault(member.host, []).append(self._experiments_per_s(member))
        text = counted(len(self._admitted_workers), "worker")
        if hosts:
            text += f" on {', '.join(_describe_host(host, rates) for host, rates in sorted(hosts.items()))}"
        return f"{text}; {len(self.refusal_reasons)} refused" if self.refusal_reasons else text

    def _experiments_per_s(self, member: _AdmittedWorker) -> float | None:
        if len(member.finished_pieces) < 2:  # the time before the first one includes the start
            return None
        (began, first), *_ = member.finished_pieces  # its experiments ran before `began`
        elapsed = self._now() - began
        return (sum(count for _, count in member.finished_pieces) - first) / elapsed if elapsed > 0 else None


def describe_worker(name: str, facts: Mapping[str, Any]) -> str:
    """Describe a worker: its name and, if known, its machine, processor and versions."""
    if not facts:
        return name
    parts = (facts["host"], facts["cpu"] or facts["platform"], facts["python"], f"mutator {facts['mutator']}")
    blas = (f"{library['library']} {library['version']} ({library['kernel']})" for library in facts["blas"])
    return f"{name} ({', '.join((*parts, *blas))})"


def _describe_host(host: str, rates: Iterable[float | None]) -> str:
    known_rates = [rate for rate in rates if rate is not None]
    return f"{host} ({sum(known_rates):.1f} a second)" if known_rates else host
