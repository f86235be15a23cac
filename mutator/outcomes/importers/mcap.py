"""Read traces from .mcap files, with JSON messages. Log times are simulated time in ns."""

import numpy as np

from mutator.outcomes.mcap_reader import read_topics
from mutator.outcomes.trace_files import Arrays, Importer, TraceRequest, own_times


def _read_mcap(request: TraceRequest) -> Arrays:
    """Read the channels, which are named `/topic:field.of.field`."""
    steps = request.time_channel
    places = {channel.name: channel.name_in_trace.partition(":")[::2] for channel in request.channels}
    may_miss = {channel.name for channel in request.optional}
    fields: dict[str, dict[str, None]] = {steps: {}}
    for topic, field in places.values():
        fields.setdefault(topic, {})[field] = None
    topics = read_topics(request.path, fields)
    if not topics[steps][0]:
        raise KeyError(steps)
    values = {steps: np.array(topics[steps][0])}
    for name, (topic, field) in places.items():
        times, columns = topics[topic]
        if not times:
            if name in may_miss:
                continue
            raise KeyError(topic)
        values[name] = np.array(columns[field])
        if topic != steps:
            values[own_times(name)] = np.array(times)
    return values


IMPORTER = Importer(about="JSON messages in topics (`pip install mcap` to write them)", read=_read_mcap)
