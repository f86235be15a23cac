"""The table of how fast cars touch without and with sets of defences."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from mutator.comparison.defence_cost_sheets import unit_by_metric
from mutator.comparison.defended_pairs import DefendedPair, PairOutcome
from mutator.comparison.defended_sets import DefendedSet
from mutator.results.result_rows import ResultRow
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.targets.hazard_severity import DELTA_V_NAME

CONTACT_SPEED_NAME = "contact_speed"  # the metric, if a target has it
_DELTA_V = "change of delta-v"


def contacts_sheet(sets: Sequence[DefendedSet]) -> Sheet:
    """Return the table, without lines for a target whose manifest names no hazard as a contact."""
    scale = sets[0].undefended.folder.head.severity if sets else None
    contact = scale.contact if scale else ""
    metrics = [name for name in (CONTACT_SPEED_NAME, DELTA_V_NAME) if name in unit_by_metric(sets)]
    heads = ["defences", "contacts", "contacts with defences", "others"]
    if CONTACT_SPEED_NAME in metrics:
        heads += [f"{which} speed{side} (m/s)" for which in ("median", "largest") for side in ("", ", with")]
    if DELTA_V_NAME in metrics:
        heads += [f"{_DELTA_V}, {which} (m/s)" for which in ("median", "most")]
    return Sheet(
        name="defended_contacts",
        title="Speed of contacts without and with defences",
        note=f"Experiments whose undefended run has the hazard {contact}, a contact, and how many of them "
        "have it with the set; *others*: with the set only. Speeds are closing speeds at the contact: first "
        "of the undefended contacts, then of those that remain. *Change of delta-v*: with the set minus "
        "without, of the contacts that remain; *most* is the change furthest from 0.",
        heads=tuple(heads),
        lines=tuple(_contact_lines(sets, contact, metrics)) if contact else (),
    )


def _contact_lines(
    sets: Iterable[DefendedSet], contact: str, metrics: Sequence[str]
) -> Iterator[tuple[SheetCell, ...]]:
    for defended in sets:
        pairs = [pair for pair in defended.pairs if pair.outcome is not PairOutcome.NOT_COMPARED]
        before = [pair for pair in pairs if _has(pair.undefended, contact)]
        remaining = [pair for pair in before if _has(pair.defended, contact)]
        others = sum(_has(pair.defended, contact) for pair in pairs) - len(remaining)
        line: list[SheetCell] = [defended.name, len(before), len(remaining), others]
        if CONTACT_SPEED_NAME in metrics:
            runs = (defended.undefended.metrics_by_id, before), (defended.defended.metrics_by_id, remaining)
            speeds = [
                [
                    by_id[name][CONTACT_SPEED_NAME]
                    for name in map(_id_of, those)
                    if CONTACT_SPEED_NAME in by_id.get(name, {})
                ]
                for by_id, those in runs
            ]
            line += [*map(_median, speeds), *(max(values, default=None) for values in speeds)]
        if DELTA_V_NAME in metrics:
            changes = [
                pair.defended.delta_v - pair.undefended.delta_v
                for pair in remaining
                if pair.defended.delta_v is not None and pair.undefended.delta_v is not None
            ]
            line += [_median(changes), max(changes, key=abs, default=None)]
        yield tuple(line)


def _has(row: ResultRow, hazard: str) -> bool:
    return any(name == hazard for name, _ in row.hazards)


def _id_of(pair: DefendedPair) -> str:
    return pair.undefended.experiment_id


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None
