"""The variation between a campaign's seeds. Each seed repeats the whole campaign with different draws.

An interval over runs assumes independence and ignores the variation of draws. Resampling whole seeds shows
how much another campaign with the same number of seeds could differ.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator.statistics.paired_statistics import resampled_interval
from mutator.statistics.results_frame import hazard_names
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.statistics_sheet import PercentRate, Sheet, SheetCell
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd

ALL_FAULTS = "all"  # label of the lines for all faults
_NOTE = (
    "All seeds: the share over all runs, with its 95 % Wilson interval. Between seeds: the 95 % interval "
    "from 9,999 resamples of whole seeds (none if all seeds agree). Least and largest: the smallest and the "
    "largest share of a seed. Shares of a sample are weighted, and its intervals over runs come from "
    "resampling whole faults."
)
_COLUMN_HEADS = (
    *("faults", "what", "of", "all seeds", "between seeds, low", "between seeds, high"),
    *("least", "seed of the least", "largest", "seed of the largest", "seeds"),
)
_INJECTED, _ACTIVATED, _HAZARDS = "injected", "activated", "hazards"
_SHARES_BY_FAULT_TYPE = ((_ACTIVATED, _INJECTED), (_HAZARDS, _ACTIVATED), (_HAZARDS, _INJECTED))


def seeds_of(frame: "pd.DataFrame") -> list[str]:
    """Return the seeds of a frame in numeric order."""
    return list(map(str, sorted(frame["seed"].unique())))


def seeds_sheet(frame: "pd.DataFrame", *, has_alerts: bool = True) -> Sheet:
    """Tabulate each share over all faults and by method. With a single seed, the table has no lines."""
    methods = sorted(map(str, frame["method"].unique()))
    groups = {ALL_FAULTS: np.ones(len(frame), dtype=bool)}
    if len(methods) > 1:
        groups |= {name: (frame["method"] == name).to_numpy() for name in methods}
    return Sheet(
        name="seeds",
        title="Spread between seeds",
        note=_NOTE,
        heads=_COLUMN_HEADS,
        lines=tuple(_sheet_lines(frame, groups, _event_and_base_pairs(frame, has_alerts=has_alerts))),
    )


def seeds_by_fault_type_sheet(frame: "pd.DataFrame") -> Sheet:
    kinds = sorted(map(str, frame["kind"].unique()))
    groups = {name: (frame["kind"] == name).to_numpy() for name in kinds}
    return Sheet(
        name="seeds_by_fault_type",
        title="Spread between seeds by fault type",
        note=_NOTE,
        heads=("fault type", *_COLUMN_HEADS[1:]),
        lines=tuple(_sheet_lines(frame, groups, _SHARES_BY_FAULT_TYPE)),
    )


def _event_and_base_pairs(frame: "pd.DataFrame", *, has_alerts: bool) -> list[tuple[str, str]]:
    """Return the shares to compute, each as (what is counted, the base)."""
    shares = [(_ACTIVATED, _INJECTED), ("manifested", _ACTIVATED), *_SHARES_BY_FAULT_TYPE[1:]]
    shares += [(name, whole) for name in hazard_names(frame) for whole in (_ACTIVATED, _INJECTED)]
    if has_alerts:
        shares += [("alerts", _ACTIVATED), ("alerts", _INJECTED)]
        shares += [("hazards without alert", whole) for whole in (_ACTIVATED, _HAZARDS)]
        shares += [("alerts without hazard", _ACTIVATED)]
    return shares


def _event_flags(frame: "pd.DataFrame") -> dict[str, np.ndarray]:
    hazard, alert = (frame[name].to_numpy(dtype=bool) for name in ("is_hazard", "is_alert"))
    return {
        _INJECTED: np.ones(len(frame), dtype=bool),
        _ACTIVATED: frame["is_activated"].to_numpy(dtype=bool),
        "manifested": frame["is_manifested"].to_numpy(dtype=bool),
        _HAZARDS: hazard,
        "alerts": alert,
        "hazards without alert": hazard & ~alert,
        "alerts without hazard": alert & ~hazard,
        **{name: frame[f"t_{name.lower()}"].notna().to_numpy() for name in hazard_names(frame)},
    }


def _sheet_lines(
    frame: "pd.DataFrame", groups: Mapping[str, np.ndarray], shares: Sequence[tuple[str, str]]
) -> Iterator[tuple[SheetCell, ...]]:
    import pandas as pd

    seeds = seeds_of(frame)
    if len(seeds) < 2:
        return
    weights = frame[WEIGHT_COLUMN].to_numpy(dtype=float) if WEIGHT_COLUMN in frame else None
    codes, flags = pd.Index(seeds).get_indexer(pd.Index(frame["seed"].astype(str))), _event_flags(frame)
    for group, chosen in groups.items():
        for part, whole in shares:
            is_in_whole = chosen & flags[whole] & (codes >= 0)
            counts, wholes = (
                np.bincount(codes[rows], None if weights is None else weights[rows], minlength=len(seeds))
                for rows in (is_in_whole & flags[part], is_in_whole)
            )
            share = share_of_runs(frame, pd.Series(flags[part]), pd.Series(is_in_whole))
            yield (group, part, whole, share, *_spread_cells(seeds, counts, wholes))


def _spread_cells(seeds: Sequence[str], counts: np.ndarray, wholes: np.ndarray) -> tuple[SheetCell, ...]:
    low, high = resampled_interval((counts, wholes), _rate_of_sums)
    rates = [
        (count / total, int(seed)) for seed, count, total in zip(seeds, counts, wholes, strict=True) if total
    ]
    least, largest = min(rates, default=None), min(rates, key=lambda k: (-k[0], k[1]), default=None)
    return (
        *(PercentRate(low), PercentRate(high)),
        *((PercentRate(least[0]), least[1]) if least else (None, None)),
        *((PercentRate(largest[0]), largest[1]) if largest else (None, None)),
        len(rates),
    )


def _rate_of_sums(counts: Any, wholes: Any, axis: int = -1) -> Any:
    with np.errstate(invalid="ignore"):  # if a draw has nothing to count, the result is NaN
        return np.sum(counts, axis=axis) / np.sum(wholes, axis=axis)
