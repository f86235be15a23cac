"""When a fault is first active: its trigger, asked about the ground truth of the golden run.

Until then a run is the golden run, so that is what its probe observes, double for double.
"""

from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)  # looked up by identity: there are thousands
class Observed:
    """What a probe observes in a golden run: `values` are the arguments of `observe`, in order; `before` how
    many there were before each step."""

    values: tuple[tuple[float, float, float, float], ...]
    before: tuple[int, ...]

    def step_of(self, observation: int) -> int:
        """The step in which that observation was made; none is made before the first."""
        return bisect_right(self.before, observation) - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where a mutant leaves the golden run: before this step, when its probe has observed so much, lastly at
    time `t` (s; None: nothing yet)."""

    step: int
    observed: int
    t: float | None


def first_active(probe: CodeType, seen: Observed) -> Start | None:
    """Where a mutant with this probe must leave the golden run; None when its trigger never holds."""
    return _first_active(_without_texts(probe), seen)


def _without_texts(probe: CodeType) -> CodeType:
    """The same for probes that differ in their ids alone, or in what they do once they are active."""
    return probe.replace(co_consts=tuple("" if isinstance(c, str) else c for c in probe.co_consts))


@lru_cache(maxsize=64)  # faults share their triggers: contexts of the hazard analysis
def _first_active(probe: CodeType, seen: Observed) -> Start | None:
    module: dict[str, Any] = {"__name__": "_fi"}
    exec(probe, module)
    observe = module["observe"]
    for number, values in enumerate(seen.values):
        observe(*values)
        if module["_run"].active:
            step = seen.step_of(number)
            done = seen.before[step]
            return Start(step=step, observed=done, t=seen.values[done - 1][0] if done else None)
    return None
