"""What the runs of a campaign without a canary say about whether a hazard can be reached."""

from typing import TYPE_CHECKING

from mutator.model import Outcome
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    import pandas as pd

_NO_CANARY = "Without a canary, nothing but these runs shows that a hazard can be reached"


def no_canary_note(folder: RunFolder, results: "pd.DataFrame") -> str:
    """Return the first line of results and report, with the first experiment of the plan that reached a
    hazard; '' if the campaign has a canary. `results` has a row for each experiment, in plan order.
    """
    if folder.head.canary is not None:
        return ""
    hazards = results[results["outcome"] == Outcome.HAZARD.value]
    if hazards.empty:
        return f"{_NO_CANARY}, and none of them reached one."
    first = hazards.iloc[0]
    label = plan_file.load_faults(folder.path)[first["fault_id"]].label
    return (
        f"{_NO_CANARY}; the first that reached one is {first['experiment_id'][:8]}: {label} in "
        f"{first['scenario']}, {first['trigger']}."
    )
