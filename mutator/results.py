"""The results table: a row per experiment, made from plan and records at any time, always the same bytes."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from mutator.model import Experiment, Record

COLUMNS = (
    "experiment_id",
    "fault_id",
    "module",
    "fault_type",
    "reading",
    "value",
    "unit",
    "scenario",
    "method",
    "trigger",
    "seed",
    "status",
    "outcome",
    "activated",
    "t_activation",
    "activations",
    "manifested",
    "t_manifest",
    "h1",
    "t_h1",
    "h2",
    "t_h2",
    "h3",
    "t_h3",
    "alerts",
    "t_alert",
    "reaction_time",
    "max_dev_gas",
    "max_dev_brake",
    "max_dev_steer",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """The files of a built table, and how many of the planned experiments are in it."""

    csv: Path
    parquet: Path
    timings: Path
    rows: int
    planned: int


def row(experiment: Experiment, record: Record) -> dict[str, object]:
    """One row: `COLUMNS`, then `variant, aim, condition, detail`; None for nothing."""
    raise NotImplementedError


def build(run: Path) -> Results:
    """Write results.csv, results.parquet and timings.parquet of a run folder from its plan and records."""
    raise NotImplementedError


def load(run: Path) -> pd.DataFrame:
    """The results table of a run folder, built first if it is older than the records."""
    raise NotImplementedError
