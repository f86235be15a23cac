"""Ranks results from worst to best."""

from typing import TYPE_CHECKING

from mutator.model import Outcome, Status
from mutator.results.outcome_counting import (
    fault_types_of,
    first_hazard_times,
    hazard_margins,
    outcome_or_status_of_rows,
)
from mutator.targets.hazard_severity import DELTA_V_NAME, SEVERITY_CLASSES
from mutator.targets.stored_target_facts import DRIVE_END_COLUMN

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
    Outcome.NOT_JUDGED.value,
    Status.INVALID_MUTANT.value,
    Status.HARNESS_ERROR.value,
    Status.LEFT_OUT.value,
)


def worst_first_ranks(frame: "pd.DataFrame") -> "np.ndarray":
    """Return the rank (from 0: the worst) of each row of a frame of results, whatever the order of the rows.

    Rows with a severity class come first, by class; the others follow by outcome. In each of these groups,
    silent hazards precede hazards after an alert. Then the margin decides, alternating between hazards,
    because margins with different units cannot be compared; a contact has its delta-v instead. Then the time
    from the activation to the hazard decides, and last the id.
    """
    import numpy as np
    import pandas as pd

    ending_rank = pd.Index(_ENDINGS_WORST_FIRST).get_indexer(pd.Index(outcome_or_status_of_rows(frame)))
    severity = frame["severity"] if "severity" in frame else pd.Series("", frame.index)
    severity_rank = pd.Index(SEVERITY_CLASSES).get_indexer(pd.Index(severity))
    was_warned = frame["reaction_time"].notna().to_numpy()
    group = np.column_stack([-severity_rank, ending_rank, was_warned])
    time = frame["time_to_hazard"].fillna(np.inf).to_numpy() if "time_to_hazard" in frame else np.inf
    time = np.broadcast_to(time, len(frame))
    id_rank = np.empty(len(frame), dtype=np.int64)
    id_rank[np.argsort(frame["experiment_id"].to_numpy(dtype=object), kind="stable")] = np.arange(len(frame))
    group_number = np.unique(group, axis=0, return_inverse=True)[1].ravel()
    margin_rank = _margin_ranks(frame, group_number, time, id_rank)
    order = np.lexsort((id_rank, time, margin_rank, *group.T[::-1]))
    ranks = np.empty(len(frame), dtype=np.int64)
    ranks[order] = np.arange(len(frame))
    return ranks


def _margin_ranks(
    frame: "pd.DataFrame", group_number: "np.ndarray", time: "np.ndarray", id_rank: "np.ndarray"
) -> "np.ndarray":
    """Rank rows among those of their group, for each hazard by margin, time and id.

    A row with margins to several hazards gets its lowest rank number. Rows without a margin: infinite.
    """
    import numpy as np

    margin_rank = np.full(len(frame), np.inf)
    for _, margins in _margins_with_delta_v(frame).items():
        margin = margins.to_numpy()
        rows = np.flatnonzero(~np.isnan(margin))
        rows = rows[np.lexsort((id_rank[rows], time[rows], margin[rows], group_number[rows]))]
        _, first, sizes = np.unique(group_number[rows], return_index=True, return_counts=True)
        margin_rank[rows] = np.minimum(margin_rank[rows], np.arange(len(rows)) - np.repeat(first, sizes))
    return margin_rank


def _margins_with_delta_v(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return `hazard_margins`, with minus delta-v for the contact that ended a drive: its margin is how far
    the car came in the last step.
    """
    margins = hazard_margins(frame)
    if not {DELTA_V_NAME, DRIVE_END_COLUMN} <= {*frame.columns}:
        return margins
    for name, times in first_hazard_times(frame).items():
        is_contact = frame[DELTA_V_NAME].notna() & (times == frame[DRIVE_END_COLUMN])
        margin = margins[name] if name in margins else float("nan")
        margins[name] = (-frame[DELTA_V_NAME]).where(is_contact, margin)
    return margins


def causes_of(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return the cause of each row: the fault type (`kind`) and the `hazard` that has the severity class, or
    else the first one; '' without a hazard.
    """
    import pandas as pd

    times = first_hazard_times(frame)
    names = [*times.columns, ""]
    order = times.fillna(float("inf")).to_numpy().argmin(axis=1) if len(times.columns) else []
    first = [
        names[i] if happened else "" for i, happened in zip(order, times.notna().any(axis=1), strict=False)
    ]
    hazard = pd.Series(first or "", frame.index, dtype=object)
    if "severity_hazard" in frame:
        hazard = frame["severity_hazard"].where(frame["severity_hazard"] != "", hazard)
    return pd.DataFrame(
        {"kind": frame["kind"] if "kind" in frame else fault_types_of(frame), "hazard": hazard},
        index=frame.index,
    )


def worst_of_each_cause(ranked: "pd.DataFrame") -> tuple["pd.DataFrame", list[int]]:
    """Return the first row of each cause and outcome, and how many more rows have them. `ranked` is sorted,
    worst first.
    """
    keys = causes_of(ranked).assign(ending=outcome_or_status_of_rows(ranked))
    group = keys.groupby(list(keys), sort=False).ngroup()
    more = (group.groupby(group).size() - 1).tolist()
    return ranked[~group.duplicated()], more


def worst_first_rank_by_ok_experiment(frame: "pd.DataFrame") -> dict[str, int]:
    """Return the rank of each experiment with status `ok` (0 is the worst). If there is no room for all
    series, those of the worst experiments are kept.
    """
    ranks = worst_first_ranks(frame)
    ended = (frame["status"] == Status.OK.value).to_numpy()
    return dict(zip(frame["experiment_id"][ended], ranks[ended].tolist(), strict=True))
