"""Finds the channels that left golden in a run, with the first time and largest deviation of each."""

from collections.abc import Sequence

import numpy as np

from mutator.outcomes.golden_comparison import Trace, deviation, end_of_shorter
from mutator.targets.channels import Channel

Departure = tuple[str, float, float]  # channel, first time (s), largest deviation

_TINY = 1e-9  # s; times are sums of steps


def departures(
    golden: Trace, faulty: Trace, channels: Sequence[Channel], time: str, t_end: float | None
) -> tuple[Departure, ...]:
    """Return the `channels` that left golden before the end of the drive.

    Channels that are not recorded in both runs are skipped. If one run ends earlier, all channels leave
    golden at its end at the latest. The largest deviation is taken over the time that both runs cover.
    """
    end = np.inf if t_end is None else t_end + _TINY
    ended = end_of_shorter(golden[time], faulty[time])
    found = []
    for channel in channels:
        if channel.name in golden and channel.name in faulty:
            one = deviation(golden, faulty, channel, time)
            first = min(one.t_first, ended)
            if first <= end and first < np.inf:
                found.append((channel.name, first, one.largest(end)))
    return tuple(found)
