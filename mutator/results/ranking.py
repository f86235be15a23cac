"""Ranks results from worst to best."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from mutator.model import Outcome, Status
from mutator.results.column_facts import hazards_of
from mutator.results.counting import came, endings
from mutator.results.rows import Row
from mutator.targets.severity import CLASSES, DELTA_V

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

_ENDINGS = (  # worst first
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
    """Sort rows, worst first. The input order does not matter.

    Rows with a severity class come first, by class and then by delta-v. The others follow by outcome and then
    by margin, alternating between hazards, because margins with different units cannot be compared. Ties are
    broken by id.
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


def places(texts: "pd.DataFrame") -> "np.ndarray":
    """Return the rank (from 0) of each row of `Results.texts` in the order of `worst`, computed by column."""
    import numpy as np
    import pandas as pd

    def numbers(name: str, otherwise: float) -> np.ndarray:
        found = pd.to_numeric(texts[name]) if name in texts else pd.Series(np.nan, texts.index)
        return found.fillna(otherwise).to_numpy(dtype=float)

    ending = pd.Index(_ENDINGS).get_indexer(pd.Index(endings(texts)))
    severity = texts["severity"] if "severity" in texts else pd.Series("", texts.index)
    classed = pd.Index(CLASSES).get_indexer(pd.Index(severity))
    has_class = classed >= 0
    by_id = np.empty(len(texts), dtype=np.int64)
    by_id[np.argsort(texts["experiment_id"].to_numpy(dtype=object), kind="stable")] = np.arange(len(texts))
    turn = np.where(has_class, 0.0, _turn(texts, ending, has_class, by_id))
    delta_v = np.where(has_class, -numbers(DELTA_V, -1.0), 0.0)
    order = np.lexsort((by_id, turn, ending, delta_v, -classed, ~has_class))
    found = np.empty(len(texts), dtype=np.int64)
    found[order] = np.arange(len(texts))
    return found


def _turn(
    texts: "pd.DataFrame", ending: "np.ndarray", has_class: "np.ndarray", by_id: "np.ndarray"
) -> "np.ndarray":
    """Return the ranks of `_turns` for each row of a frame; infinite for rows without a margin."""
    import numpy as np
    import pandas as pd

    turn = np.full(len(texts), np.inf)
    had = {name: came(texts, name).to_numpy() for name in hazards_of(texts)}
    any_came = np.any(list(had.values()), axis=0) if had else np.zeros(len(texts), dtype=bool)
    for name, flag in had.items():
        if (column := f"margin_{name.lower()}") not in texts:
            continue
        margin = pd.to_numeric(texts[column]).to_numpy(dtype=float)
        counts = np.where(any_came, flag, (texts[name.lower()] != "").to_numpy())
        rows = np.flatnonzero(counts & ~has_class & (texts[column] != "").to_numpy())
        rows = rows[np.lexsort((by_id[rows], margin[rows], ending[rows]))]
        _, first, sizes = np.unique(ending[rows], return_index=True, return_counts=True)
        turn[rows] = np.minimum(turn[rows], np.arange(len(rows)) - np.repeat(first, sizes))
    return turn


def worth_of(texts: "pd.DataFrame") -> dict[str, int]:
    found = places(texts)
    ended = (texts["status"] == Status.OK.value).to_numpy()
    return dict(zip(texts["experiment_id"][ended], found[ended].tolist(), strict=True))


def worth(rows: Iterable[Row]) -> dict[str, int]:
    """Return the rank of each experiment with status `ok` (0 is the worst). If there is no room for all
    series, those of the worst experiments are kept.
    """
    return {row.experiment_id: i for i, row in enumerate(worst(rows)) if row.status is Status.OK}


def _has_class(row: Row) -> bool:
    return row.severity in CLASSES


def _turns(rows: Iterable[Row]) -> dict[str, int]:
    """Rank rows without a severity class among those with the same outcome, by margin to a hazard.

    A row with margins to several hazards gets its lowest rank number. Rows without a margin are omitted.
    """
    lines: dict[tuple[str, str], list[tuple[float, str]]] = {}
    for row in rows:
        for hazard, margin in () if _has_class(row) else row.margins:
            lines.setdefault((row.ending, hazard), []).append((margin, row.experiment_id))
    turns: dict[str, int] = {}
    for line in lines.values():
        for place, (_, name) in enumerate(sorted(line)):
            turns[name] = min(place, turns.get(name, place))
    return turns
