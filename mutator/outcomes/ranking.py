"""Which results are the worst: one order for pages, budgets and the command line."""

import math
from collections.abc import Iterable

from mutator.model import Outcome, Status
from mutator.outcomes.rows import Row
from mutator.targets.severity import CLASSES

_ENDINGS = (  # the worst first
    Outcome.HAZARD.value,
    Status.CRASHED.value,
    Status.TIMEOUT.value,
    Outcome.SDC.value,
    Outcome.MASKED.value,
    Outcome.NOT_ACTIVATED.value,
    Status.INVALID_MUTANT.value,
    Status.HARNESS_ERROR.value,
)


def badness(row: Row) -> tuple[float | str, ...]:
    """A key that sorts the worst result first: by class of severity, then delta-v; what has no class by its
    ending, then by the least margin, as a number in whatever unit the hazard has it; at last by id."""
    severity = CLASSES.index(row.severity) if row.severity in CLASSES else -1
    delta_v = -1.0 if row.delta_v is None else row.delta_v
    ending = _ENDINGS.index(row.ending)
    margin = math.inf if row.margin is None else row.margin
    return (-severity, -delta_v if severity >= 0 else 0.0, ending, margin, row.experiment_id)


def worst(rows: Iterable[Row]) -> list[Row]:
    """The rows, the worst first; the order in which they come does not matter."""
    return sorted(rows, key=badness)


def worth(rows: Iterable[Row]) -> dict[str, tuple[float | str, ...]]:
    """What the experiments that ended well are sorted by where there is no room for the series of all."""
    return {row.experiment_id: badness(row) for row in rows if row.status is Status.OK}
