"""The results of a run as a pandas frame with a row for each usable experiment.

In addition to the columns of results.csv, it has `kind` (`sensor/bias`), `row` (the context row of the
trigger; for a random run, that of its guided partner), `t_hazard` (first hazard, s) and the flags
`is_activated, is_manifested, is_hazard, is_alert`. Times are in simulated seconds; NaN means that the event
did not happen.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from mutator.results.outcome_counting import are_usable
from mutator.results.table_columns import hazard_names_of_frame
from mutator.results.table_reader import Results
from mutator.statistics.sample_weights import WEIGHT_COLUMN, with_weights

if TYPE_CHECKING:
    import pandas as pd

_RANDOM_PREFIX = "random/"  # prefix of a random run's trigger: random/C1


def load_usable_results(results: Path) -> "pd.DataFrame":
    """Load the usable experiments of a run folder, in order, given its results.csv. MutatorError if the
    results.parquet next to it is invalid.

    Endings that say nothing about a fault (`UNUSABLE_ENDINGS`) are left out; crashes and timeouts are kept.
    If the plan is a sample, the column `weight` has how many planned experiments each stands for.
    """
    return with_weights(prepare_results(Results(results.parent).frame()), results.parent)


def prepare_results(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Select the usable experiments of a frame from `Results.frame`, and add the derived columns."""
    usable = are_usable(frame)
    if not usable.all():
        frame = frame[usable]
    frame = frame.reset_index(drop=True)
    frame["kind"] = frame["module"] + "/" + frame["fault_type"]
    frame["row"] = frame["trigger"].str.removeprefix(_RANDOM_PREFIX)
    frame["t_hazard"] = frame[[f"t_{hazard.lower()}" for hazard in hazard_names(frame)]].min(axis=1)
    for flag, time in (
        ("is_activated", "t_activation"),
        ("is_manifested", "t_manifest"),
        ("is_hazard", "t_hazard"),
        ("is_alert", "t_alert"),
    ):
        frame[flag] = frame[time].notna()
    return frame


_SHARED_COLUMNS = (
    "experiment_id",
    "fault_id",
    "module",
    "kind",
    "row",
    "scenario",
    "family",
    "method",
    "trigger",
    "seed",
    "status",
    WEIGHT_COLUMN,
)


def select_common_columns(frame: "pd.DataFrame", *more_columns: str) -> "pd.DataFrame":
    """Keep only the columns that most statistics need, and those in `more`. Selecting from a million rows
    with all columns takes seconds.
    """
    flags = [hazard.lower() for hazard in hazard_names(frame)]
    selected = {*_SHARED_COLUMNS, *flags, *more_columns}
    return frame[[name for name in frame.columns if name in selected or name.startswith(("t_", "is_"))]]


def hazard_names(frame: "pd.DataFrame") -> tuple[str, ...]:
    """Return the hazards in the table, sorted. A hazard NEAR has a flag `near` and a time `t_near`."""
    return tuple(sorted(hazard_names_of_frame(frame)))
