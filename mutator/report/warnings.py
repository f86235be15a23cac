"""Defines which hazards came with a warning, and which are *silent* in reports."""

from typing import TYPE_CHECKING

import numpy as np

from mutator.results.rows import Row

if TYPE_CHECKING:
    import pandas as pd

FIRST = "alert before the hazard"
NO_ALERT, LATE = "no alert at all", "alert only after the hazard"
SILENT = (NO_ALERT, LATE)  # silent hazards: no alert before the hazard


def warning(row: Row) -> str:
    """Return the value of the page's filter `warning`; '' without a hazard."""
    if not row.hazards:
        return ""
    if not row.alerts:
        return NO_ALERT
    return LATE if row.reaction_time is None else FIRST


def warnings_of(frame: "pd.DataFrame") -> "np.ndarray":
    """Return the value of `warning` for each row of a frame from `statistics.frame`."""
    late = np.where(frame["reaction_time"] == "", LATE, FIRST)
    hazard = np.where(frame["alerts"] == "", NO_ALERT, late)
    return np.where(frame["is_hazard"], hazard, "")
