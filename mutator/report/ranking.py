"""Which experiments are the most dangerous."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

SEVERITY = "severity"  # column: S0 to S3, empty without contact
_CONTACT = ("delta_v", "contact_speed")  # what tells how hard a contact was, the better measure first
_MARGIN = "margin_"


def contact_measure(frame: pd.DataFrame) -> str:
    """The column that tells how hard a contact was; '' if the target has none."""
    return next((name for name in _CONTACT if name in frame), "")


def worst_first(frame: pd.DataFrame, metrics: Sequence[Sequence[str]]) -> pd.DataFrame:
    """The experiments that ended in a hazard: by severity, then by how hard the contact was, then by the
    smallest margin to a hazard, then by how soon the hazard came."""
    hazards = frame[frame["outcome"] == "hazard"]
    contact = contact_measure(frame)
    margins = [name for name, *_ in metrics if name.startswith(_MARGIN)]
    smallest = hazards[margins].apply(pd.to_numeric).min(axis=1) if margins else 0.0
    keys = pd.DataFrame(
        {
            "severity": hazards[SEVERITY] if SEVERITY in frame else "",
            "contact": pd.to_numeric(hazards[contact]).fillna(-np.inf) if contact else 0.0,
            "margin": smallest,
            "after": hazards["t_hazard"] - hazards["t_activation"],
            "id": hazards["experiment_id"],
        },
        index=hazards.index,
    )
    ascending = [False, False, True, True, True]
    return hazards.loc[keys.sort_values([*map(str, keys)], ascending=ascending, kind="stable").index]
