"""Find where two runs that should be identical first differ."""

import json
from pathlib import Path

import numpy as np

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import inside
from mutator._common.message_text import shown
from mutator.errors import BadOutput
from mutator.outcomes import golden_comparison
from mutator.targets.manifest import TargetManifest


def describe_first_difference(manifest: TargetManifest, one: Path, other: Path) -> str:
    """Describe the first difference between two output folders; empty if there is none.

    The text names the channel, step and time, or the key of the record, and both values.
    """
    for name in manifest.outputs:
        if read_bounded(inside(one, name)) != read_bounded(inside(other, name)):
            in_trace = name == manifest.trace_file
            found = _in_traces(manifest, one, other) if in_trace else _in_records(one, other, name)
            return found or f"in bytes of {name} that are not values of a channel, such as a timestamp"
    return ""


def _in_traces(manifest: TargetManifest, one: Path, other: Path) -> str:
    try:
        first, second = (
            golden_comparison.load_trace(manifest, out, manifest.channels) for out in (one, other)
        )
    except BadOutput as error:
        return f"in a trace that cannot be compared ({error.got})"
    time = manifest.time_channel
    steps = [len(trace[time]) for trace in (first, second)]
    least: tuple[float, int, str] | None = None
    for name in (time, *(channel.name for channel in manifest.channels)):
        rows = min(len(first[name]), len(second[name]))
        a, b = first[name][:rows], second[name][:rows]
        unlike = np.flatnonzero((a != b) & ((a == a) | (b == b)))  # NaN equals NaN
        if unlike.size:
            step = int(unlike[0])
            t = float(golden_comparison.times_of(first, name, time)[step])
            least = (t, step, name) if least is None or t < least[0] else least
    if least is None:
        return "" if steps[0] == steps[1] else f"in their length: {steps[0]} and {steps[1]} steps"
    t, step, name = least
    values = [repr(trace[name][step].item()) for trace in (first, second)]
    return f"in channel {name} at step {step} ({t:g} s): {' and '.join(values)}"


def _in_records(one: Path, other: Path, name: str) -> str:
    first, second = (json.loads(read_bounded(inside(out, name))) for out in (one, other))
    for key in dict.fromkeys((*first, *second)):
        if first.get(key) != second.get(key):
            return f"in {name}, '{key}': {shown(first.get(key))} and {shown(second.get(key))}"
    return ""
