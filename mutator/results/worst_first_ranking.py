"""Ranks results from worst to best."""

from typing import TYPE_CHECKING

from mutator.model import Outcome, Status
from mutator.results.outcome_counting import hazard_margins, outcome_or_status_of_rows
from mutator.targets.contact_severity import DELTA_V_NAME, SEVERITY_CLASSES

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

_ENDINGS_WORST_FIRST = (  # worst first
    Outcome.HAZARD.value,
    Status.CRASHED.value,
    Status.TIMEOUT.value,
    Outcome.SDC.value,
    Outcome.MASKED.value,
    Outcome.NOT_ACTIVATED.value,
    Status.INVALID_MUTANT.value,
    Status.HARNESS_ERROR.value,
)


def worst_first_ranks(frame: "pd.DataFrame") -> "np.ndarray":
    """Return the rank (from 0: the worst) of each row of a frame of results, whatever the order of the rows.

    Rows with a severity class come first, by class and then by delta-v. The others follow by outcome and then
    by margin, alternating between hazards, because margins with different units cannot be compared. Ties are
    broken by id.
    """
    import numpy as np
    import pandas as pd

    ending_rank = pd.Index(_ENDINGS_WORST_FIRST).get_indexer(pd.Index(outcome_or_status_of_rows(frame)))
    severity = frame["severity"] if "severity" in frame else pd.Series("", frame.index)
    severity_rank = pd.Index(SEVERITY_CLASSES).get_indexer(pd.Index(severity))
    has_class = severity_rank >= 0
    id_rank = np.empty(len(frame), dtype=np.int64)
    id_rank[np.argsort(frame["experiment_id"].to_numpy(dtype=object), kind="stable")] = np.arange(len(frame))
    margin_rank = np.where(has_class, 0.0, _margin_ranks(frame, ending_rank, has_class, id_rank))
    speed = (
        frame[DELTA_V_NAME].fillna(-1.0).to_numpy() if DELTA_V_NAME in frame else np.full(len(frame), -1.0)
    )
    delta_v = np.where(has_class, -speed, 0.0)  # without a class, the rank does not depend on it
    order = np.lexsort((id_rank, margin_rank, ending_rank, delta_v, -severity_rank, ~has_class))
    ranks = np.empty(len(frame), dtype=np.int64)
    ranks[order] = np.arange(len(frame))
    return ranks


def _margin_ranks(
    frame: "pd.DataFrame", ending_rank: "np.ndarray", has_class: "np.ndarray", id_rank: "np.ndarray"
) -> "np.ndarray":
    """Rank rows without a severity class among those with the same outcome, by `hazard_margins`.

    A row with margins to several hazards gets its lowest rank number. Rows without a margin: infinite.
    """
    import numpy as np

    margin_rank = np.full(len(frame), np.inf)
    for _, margins in hazard_margins(frame).items():
        margin = margins.to_numpy()
        rows = np.flatnonzero(~has_class & ~np.isnan(margin))
        rows = rows[np.lexsort((id_rank[rows], margin[rows], ending_rank[rows]))]
        _, first, sizes = np.unique(ending_rank[rows], return_index=True, return_counts=True)
        margin_rank[rows] = np.minimum(margin_rank[rows], np.arange(len(rows)) - np.repeat(first, sizes))
    return margin_rank


def worst_first_rank_by_ok_experiment(frame: "pd.DataFrame") -> dict[str, int]:
    """Return the rank of each experiment with status `ok` (0 is the worst). If there is no room for all
    series, those of the worst experiments are kept.
    """
    ranks = worst_first_ranks(frame)
    ended = (frame["status"] == Status.OK.value).to_numpy()
    return dict(zip(frame["experiment_id"][ended], ranks[ended].tolist(), strict=True))
