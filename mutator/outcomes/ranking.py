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


def worst(rows: Iterable[Row]) -> list[Row]:
    """The rows, the worst first; the order in which they come does not matter.

    By class of severity, then delta-v; what has no class by its ending, then by margin: hazards take turns,
    as metres are not to be compared with metres a second. At last by id.
    """
    found = list(rows)
    turns = _turns(found)

    def badness(row: Row) -> tuple[float | str, ...]:
        ending = _ENDINGS.index(row.ending)
        if not _has_class(row):
            return (1, 0.0, 0.0, ending, turns.get(row.experiment_id, math.inf), row.experiment_id)
        delta_v = -1.0 if row.delta_v is None else row.delta_v
        return (0, -CLASSES.index(row.severity), -delta_v, ending, 0, row.experiment_id)

    return sorted(found, key=badness)


def worth(rows: Iterable[Row]) -> dict[str, int]:
    """What the experiments that ended well are sorted by where there is no room for the series of all."""
    return {row.experiment_id: i for i, row in enumerate(worst(rows)) if row.status is Status.OK}


def _has_class(row: Row) -> bool:
    return row.severity in CLASSES


def _turns(rows: Iterable[Row]) -> dict[str, int]:
    """The place of each row without a class among those that ended alike, by the margin to one hazard, the
    least first; of several hazards the place nearest to the front. Rows without a margin have none."""
    lines: dict[tuple[str, str], list[tuple[float, str]]] = {}
    for row in rows:
        for hazard, margin in () if _has_class(row) else row.margins:
            lines.setdefault((row.ending, hazard), []).append((margin, row.experiment_id))
    turns: dict[str, int] = {}
    for line in lines.values():
        for place, (_, name) in enumerate(sorted(line)):
            turns[name] = min(place, turns.get(name, place))
    return turns
