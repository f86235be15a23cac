"""Finds the channels that left golden in a run, with the first time and largest deviation of each."""

from collections.abc import Sequence

import numpy as np

from mutator.outcomes.golden_trace_comparison import channel_deviation, first_time_only_in_longer
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.targets.channels import Channel

Departure = tuple[str, float, float]  # channel, first time (s), largest deviation

_TIME_SLACK_S = 1e-9  # s; times are sums of steps


def departures_from_golden(
    golden: Trace, faulty: Trace, channels: Sequence[Channel], time_channel: str, t_end: float | None
) -> tuple[Departure, ...]:
    """Return the `channels` that left golden before the end of the drive.

    Channels that are not recorded in both runs are skipped. If one run ends earlier, all channels leave
    golden at its end at the latest. The largest deviation is taken over the time that both runs cover.
    """
    end = np.inf if t_end is None else t_end + _TIME_SLACK_S
    shorter_end = first_time_only_in_longer(golden[time_channel], faulty[time_channel])
    departed = []
    for channel in channels:
        if channel.name in golden and channel.name in faulty:
            channel_difference = channel_deviation(golden, faulty, channel, time_channel)
            first = min(channel_difference.t_first, shorter_end)
            if first <= end and first < np.inf:
                departed.append((channel.name, first, channel_difference.largest(end)))
    return tuple(departed)
