"""The mutation score of a closed loop: the share of operator mutants that change the drives.

Each mutant is counted once, and it has an effect if any of its drives has that effect. Shares are of
activated mutants; others are listed separately.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mutator._common.tables import Table
from mutator.model import OPERATORS, Fault, Status
from mutator.results.table_columns import alerts_of
from mutator.statistics.paired_statistics import resampled_interval
from mutator.statistics.shares import Share, share
from mutator.statistics.statistics_sheet import Cell, Sheet, text_of
from mutator.triggers.kinds import ALWAYS

GoldenAlerts = Mapping[tuple[str, str], frozenset[str]]  # (scenario, seed or "") -> names of alerts

PERMANENT, TRANSIENT, EITHER = "permanent", "transient", "either"
ALL, MUTANTS, DRIVES = "all", "mutants", "drives"
_EFFECTS = ("actuator changed", "new alert", "hazard", "crash or timeout")
_ALERT, _ACTIVE = _EFFECTS[1], "active"
_HEADS = ("of", "counted", "fault", "number", "not activated", *_EFFECTS, "no effect")
_NOTE = (
    "This table shows how operator mutants affect the closed loop. *Permanent* mutants are active in the "
    "whole drive, *transient* ones while their trigger holds. Shares are of *activated* mutants; a mutant "
    "has an effect if any of its drives shows it. Intervals are 95 % Wilson intervals; for counts of drives, "
    "whole mutants are resampled (bootstrap). *New alert*: an alert that the scenario's fault-free run "
    "does not raise. A drive that crashed or timed out is not judged; it counts only as a crash or timeout "
    "and in the total. *No effect*: none of the four effects; some of these mutants can be equivalent to the "
    "original."
)
_SEVERAL = " The chosen mutants are counted together, without weights for different sampling rates."
_UNKNOWN_ALERTS = " The fault-free runs cannot be read, so alerts are not compared with theirs."


def drives_of(
    frame: pd.DataFrame, faults: Mapping[str, Fault], golden_alerts: GoldenAlerts | None
) -> pd.DataFrame:
    """Return a frame with a row for each usable experiment of an operator mutant.

    Columns: `mutant` (the fault's id), `operator`, `function` (`path::name`), `fault` (permanent or
    transient), a flag `active`, and a flag for each effect. A crashed or timed-out drive is active. Without
    `golden_alerts`, there is no flag for alerts.
    """
    found = frame[frame["module"] == OPERATORS]
    broken = found["status"].isin([Status.CRASHED.value, Status.TIMEOUT.value])
    flags = {
        _ACTIVE: found["is_activated"] | broken,
        **dict(zip(_EFFECTS, (found["is_manifested"], False, found["is_hazard"], broken), strict=True)),
    }
    if golden_alerts is None:
        del flags[_ALERT]
    else:
        flags[_ALERT] = _new_alerts(found, golden_alerts)
    permanent = found["trigger"] == ALWAYS
    return pd.DataFrame(
        {
            "mutant": found["fault_id"],
            "operator": found["fault_type"],
            "function": found["fault_id"].map({name: function_of(fault) for name, fault in faults.items()}),
            "fault": np.where(permanent, PERMANENT, TRANSIENT),
            **flags,
        }
    )


def function_of(fault: Fault) -> str:
    place = fault.injections[0].location
    return f"{place.path}::{place.function}"


def _new_alerts(found: pd.DataFrame, golden_alerts: GoldenAlerts) -> list[bool]:
    rows = zip(found["scenario"], found["seed"].astype(str), found["alerts"], strict=True)
    return [
        not golden_alerts.get((scenario, seed), golden_alerts.get((scenario, ""), frozenset())).issuperset(
            alerts_of(alerts)
        )
        for scenario, seed, alerts in rows
    ]


def score_sheet(
    frame: pd.DataFrame,
    faults: Mapping[str, Fault],
    golden_alerts: GoldenAlerts | None,
    told: Sequence[str] = (),
) -> Sheet:
    """Return the score in total, by operator and by function, for permanent and transient faults. Without
    results of operator mutants, it has no lines. `faults` are those of the plan. `golden_alerts` are the
    alerts that golden runs raise (None: not known). `told` describes the available mutants and exclusions.
    """
    drives = drives_of(frame, faults, golden_alerts)
    planned = {name for name, fault in faults.items() if fault.module == OPERATORS}
    missing = len(planned - set(drives["mutant"]))
    without = f" Without a result, and therefore not counted: {missing} of {len(planned)}." if missing else ""
    chosen = f" Chosen: {'; '.join(f'`{text}`' for text in told)}." if told else ""
    chosen += _SEVERAL if len(told) > 1 and any(" draw" in text for text in told) else ""
    return Sheet(
        name="mutation_score",
        title="Mutation score",
        note=_NOTE + ("" if golden_alerts is not None else _UNKNOWN_ALERTS) + chosen + without,
        heads=_HEADS,
        lines=tuple(_lines(drives)),
    )


def totals(sheet: Sheet) -> Table:
    """Return the lines for all mutants, with fewer columns."""
    rows = [
        (f"{'all' if lasting == EITHER else lasting} {counted}", *map(_short, cells))
        for name, counted, lasting, *cells in sheet.lines
        if name == ALL
    ]
    return Table(heads=("mutation score", *_HEADS[3:]), rows=rows, right=range(1, len(_HEADS) - 2))


def _short(cell: Cell) -> str:
    if not isinstance(cell, Share) or math.isnan(cell.low):
        return text_of(cell)
    return f"{100 * cell.rate:.1f} % ({100 * cell.low:.0f} to {100 * cell.high:.0f})"


def _lines(drives: pd.DataFrame) -> Iterator[tuple[Cell, ...]]:
    if drives.empty:
        return
    yield from _of_mutants(ALL, drives)
    if drives["fault"].nunique() > 1:
        yield _line(ALL, MUTANTS, EITHER, _any_drive(drives))
    if drives.duplicated(["mutant", "fault"]).any():
        for lasting, some in drives.groupby("fault"):
            yield _line(ALL, DRIVES, str(lasting), some.set_index("mutant"))
    for groups in ("operator", "function"):
        for name, some in drives.groupby(groups):
            yield from _of_mutants(str(name), some)


def _of_mutants(name: str, drives: pd.DataFrame) -> Iterator[tuple[Cell, ...]]:
    for lasting, some in drives.groupby("fault"):
        yield _line(name, MUTANTS, str(lasting), _any_drive(some))


def _any_drive(drives: pd.DataFrame) -> pd.DataFrame:
    flags = [name for name in (_ACTIVE, *_EFFECTS) if name in drives]
    return drives.groupby("mutant")[flags].any()


def _line(name: str, counted: str, lasting: str, flags: pd.DataFrame) -> tuple[Cell, ...]:
    """Return a line of the sheet. `flags` has a row for each counted item and is indexed by mutant."""
    active = flags[flags[_ACTIVE]]
    known = [effect for effect in _EFFECTS if effect in active]
    cells = [_share(active[effect]) if effect in active else None for effect in _EFFECTS]
    no_effect = int((~active[known].any(axis=1)).sum())
    return (name, counted, lasting, len(flags), len(flags) - len(active), *cells, no_effect)


def _share(flag: "pd.Series[bool]") -> Share:
    """Return the share of a flag. If a mutant has several rows, the interval resamples whole mutants."""
    count, of = int(flag.sum()), len(flag)
    if flag.index.is_unique:
        return share(count, of)
    sums = flag.groupby(level=0).agg(["sum", "count"])
    low, high = resampled_interval((sums["sum"].to_numpy(), sums["count"].to_numpy()), _rate)
    return Share(count=count, of=of, low=low, high=high)


def _rate(counts: Any, wholes: Any, axis: int = -1) -> Any:
    return np.sum(counts, axis=axis) / np.sum(wholes, axis=axis)
