"""The mutation score of a closed loop: the share of operator mutants that change the drives.

Each mutant is counted once, and it has an effect if any of its drives has that effect. Shares are of
activated mutants; others are listed separately.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator._common.table_rendering import TextTable
from mutator.model import OPERATOR_FAULTS_MODULE, Fault, Status
from mutator.results.table_columns import alert_names_in
from mutator.statistics.paired_statistics import resampled_interval
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.shares_with_intervals import Share, share_with_interval
from mutator.statistics.statistics_sheet import Sheet, SheetCell, cell_text
from mutator.triggers.trigger_kinds import ALWAYS_NAME

if TYPE_CHECKING:
    import pandas as pd

AlertsByGoldenRun = Mapping[tuple[str, str], frozenset[str]]  # (scenario, seed or "") -> names of alerts

PERMANENT, TRANSIENT, EITHER = "permanent", "transient", "either"
ALL_MUTANTS, MUTANTS, DRIVES = "all", "mutants", "drives"
_EFFECT_NAMES = ("actuator changed", "new alert", "hazard", "crash or timeout")
_ALERT_EFFECT, _ACTIVE_COLUMN = _EFFECT_NAMES[1], "active"
_COLUMN_HEADS = ("of", "counted", "fault", "number", "not activated", *_EFFECT_NAMES, "no effect")
_NOTE = (
    "This table shows how operator mutants affect the closed loop. *Permanent* mutants are active in the "
    "whole drive, *transient* ones while their trigger holds. Shares are of *activated* mutants; a mutant "
    "has an effect if any of its drives shows it. Intervals are 95 % Wilson intervals; for counts of drives, "
    "whole mutants are resampled (bootstrap). *New alert*: an alert that the scenario's fault-free run "
    "does not raise. A drive that crashed or timed out is not judged; it counts only as a crash or timeout "
    "and in the total. *No effect*: none of the four effects; some of these mutants can be equivalent to the "
    "original."
)
_SEVERAL_SELECTIONS_NOTE = (
    " The chosen mutants are counted together, without weights for different sampling rates."
)
_UNKNOWN_ALERTS_NOTE = " The fault-free runs cannot be read, so alerts are not compared with theirs."


def mutant_effect_flags(
    frame: "pd.DataFrame", faults: Mapping[str, Fault], golden_alerts: AlertsByGoldenRun | None
) -> "pd.DataFrame":
    """Return a frame with a row for each usable experiment of an operator mutant.

    Columns: `mutant` (the fault's id), `operator`, `function` (`path::name`), `fault` (permanent or
    transient), a flag `active`, and a flag for each effect. A crashed or timed-out drive is active. Without
    `golden_alerts`, there is no flag for alerts.
    """
    import pandas as pd

    mutant_runs = frame[frame["module"] == OPERATOR_FAULTS_MODULE]
    is_broken = mutant_runs["status"].isin([Status.CRASHED.value, Status.TIMEOUT.value])
    flags = {
        _ACTIVE_COLUMN: mutant_runs["is_activated"] | is_broken,
        **dict(
            zip(
                _EFFECT_NAMES,
                # `False` stands for new alerts; it is replaced or removed below
                (mutant_runs["is_manifested"], False, mutant_runs["is_hazard"], is_broken),
                strict=True,
            )
        ),
    }
    if golden_alerts is None:
        del flags[_ALERT_EFFECT]
    else:
        flags[_ALERT_EFFECT] = _new_alert_flags(mutant_runs, golden_alerts)
    permanent = mutant_runs["trigger"] == ALWAYS_NAME
    return pd.DataFrame(
        {
            "mutant": mutant_runs["fault_id"],
            "operator": mutant_runs["fault_type"],
            "function": mutant_runs["fault_id"].map(
                {name: function_label(fault) for name, fault in faults.items()}
            ),
            "fault": np.where(permanent, PERMANENT, TRANSIENT),
            **flags,
        }
    )


def function_label(fault: Fault) -> str:
    location = fault.injections[0].location
    return f"{location.path}::{location.function}"


def _new_alert_flags(mutant_runs: "pd.DataFrame", golden_alerts: AlertsByGoldenRun) -> list[bool]:
    rows = zip(mutant_runs["scenario"], mutant_runs["seed"].astype(str), mutant_runs["alerts"], strict=True)
    return [
        not golden_alerts.get((scenario, seed), golden_alerts.get((scenario, ""), frozenset())).issuperset(
            alert_names_in(alerts)
        )
        for scenario, seed, alerts in rows
    ]


def mutation_score_sheet(
    frame: "pd.DataFrame",
    faults: Mapping[str, Fault],
    golden_alerts: AlertsByGoldenRun | None,
    operator_notes: Sequence[str] = (),
) -> Sheet:
    """Return the score in total, by operator and by function, for permanent and transient faults. Without
    results of operator mutants, it has no lines. `faults` are those of the plan. `golden_alerts` are the
    alerts that golden runs raise (None: not known). `operator_notes` describe the available mutants and
    exclusions.
    """
    drives = mutant_effect_flags(frame, faults, golden_alerts)
    planned = {name for name, fault in faults.items() if fault.module == OPERATOR_FAULTS_MODULE}
    missing = len(planned - set(drives["mutant"]))
    without = f" Without a result, and therefore not counted: {missing} of {len(planned)}." if missing else ""
    chosen = f" Chosen: {'; '.join(f'`{text}`' for text in operator_notes)}." if operator_notes else ""
    chosen += (
        _SEVERAL_SELECTIONS_NOTE
        if len(operator_notes) > 1 and any(" draw" in text for text in operator_notes)
        else ""
    )
    lines = tuple(_sheet_lines(drives))
    if WEIGHT_COLUMN in frame:
        lines = tuple(tuple(map(_without_rate, line)) for line in lines)
        without += " The experiments are a sample, so shares of all mutants are not known."
    return Sheet(
        name="mutation_score",
        title="Mutation score",
        note=_NOTE + ("" if golden_alerts is not None else _UNKNOWN_ALERTS_NOTE) + chosen + without,
        heads=_COLUMN_HEADS,
        lines=lines,
    )


def _without_rate(cell: SheetCell) -> SheetCell:
    """Return a share as its counts alone; any other cell as it is."""
    if not isinstance(cell, Share):
        return cell
    return replace(cell, low=math.nan, high=math.nan, weighted_rate=math.nan)


def totals_table(sheet: Sheet) -> TextTable:
    """Return the lines for all mutants, with fewer columns."""
    rows = [
        (f"{'all' if fault_kind == EITHER else fault_kind} {counted}", *map(_short_text, cells))
        for name, counted, fault_kind, *cells in sheet.lines
        if name == ALL_MUTANTS
    ]
    return TextTable(
        heads=("mutation score", *_COLUMN_HEADS[3:]),
        rows=rows,
        right_aligned=range(1, len(_COLUMN_HEADS) - 2),
    )


def _short_text(cell: SheetCell) -> str:
    if not isinstance(cell, Share) or math.isnan(cell.low):
        return cell_text(cell)
    return f"{100 * cell.rate:.1f} % ({100 * cell.low:.0f} to {100 * cell.high:.0f})"


def _sheet_lines(drives: "pd.DataFrame") -> Iterator[tuple[SheetCell, ...]]:
    if drives.empty:
        return
    yield from _lines_by_fault_kind(ALL_MUTANTS, drives)
    if drives["fault"].nunique() > 1:
        yield _sheet_line(ALL_MUTANTS, MUTANTS, EITHER, _flags_by_mutant(drives))
    if drives.duplicated(["mutant", "fault"]).any():
        for fault_kind, group in drives.groupby("fault"):
            yield _sheet_line(ALL_MUTANTS, DRIVES, str(fault_kind), group.set_index("mutant"))
    for groups in ("operator", "function"):
        for name, group in drives.groupby(groups):
            yield from _lines_by_fault_kind(str(name), group)


def _lines_by_fault_kind(name: str, drives: "pd.DataFrame") -> Iterator[tuple[SheetCell, ...]]:
    for fault_kind, group in drives.groupby("fault"):
        yield _sheet_line(name, MUTANTS, str(fault_kind), _flags_by_mutant(group))


def _flags_by_mutant(drives: "pd.DataFrame") -> "pd.DataFrame":
    flags = [name for name in (_ACTIVE_COLUMN, *_EFFECT_NAMES) if name in drives]
    return drives.groupby("mutant")[flags].any()


def _sheet_line(name: str, counted: str, fault_kind: str, flags: "pd.DataFrame") -> tuple[SheetCell, ...]:
    """Return a line of the sheet. `flags` has a row for each counted item and is indexed by mutant."""
    active = flags[flags[_ACTIVE_COLUMN]]
    effects = [effect for effect in _EFFECT_NAMES if effect in active]
    cells = [_share_of_flag(active[effect]) if effect in active else None for effect in _EFFECT_NAMES]
    no_effect = int((~active[effects].any(axis=1)).sum())
    return (name, counted, fault_kind, len(flags), len(flags) - len(active), *cells, no_effect)


def _share_of_flag(flag: "pd.Series[bool]") -> Share:
    """Return the share of a flag. If a mutant has several rows, the interval resamples whole mutants."""
    count, total = int(flag.sum()), len(flag)
    if flag.index.is_unique:
        return share_with_interval(count, total)
    sums = flag.groupby(level=0).agg(["sum", "count"])
    low, high = resampled_interval((sums["sum"].to_numpy(), sums["count"].to_numpy()), _rate_of_sums)
    return Share(count=count, of=total, low=low, high=high)


def _rate_of_sums(counts: Any, wholes: Any, axis: int = -1) -> Any:
    return np.sum(counts, axis=axis) / np.sum(wholes, axis=axis)
