"""The limits of runs when a campaign names none: they follow from the CPU time of the golden runs.

A limit only decides when a run is cut off, so a measured one is in no digest, id or record. It is measured
once, and kept for all sessions of a run.
"""

from collections.abc import Collection, Iterable
from dataclasses import asdict, replace
from math import ceil

from mutator.limits import Limits, MeasuredLimits

LIMITS_THAT_ARE_MEASURED = frozenset({"cpu_s", "wall_s"})
_GOLDEN_RUNS_PER_LIMIT = 10  # a faulty run may take this many times the CPU time of its golden run
_LIMIT_STEPS_S = (10, 20, 30, 60, 120, 300)  # limits are rounded up to these, or multiples of the last
_WALL_S_PER_CPU_S = 5  # machines are busy, so the wall time has room for several runs on one core


def limits_before_measuring(
    limits: Limits, measured_names: Collection[str] = LIMITS_THAT_ARE_MEASURED
) -> Limits:
    """Return the limits of runs without a fault. If their CPU time is measured, it may be as long as the wall
    time.
    """
    return replace(limits, cpu_s=max(limits.cpu_s, limits.wall_s)) if "cpu_s" in measured_names else limits


def measure_limits(limits: Limits, measured_names: Collection[str], golden_cpu_s: Iterable[float]) -> Limits:
    """Return the limits of faulty runs; `measured_names` are those that the campaign does not name.

    `golden_cpu_s` has the CPU time of each golden run in s.
    """
    if "cpu_s" not in measured_names:
        return limits
    cpu_s = _rounded_up_limit_s(_GOLDEN_RUNS_PER_LIMIT * max(golden_cpu_s, default=0.0))
    wall_s = max(limits.wall_s, _WALL_S_PER_CPU_S * cpu_s) if "wall_s" in measured_names else limits.wall_s
    return MeasuredLimits(**asdict(limits) | {"cpu_s": cpu_s, "wall_s": wall_s})


def _rounded_up_limit_s(cpu_s: float) -> int:
    longest = _LIMIT_STEPS_S[-1]
    return next((step for step in _LIMIT_STEPS_S if cpu_s <= step), longest * ceil(cpu_s / longest))
