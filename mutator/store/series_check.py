"""Compare the curves of a stored series with the deviations in its record, because records are sealed."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mutator.errors import MutatorError
from mutator.model import Record
from mutator.store.series_format import Series

_TINY = 1e-9  # s
_ROUNDING = 2.0**-19  # relative; values have 20 bits
_SMALLEST, _LARGEST = 1e-37, 3e38  # in single precision


def check_values(golden: Series, faulty: Series, record: Record, where: Path | None = None) -> None:
    """Raise MutatorError if the runs of a series differ more or less than the record says.

    A series keeps the steps of the largest deviations. It can lack them for a channel with times of its own.
    """
    shared = min(len(golden.t), len(faulty.t))
    if not np.array_equal(golden.t[:shared], faulty.t[:shared]):
        raise MutatorError("other times than those of the golden run", where=where)
    try:
        for name, low, high, largest in _compared(golden, faulty, record):
            if low > largest or high < largest:
                raise MutatorError(
                    f"the series of another run: {name} deviates by up to {high:.6g}",
                    where=where,
                    expected=f"{largest:.6g}, as in the record of {record.experiment_id}",
                )
    except (LookupError, TypeError, AttributeError) as err:
        raise MutatorError(f"a damaged series ({err!r})", where=where) from None


def _compared(golden: Series, faulty: Series, record: Record) -> Iterator[tuple[str, float, float, float]]:
    """Yield channels with the bounds of their largest deviation, and the recorded one: those of compared
    channels in the whole run, and those of channels that left their tolerance in the drive.
    """
    channels = {one["name"]: (number, one) for number, one in enumerate(golden.about["channels"])}
    end = np.inf if record.t_end is None else record.t_end + _TINY
    compared = [(name, np.inf, largest) for name, largest in record.max_dev]
    left = [(name, end, largest) for name, _, largest in record.left if name in channels]
    for name, until, largest in (*compared, *left):
        number, channel = channels[name]
        if not _LARGEST < largest < np.inf:
            low, high = _largest(golden, faulty, number, until)
            yield name, low, np.inf if channel.get("own_times") else high, largest


def _largest(golden: Series, faulty: Series, channel: int, until: float) -> tuple[float, float]:
    """Return bounds of the largest deviation of a channel up to a time."""
    bounds = np.zeros(2)
    for t, one, other in _values(golden, faulty, channel):
        one, other = (values[t <= until].astype(float) for values in (one, other))
        same = (one == other) | (np.isnan(one) & np.isnan(other))
        with np.errstate(invalid="ignore"):
            gap = np.where(same, 0.0, np.abs(one - other))
            rounding = _ROUNDING * (np.abs(one) + np.abs(other)) + _SMALLEST
        gap[np.isnan(gap)] = np.inf
        rounding[~np.isfinite(rounding)] = 0.0
        for place, sign in enumerate((-1.0, 1.0)):
            bounds[place] = (gap + sign * rounding).max(initial=bounds[place])
    return float(bounds[0]), float(bounds[1])


def _values(
    golden: Series, faulty: Series, channel: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield times and both runs' values of a channel: at the common times, and at the points."""
    one, other = golden.rows[channel], faulty.rows[channel]
    shared = min(len(one), len(other))
    yield golden.times(channel)[:shared], one[:shared], other[:shared]
    points = faulty.points
    mine = points.channel == channel
    yield points.t[mine], points.golden[mine], points.faulty[mine]
