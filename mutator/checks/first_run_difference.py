"""Find where two runs that should be identical first differ."""

import json
from pathlib import Path

import numpy as np

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.message_text import shortened_repr
from mutator.errors import BadOutput
from mutator.outcomes import trace_and_record_loading
from mutator.targets.manifest import TargetManifest


def describe_first_difference(manifest: TargetManifest, first_folder: Path, second_folder: Path) -> str:
    """Describe the first difference between two output folders; empty if there is none.

    The text names the channel, step and time, or the key of the record, and both values.
    """
    for name in manifest.output_files:
        if read_bounded(path_below(first_folder, name)) != read_bounded(path_below(second_folder, name)):
            in_trace = name == manifest.trace_file
            difference = (
                _describe_trace_difference(manifest, first_folder, second_folder)
                if in_trace
                else _describe_record_difference(first_folder, second_folder, name)
            )
            return difference or f"in bytes of {name} that are not values of a channel, such as a timestamp"
    return ""


def _describe_trace_difference(manifest: TargetManifest, first_folder: Path, second_folder: Path) -> str:
    try:
        first, second = (
            trace_and_record_loading.load_trace(manifest, out, manifest.channels)
            for out in (first_folder, second_folder)
        )
    except BadOutput as error:
        return f"in a trace that cannot be compared ({error.got})"
    time = manifest.time_channel
    steps = [len(trace[time]) for trace in (first, second)]
    earliest: tuple[float, int, str] | None = None
    for name in (time, *(channel.name for channel in manifest.channels)):
        rows = min(len(first[name]), len(second[name]))
        a, b = first[name][:rows], second[name][:rows]
        differing_rows = np.flatnonzero((a != b) & ((a == a) | (b == b)))  # NaN equals NaN
        if differing_rows.size:
            step = int(differing_rows[0])
            t = float(trace_and_record_loading.times_of(first, name, time)[step])
            earliest = (t, step, name) if earliest is None or t < earliest[0] else earliest
    if earliest is None:
        return "" if steps[0] == steps[1] else f"in their length: {steps[0]} and {steps[1]} steps"
    t, step, name = earliest
    values = [repr(trace[name][step].item()) for trace in (first, second)]
    return f"in channel {name} at step {step} ({t:g} s): {' and '.join(values)}"


def _describe_record_difference(first_folder: Path, second_folder: Path, name: str) -> str:
    first, second = (json.loads(read_bounded(path_below(out, name))) for out in (first_folder, second_folder))
    for key in dict.fromkeys((*first, *second)):
        if first.get(key) != second.get(key):
            return (
                f"in {name}, '{key}': {shortened_repr(first.get(key))} and {shortened_repr(second.get(key))}"
            )
    return ""
