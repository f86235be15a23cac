"""The workers of a run: which are admitted, which are refused and why, and how fast they are."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mutator._common.message_text import counted
from mutator._common.version import VERSION
from mutator.store.work_stretches import Stretch, version_differences

_RECENT = 20  # finished pieces used to measure a worker's rate


@dataclass
class _Member:
    """An admitted worker: its machine, and the time and number of experiments for each of its last pieces."""

    host: str
    finished: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=_RECENT))


class Crew:
    """The workers of a run, present and refused. `now` returns the time in seconds."""

    def __init__(self, stretch: Stretch, *, accept: bool, now: Callable[[], float] = time.monotonic) -> None:
        self._stretch, self._accept, self._now = stretch, accept, now
        self._present: dict[str, _Member] = {}
        self.refused: dict[str, str] = {}

    @property
    def packages(self) -> list[str]:
        """The packages whose versions must equal those of the stretch."""
        return sorted(self._stretch.packages)

    def let_in(self, name: str, facts: Mapping[str, Any]) -> None:
        self._present[name] = _Member(str(facts["host"]))

    def leave(self, name: str) -> None:
        self._present.pop(name, None)

    def refuse(self, name: str, why: str) -> None:
        self.refused[name] = why

    def objection(self, facts: Mapping[str, Any]) -> str:
        """Return why a worker is refused; empty if it is admitted.

        The same reasons would prevent resuming the run on the worker's machine.
        """
        if facts["mutator"] != VERSION:
            return f"mutator {facts['mutator']}, here {VERSION}"
        found = version_differences(self._stretch, facts["python"], facts["packages"])
        return "" if self._accept else "; ".join(text.replace(", here", ", there") for text in found)

    def finished(self, name: str, count: int) -> None:
        if name in self._present:
            self._present[name].finished.append((self._now(), count))

    def told(self) -> str:
        """Return a summary: `3 workers on alpha (2.4 a second), beta (0.9 a second)`."""
        hosts: dict[str, list[float | None]] = {}
        for member in self._present.values():
            hosts.setdefault(member.host, []).append(self._per_s(member))
        text = counted(len(self._present), "worker")
        if hosts:
            text += f" on {', '.join(_told(host, rates) for host, rates in sorted(hosts.items()))}"
        return f"{text}; {len(self.refused)} refused" if self.refused else text

    def _per_s(self, member: _Member) -> float | None:
        if len(member.finished) < 2:
            return None
        (began, first), *_ = member.finished
        elapsed = self._now() - began
        return (sum(count for _, count in member.finished) - first) / elapsed if elapsed > 0 else None


def describe(name: str, facts: Mapping[str, Any]) -> str:
    """Describe a worker: its name and, if known, its machine, processor and versions."""
    if not facts:
        return name
    parts = (facts["host"], facts["cpu"] or facts["platform"], facts["python"], f"mutator {facts['mutator']}")
    blas = (f"{one['library']} {one['version']} ({one['kernel']})" for one in facts["blas"])
    return f"{name} ({', '.join((*parts, *blas))})"


def _told(host: str, rates: Iterable[float | None]) -> str:
    known = [rate for rate in rates if rate is not None]
    return f"{host} ({sum(known):.1f} a second)" if known else host
