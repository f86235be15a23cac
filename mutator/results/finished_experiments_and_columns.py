"""An experiment with its record, and a column of the results table that follows from them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.model import Experiment, Record, Status
from mutator.outcomes.verdict_rules import classified_hazard_of
from mutator.results.csv_and_parquet_writers import TableColumn
from mutator.targets.hazard_severity import SeverityScale

if TYPE_CHECKING:
    from mutator.outcomes.fault_paths import FaultPathFinder

_TIME_DIGITS = 6  # decimals of a time in s: finer than any step, coarser than a double's precision


class FinishedExperiment:
    """An experiment with its record, from which the cells of its row follow."""

    def __init__(
        self,
        experiment: Experiment,
        record: Record,
        scale: SeverityScale | None = None,
        fault_paths: "FaultPathFinder | None" = None,
    ) -> None:
        self.experiment, self.record, self.severity_scale = experiment, record, scale
        self.is_ok = record.status is Status.OK
        self.hazards, self.metrics = dict(record.hazards), dict(record.metrics)
        self.max_dev = dict(record.max_dev)
        self.dev = self.max_dev | dict(record.dev)  # up to the end of the drive, where a hazard ended it
        self.classified = classified_hazard_of(record, scale)
        self.untimed_path = fault_paths.untimed_path(experiment.fault, record) if fault_paths else None


@dataclass(frozen=True, slots=True)
class ResultColumn(TableColumn):
    """A column that is known after a run. None is an empty cell."""

    cell_of: Callable[[FinishedExperiment], object]


def rounded_time(value: float | None) -> float | None:
    """Return a time (s) as tables have it."""
    return None if value is None else round(value, _TIME_DIGITS)
