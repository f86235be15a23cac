"""Whether a hazard came with a warning: the single definition of *silent* in reports."""

from typing import TYPE_CHECKING

import numpy as np

from mutator.outcomes.rows import Row

if TYPE_CHECKING:
    import pandas as pd

FIRST = "alert before the hazard"
NO_ALERT, LATE = "no alert at all", "alert only after the hazard"
SILENT = (NO_ALERT, LATE)  # no alert before the hazard


def warning(row: Row) -> str:
    """Value of the page's filter `warning`; '' without a hazard."""
    if not row.hazards:
        return ""
    if not row.alerts:
        return NO_ALERT
    return LATE if row.reaction_time is None else FIRST


def warnings_of(frame: "pd.DataFrame") -> "np.ndarray":
    """`warning` for each row of a frame of results from `statistics.frame`."""
    late = np.where(frame["reaction_time"] == "", LATE, FIRST)
    hazard = np.where(frame["alerts"] == "", NO_ALERT, late)
    return np.where(frame["is_hazard"], hazard, "")
