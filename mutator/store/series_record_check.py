"""Compare the curves of a stored series with the deviations in its record, because records are sealed."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mutator.errors import MutatorError
from mutator.model import Record
from mutator.store.series_format import Series

_TIME_SLACK_S = 1e-9  # times are sums of steps, which round
_RELATIVE_ROUNDING = 2.0**-19  # relative; values have 20 bits
_SMALLEST_SINGLE, _LARGEST_SINGLE = 1e-37, 3e38  # in single precision


def check_deviations(golden: Series, faulty: Series, record: Record, where: Path | None = None) -> None:
    """Raise MutatorError if the runs of a series differ more or less than the record says.

    A series keeps the steps of the largest deviations. It can lack them for a channel with times of its own.
    """
    shared = min(len(golden.t), len(faulty.t))
    if not np.array_equal(golden.t[:shared], faulty.t[:shared]):
        raise MutatorError("other times than those of the golden run", where=where)
    try:
        for name, low, high, largest in _deviation_bounds_and_recorded(golden, faulty, record):
            if low > largest or high < largest:
                raise MutatorError(
                    f"the series of another run: {name} deviates by up to {high:.6g}",
                    where=where,
                    expected=f"{largest:.6g}, as in the record of {record.experiment_id}",
                )
    except (LookupError, TypeError, AttributeError) as err:
        raise MutatorError(f"a damaged series ({err!r})", where=where) from None


def _deviation_bounds_and_recorded(
    golden: Series, faulty: Series, record: Record
) -> Iterator[tuple[str, float, float, float]]:
    """Yield channels with the bounds of their largest deviation, and the recorded one: those of compared
    channels in the whole run, and those of channels that left their tolerance in the drive.
    """
    channels = {
        channel_facts["name"]: (number, channel_facts)
        for number, channel_facts in enumerate(golden.facts["channels"])
    }
    end = np.inf if record.t_end is None else record.t_end + _TIME_SLACK_S
    compared = [(name, np.inf, largest) for name, largest in record.max_dev]
    departed = [(name, end, largest) for name, _, largest in record.left if name in channels]
    for name, until, largest in (*compared, *departed):
        number, channel = channels[name]
        if not _LARGEST_SINGLE < largest < np.inf:
            low, high = _largest_deviation_bounds(golden, faulty, number, until)
            yield name, low, np.inf if channel.get("own_times") else high, largest


def _largest_deviation_bounds(
    golden: Series, faulty: Series, channel: int, until: float
) -> tuple[float, float]:
    """Return bounds of the largest deviation of a channel up to a time."""
    bounds = np.zeros(2)
    for t, golden_values, faulty_values in _paired_values(golden, faulty, channel):
        golden_values, faulty_values = (
            values[t <= until].astype(float) for values in (golden_values, faulty_values)
        )
        same = (golden_values == faulty_values) | (np.isnan(golden_values) & np.isnan(faulty_values))
        with np.errstate(invalid="ignore"):
            gap = np.where(same, 0.0, np.abs(golden_values - faulty_values))
            rounding = _RELATIVE_ROUNDING * (np.abs(golden_values) + np.abs(faulty_values)) + _SMALLEST_SINGLE
        gap[np.isnan(gap)] = np.inf
        rounding[~np.isfinite(rounding)] = 0.0
        for place, sign in enumerate((-1.0, 1.0)):
            bounds[place] = (gap + sign * rounding).max(initial=bounds[place])
    return float(bounds[0]), float(bounds[1])


def _paired_values(
    golden: Series, faulty: Series, channel: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield times and both runs' values of a channel: at the common times, and at the points."""
    golden_row, faulty_row = golden.channel_values[channel], faulty.channel_values[channel]
    shared = min(len(golden_row), len(faulty_row))
    yield golden.times_of(channel)[:shared], golden_row[:shared], faulty_row[:shared]
    points = faulty.extra_points
    is_of_channel = points.channel_numbers == channel
    yield points.t[is_of_channel], points.golden_values[is_of_channel], points.faulty_values[is_of_channel]
