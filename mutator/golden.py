"""Golden runs and how a faulty run differs from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mutator.manifest import Channel, TargetManifest

Trace = Mapping[str, np.ndarray]  # channel name -> one value per step


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Where a trace leaves golden: time of the first difference beyond tolerance (s), and the largest
    difference of each compared channel."""

    t_first: float | None
    max_dev: tuple[tuple[str, float], ...]


def load_trace(manifest: TargetManifest, out: Path, channels: Sequence[str] | None = None) -> Trace:
    """Channels (default: all) and time of the trace in the output folder `out`."""
    raise NotImplementedError


def compare(golden: Trace, faulty: Trace, channels: Sequence[Channel], time: str) -> Difference:
    """Compare the channels row by row; NaN equals NaN; a trace of another length differs where one ends."""
    raise NotImplementedError
