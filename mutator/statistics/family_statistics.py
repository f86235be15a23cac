"""Results by concrete scenario of a family, and shares over a family.

Experiments of one scenario are alike, so intervals resample whole scenarios.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mutator.families.family_facts import FamilyFacts, merged_parameters
from mutator.model import ConcreteScenario, Outcome
from mutator.statistics.bootstrap_median_intervals import draw_cluster_counts
from mutator.statistics.fault_free_drive_tables import JudgedDrive
from mutator.statistics.results_frame import hazard_names
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL, Share
from mutator.statistics.statistics_sheet import Sheet, SheetCell

if TYPE_CHECKING:
    import pandas as pd

GOLDEN_HAZARDS_COLUMN, GOLDEN_METRIC_PREFIX = "golden_hazards", "golden_"
_OUTCOMES = tuple(outcome.value for outcome in Outcome if outcome is not Outcome.NOT_JUDGED)
_LEAST_SCENARIOS = 10  # for an interval: in simulations, that of 5 covered 86 % of the time instead of 95
_FAILED = "failed"  # crashed or timed out


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightedShare:
    """A share with weights, and the ends of its interval; both are NaN if there is none."""

    rate: float
    low: float
    high: float

    def __str__(self) -> str:
        text = f"{100 * self.rate:.1f} %"
        return text if math.isnan(self.low) else f"{text} ({100 * self.low:.1f} to {100 * self.high:.1f})"


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyShare:
    """The share of a family's experiments that ended in one way: plain, and weighted if there are weights."""

    what: str
    share: Share
    weighted: WeightedShare | None


def scenarios_frame(
    families: Sequence[FamilyFacts],
    scenarios: Iterable[ConcreteScenario],
    usable: "pd.DataFrame",
    drives: Iterable[JudgedDrive] = (),
) -> "pd.DataFrame":
    """Return a frame with a row for each concrete scenario, indexed by name: family, label, parameters, what
    its golden run did (if known), and counts of its experiments.

    `usable` are the experiments from `prepare_results`, `drives` the golden runs. With several of a scenario,
    hazards are those of any, and metrics those of the run with the fewest changes.
    """
    import pandas as pd

    rows = {scenario.name: _scenario_cells(families, scenario) for scenario in scenarios}
    frame = pd.DataFrame.from_dict(rows, orient="index")
    golden = _golden_cells(drive for drive in drives if drive.golden_run.scenario in rows)
    golden_frame = pd.DataFrame.from_dict(golden, orient="index").reindex(list(rows))
    frame[GOLDEN_HAZARDS_COLUMN] = golden_frame[GOLDEN_HAZARDS_COLUMN] if golden else None
    metrics = golden_frame.drop(columns=GOLDEN_HAZARDS_COLUMN, errors="ignore")
    frame = pd.concat([frame, metrics], axis=1)
    for column, counts in _counts_by_scenario(usable).items():
        frame[column] = counts.reindex(frame.index, fill_value=0).astype(int)
    return frame.rename_axis("scenario")


def _scenario_cells(families: Sequence[FamilyFacts], scenario: ConcreteScenario) -> dict[str, object]:
    return {
        "family": scenario.family,
        "label": scenario.label,
        **{parameter.key: scenario.values.get(parameter.key) for parameter in merged_parameters(families)},
    }


def _golden_cells(drives: Iterable[JudgedDrive]) -> dict[str, dict[str, object]]:
    cells: dict[str, dict[str, object]] = {}
    hazards: dict[str, dict[str, None]] = {}
    for drive in sorted(
        drives, key=lambda drive: (len(drive.golden_run.changes), drive.golden_run.seed or 0)
    ):
        name, verdict = drive.golden_run.scenario, drive.verdict
        hazards.setdefault(name, {}).update(dict.fromkeys(hazard for hazard, _ in verdict.hazards))
        cells.setdefault(name, {f"{GOLDEN_METRIC_PREFIX}{name}": value for name, value in verdict.metrics})
    return {name: {GOLDEN_HAZARDS_COLUMN: ";".join(hazards[name]), **cells[name]} for name in cells}


def _counts_by_scenario(usable: "pd.DataFrame") -> dict[str, "pd.Series"]:
    """Return the number of experiments of each scenario: all, and by outcome and hazard."""
    import pandas as pd

    flags = {"experiments": pd.Series(True, index=usable.index)}
    flags |= {outcome: usable["outcome"] == outcome for outcome in _OUTCOMES}
    flags[_FAILED] = usable["outcome"] == ""
    flags |= {name.lower(): usable[f"t_{name.lower()}"].notna() for name in hazard_names(usable)}
    return {name: column.groupby(usable["scenario"]).sum() for name, column in flags.items()}


def family_shares(
    of_family: "pd.DataFrame", hazards: Sequence[str], weights: np.ndarray | None = None
) -> list[FamilyShare]:
    """Return the shares of a family's experiments by outcome and hazard, given its rows of `scenarios_frame`,
    perhaps with a weight for each. Scenarios without experiments do not count.
    """
    has_runs = of_family["experiments"].to_numpy() > 0
    rows = of_family[has_runs]
    measures = {name.replace("_", " "): name for name in _OUTCOMES}
    if rows[_FAILED].any():
        measures["crashed or timed out"] = _FAILED
    if len(hazards) > 1:
        measures |= {f"hazard {name}": name.lower() for name in sorted(hazards)}
    parts, whole = rows[list(measures.values())].to_numpy(float), rows["experiments"].to_numpy(float)
    intervals = _intervals(parts, whole)
    shares = [
        Share(count=int(part.sum()), of=int(whole.sum()), low=low, high=high)
        for part, (low, high) in zip(parts.T, intervals, strict=True)
    ]
    weighted: Sequence[WeightedShare | None] = [None] * len(shares)
    if weights is not None:
        chosen = weights[has_runs]
        weighted = _weighted_shares(parts * chosen[:, None], whole * chosen)
    return [
        FamilyShare(what=what, share=share, weighted=of_weights)
        for what, share, of_weights in zip(measures, shares, weighted, strict=True)
    ]


def _weighted_shares(parts: np.ndarray, whole: np.ndarray) -> list[WeightedShare | None]:
    total = whole.sum()
    if not total:
        return [None] * parts.shape[1]
    return [
        WeightedShare(rate=float(part.sum() / total), low=low, high=high)
        for part, (low, high) in zip(parts.T, _intervals(parts, whole), strict=True)
    ]


def _intervals(parts: np.ndarray, whole: np.ndarray) -> list[tuple[float, float]]:
    """Return the 95 % interval of each column's sum over that of `whole`, from a bootstrap over the rows.

    NaN for fewer than ten rows, for which such an interval covers too little, and if all rows have the same
    share, because other scenarios can differ.
    """
    count = len(whole)
    if count < _LEAST_SCENARIOS:
        return [(math.nan, math.nan)] * parts.shape[1]
    draws = []
    for counts in draw_cluster_counts(count, parts.shape[1]):
        of = counts @ whole
        draws.append((counts @ parts)[of > 0] / of[of > 0, None])
    tail = (1 - CONFIDENCE_LEVEL) / 2
    low, high = np.quantile(np.concatenate(draws), (tail, 1 - tail), axis=0)
    return [(float(a), float(b)) if a < b else (math.nan, math.nan) for a, b in zip(low, high, strict=True)]


def families_sheet(shares_by_family: Mapping[str, Sequence[FamilyShare]]) -> Sheet:
    """Return the shares of all families as a table."""
    has_weights = any(share.weighted for shares in shares_by_family.values() for share in shares)
    lines: list[tuple[SheetCell, ...]] = []
    for family, shares in shares_by_family.items():
        for share in shares:
            weighted = share.weighted
            cells = (weighted.rate, weighted.low, weighted.high) if weighted else (None, None, None)
            lines.append((family, share.what, share.share, *(cells if has_weights else ())))
    weighted_heads = ("weighted", "weighted low", "weighted high") if has_weights else ()
    return Sheet(
        name="families",
        title="Families",
        note="Shares of a family's experiments. Intervals: 95 %, by bootstrap over concrete scenarios.",
        heads=("family", "what", "share", *weighted_heads),
        lines=tuple(lines),
    )
