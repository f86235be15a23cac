"""The drives of planes: from when faults start to the end, as golden runs show it."""

import math
from pathlib import Path

import numpy as np

from mutator.campaigns.exploration_section import ExploredPlane
from mutator.errors import MutatorError
from mutator.explore.cell_results import Drive
from mutator.outcomes.hazard_and_metric_judgement import formula_values_by_name, load_manifest_channels
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import TIME
from mutator.triggers.trace_formulas import condition_at_each_step

_MICROSECONDS_PER_S = 1e6


def load_golden_trace(manifest: TargetManifest, folder: Path) -> Trace:
    """Load the channels of the golden run in `folder` that conditions can name."""
    return load_manifest_channels(manifest, folder)


def drive_of(manifest: TargetManifest, golden: Trace, plane: ExploredPlane) -> Drive:
    """Return the drive of a plane, whose golden run is `golden`.

    MutatorError if the golden run never meets the plane's condition.
    """
    values = formula_values_by_name(manifest, golden)
    times = values[TIME]
    holds = condition_at_each_step(plane.condition, values) & (times >= plane.armed_after_s)
    if not holds.any():
        raise MutatorError(
            f"no fault begins: {plane.scenario}, which ends at {float(times[-1]):g} s, never meets {plane.condition}",
            argument="start",
            expected="a start that the golden run reaches",
            remedy="choose another start or scenario",
        )
    start = float(times[int(np.argmax(holds))])
    # rounded down, so that rounding does not lose a step
    start_s = math.floor(start * _MICROSECONDS_PER_S) / _MICROSECONDS_PER_S
    return Drive(start_s=start_s, end_s=float(times[-1]), step_s=manifest.step_s)
