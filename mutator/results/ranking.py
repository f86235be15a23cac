"""Ranks results from worst to best."""

from typing import TYPE_CHECKING

from mutator.model import Outcome, Status
from mutator.results.outcome_counting import endings, hazard_margins
from mutator.targets.contact_severity import CLASSES, DELTA_V

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


def places(frame: "pd.DataFrame") -> "np.ndarray":
    """Return the rank (from 0: the worst) of each row of a frame of results, whatever the order of the rows.

    Rows with a severity class come first, by class and then by delta-v. The others follow by outcome and then
    by margin, alternating between hazards, because margins with different units cannot be compared. Ties are
    broken by id.
    """
    import numpy as np
    import pandas as pd

    ending = pd.Index(_ENDINGS).get_indexer(pd.Index(endings(frame)))
    severity = frame["severity"] if "severity" in frame else pd.Series("", frame.index)
    classed = pd.Index(CLASSES).get_indexer(pd.Index(severity))
    has_class = classed >= 0
    by_id = np.empty(len(frame), dtype=np.int64)
    by_id[np.argsort(frame["experiment_id"].to_numpy(dtype=object), kind="stable")] = np.arange(len(frame))
    turn = np.where(has_class, 0.0, _turns(frame, ending, has_class, by_id))
    speed = frame[DELTA_V].fillna(-1.0).to_numpy() if DELTA_V in frame else np.full(len(frame), -1.0)
    delta_v = np.where(has_class, -speed, 0.0)
    order = np.lexsort((by_id, turn, ending, delta_v, -classed, ~has_class))
    found = np.empty(len(frame), dtype=np.int64)
    found[order] = np.arange(len(frame))
    return found


def _turns(
    frame: "pd.DataFrame", ending: "np.ndarray", has_class: "np.ndarray", by_id: "np.ndarray"
) -> "np.ndarray":
    """Rank rows without a severity class among those with the same outcome, by `hazard_margins`.

    A row with margins to several hazards gets its lowest rank number. Rows without a margin: infinite.
    """
    import numpy as np

    turn = np.full(len(frame), np.inf)
    for _, margins in hazard_margins(frame).items():
        margin = margins.to_numpy()
        rows = np.flatnonzero(~has_class & ~np.isnan(margin))
        rows = rows[np.lexsort((by_id[rows], margin[rows], ending[rows]))]
        _, first, sizes = np.unique(ending[rows], return_index=True, return_counts=True)
        turn[rows] = np.minimum(turn[rows], np.arange(len(rows)) - np.repeat(first, sizes))
    return turn


def worth(frame: "pd.DataFrame") -> dict[str, int]:
    """Return the rank of each experiment with status `ok` (0 is the worst). If there is no room for all
    series, those of the worst experiments are kept.
    """
    found = places(frame)
    ended = (frame["status"] == Status.OK.value).to_numpy()
    return dict(zip(frame["experiment_id"][ended], found[ended].tolist(), strict=True))
