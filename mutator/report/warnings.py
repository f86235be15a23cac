"""Whether a hazard came with a warning: the one meaning of *silent* in reports."""

from mutator.outcomes.rows import Row

FIRST = "alert before the hazard"
NO_ALERT, LATE = "no alert at all", "alert only after the hazard"
SILENT = (NO_ALERT, LATE)  # no alert came before the hazard


def warning(row: Row) -> str:
    """Value of the page's filter `warning`; '' without a hazard."""
    if not row.hazards:
        return ""
    if not row.alerts:
        return NO_ALERT
    return LATE if row.reaction_time is None else FIRST
