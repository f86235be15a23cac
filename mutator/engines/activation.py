"""When a fault is first active: its trigger, evaluated on the ground truth of the golden run.

Until then a mutant's run is the golden run, so its probe observes the same values, double for double.
"""

from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType

from mutator.mutants.probe import decision


@dataclass(frozen=True, kw_only=True, eq=False)  # looked up by identity: there are thousands
class Observed:
    """What a probe observes in a golden run.

    `values` are time and observed values of each observation, `before` is the number of observations before
    each step, `libraries` are the modules that the run imports on its way.
    """

    values: tuple[tuple[float, ...], ...]
    before: tuple[int, ...]
    libraries: tuple[str, ...] = ()

    def step_of(self, observation: int) -> int:
        """The step in which that observation was made; none is made before the first step."""
        return bisect_right(self.before, observation) - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where a mutant leaves the golden run: before this step, after `observed` observations.

    The run began with one at time `began` (s), and the last of them was at `t`; None: there was none.
    """

    step: int
    observed: int
    began: float | None
    t: float | None


def first_active(probe: CodeType, seen: Observed) -> Start | None:
    """Where a mutant with this probe must leave the golden run; None when its trigger never holds."""
    return _first_active(_without_texts(probe), seen)


def _without_texts(probe: CodeType) -> CodeType:
    """Equal for probes that differ only in their ids, or in what they do once they are active."""
    return probe.replace(co_consts=tuple("" if isinstance(c, str) else c for c in probe.co_consts))


@lru_cache(maxsize=64)  # faults share their triggers: contexts of the hazard analysis
def _first_active(probe: CodeType, seen: Observed) -> Start | None:
    armed_t, holds = decision(probe)
    for number, values in enumerate(seen.values):
        if values[0] >= armed_t and holds(*values):
            step = seen.step_of(number)
            done = seen.before[step]
            times = [t for t, *_ in seen.values[:done]]  # a run that starts again does so no later
            last = times[-1] if done else None
            return Start(step=step, observed=done, began=min(times, default=None), t=last)
    return None
