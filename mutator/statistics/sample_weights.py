"""Weights of a sample's experiments, with which its shares are shares of the whole plan.

An experiment stands for as many of its stratum as were planned for each one that was run, so the weights add
up to the plan. Strata of which none was run have no weight. What an exploration runs is chosen from the
results before, so it is a sample of nothing: its weights are NaN.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mutator._common.message_text import counted
from mutator.config.yaml_files import load_yaml
from mutator.errors import MutatorError
from mutator.explore.exploration_replay import is_exploration
from mutator.model import Fault
from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.store import plan_file
from mutator.store.plan_strata import PlanStrata, SampleDraw, load_strata, stratum_of
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE

if TYPE_CHECKING:
    import pandas as pd

WEIGHT_COLUMN = "weight"  # only in frames of samples and explorations
_WORDS_BY_DRAW = {
    SampleDraw.EVEN: "an even sample, which takes each variant equally often",
    SampleDraw.PROPORTIONAL: "a proportional sample: each fault type in each scenario keeps its share",
}
_STRATA_BY_DRAW = {
    SampleDraw.EVEN: "variant and method",
    SampleDraw.PROPORTIONAL: "fault type, scenario and method",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledPlan:
    """What a sample was drawn from. `strata` is None if the run folder does not have them."""

    strata: PlanStrata | None
    left_out_count: int  # experiments in strata of which none was run
    is_explored: bool = False  # chosen by an exploration, not drawn

    @property
    def is_even(self) -> bool:
        """Whether each variant was drawn equally often."""
        return not self.is_explored and (self.strata is None or self.strata.draw is SampleDraw.EVEN)

    @property
    def note(self) -> str:
        """Say what shares are shares of."""
        if self.is_explored:
            return (
                "The exploration chose each experiment by the results before it, most of them where hazards "
                "begin. So counts of experiments are no rates."
            )
        if self.strata is None:
            return (
                f"The experiments are {_WORDS_BY_DRAW[SampleDraw.EVEN]}. Their run folder does not say "
                "how many of each were planned, so there are no shares of all experiments."
            )
        draw, total = self.strata.draw, self.strata.experiment_count
        note = f"The experiments are {_WORDS_BY_DRAW[draw]}. Shares are weighted by {_STRATA_BY_DRAW[draw]}, "
        note += f"so they estimate those of all {total:,} experiments from which it was drawn."
        if self.left_out_count:
            note += (
                f" They leave out {counted(self.left_out_count, 'experiment')} of strata without a result."
            )
        return note


def with_weights(frame: "pd.DataFrame", run: Path) -> "pd.DataFrame":
    """Return the frame of usable results with the column `weight` if the plan of its run folder is a sample.

    The weights are NaN for an even sample whose strata are not stored, and for an exploration.
    MutatorError if the `campaign.yaml` of a bench is damaged.
    """
    strata = load_strata(run)
    if strata is None:
        folder = RunFolder(run)
        has_no_rates = is_exploration(folder) or _is_even_sample(folder)
        return frame.assign(**{WEIGHT_COLUMN: math.nan}) if has_no_rates else frame
    return with_weights_of_strata(frame, strata, plan_file.load_faults(run))


def with_weights_of_strata(
    frame: "pd.DataFrame", strata: PlanStrata, faults: Mapping[str, Fault]
) -> "pd.DataFrame":
    """Return the frame with the column `weight`. `faults` has the faults of the plan by id."""
    names = _strata_of_rows(frame, strata.draw, faults)
    sizes = names.map(strata.size_by_stratum)
    return frame.assign(**{WEIGHT_COLUMN: (sizes / names.map(names.value_counts())).astype(float)})


def sampled_plan(frame: "pd.DataFrame", run: Path) -> SampledPlan | None:
    """Return what the experiments of a frame from `with_weights` were drawn from, or that an exploration
    chose them; None of a whole plan.
    """
    if WEIGHT_COLUMN not in frame:
        return None
    strata = load_strata(run)
    weighted = round(float(np.nansum(frame[WEIGHT_COLUMN])))
    return SampledPlan(
        strata=strata,
        left_out_count=strata.experiment_count - weighted if strata else 0,
        is_explored=is_exploration(RunFolder(run)),
    )


def _strata_of_rows(frame: "pd.DataFrame", draw: SampleDraw, faults: Mapping[str, Fault]) -> "pd.Series":
    import pandas as pd

    cells = zip(frame["fault_id"], families_or_scenarios_of(frame), frame["method"], strict=True)
    names = [
        stratum_of(draw, faults[fault].spec, str(scenario), str(method)) for fault, scenario, method in cells
    ]
    return pd.Series(names, index=frame.index, dtype=object)


def _is_even_sample(folder: RunFolder) -> bool:
    """Whether the plan is an even sample, by its campaign and options."""
    choices = folder.head.choices
    if choices.limit is not None and not choices.proportional and folder.head.experiments >= choices.limit:
        return True
    try:
        campaign = load_yaml(folder.path / CAMPAIGN_FILE).data
    except MutatorError:
        return False
    if not isinstance(campaign, dict) or campaign.get("sample") is None:
        return False
    return not campaign.get("proportional") and folder.head.experiments >= campaign["sample"]
