"""Hand-made results for the tests of statistics."""

import math
from typing import Any

import pandas as pd

from mutator.statistics.results_frame import prepare_results

_EMPTY = ("t_activation", "t_manifest", "h1", "t_h1", "h2", "t_h2", "h3", "t_h3", "t_alert")
_ROW = {
    "module": "radar",
    "fault_type": "chaff",
    "fault_id": "a",
    "scenario": "S1",
    "method": "guided",
    "trigger": "C2",
    "seed": 1,
    "status": "ok",
    "alerts": "",
    **dict.fromkeys(_EMPTY, math.nan),
}


def results(*rows: dict[str, Any]) -> pd.DataFrame:
    """Return a frame of runs. Each row changes some values of a guided chaff run in S1 that was not
    activated."""
    frame = pd.DataFrame([_ROW | {"experiment_id": str(i)} | row for i, row in enumerate(rows)])
    frame.attrs["hazards"] = ("H1", "H2", "H3")
    return prepare_results(frame)
