"""When a fault is first active: its trigger, asked about the ground truth of the golden run.

Until then a run is the golden run, so that is what its probe observes, double for double.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import CodeType
from typing import Any


@dataclass(frozen=True, kw_only=True, eq=False)  # looked up by identity: there are thousands
class Observed:
    """What a probe observes in a golden run: `values` are the arguments of `observe`, in order; `before` how
    many there were before each step; `libraries` are modules that the run imports on its way."""

    values: tuple[tuple[float, float, float, float], ...]
    before: tuple[int, ...]
    libraries: tuple[str, ...] = ()

    @cached_property
    def truths(self) -> list[tuple[float, ...]]:
        """What a condition is asked about in each observation: the values, time headway (s), closing speed
        (m/s)."""
        return [
            (t, d_rel, v_ego, v_lead, d_rel / v_ego if v_ego > 0.0 else math.inf, v_ego - v_lead)
            for t, d_rel, v_ego, v_lead in self.values
        ]

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
    """As `observe` of the probe decides it, before it has decided anything else: armed, and the condition
    holds. Asking `observe` itself takes almost four times as long."""
    module: dict[str, Any] = {"__name__": "_fi"}
    exec(probe, module)
    holds, armed_t = module["_condition"], module["ARMED_AFTER_S"] - module["_TINY"]
    for number, truth in enumerate(seen.truths):
        if truth[0] >= armed_t and holds(*truth):
            step = seen.step_of(number)
            done = seen.before[step]
            return Start(step=step, observed=done, t=seen.values[done - 1][0] if done else None)
    return None
