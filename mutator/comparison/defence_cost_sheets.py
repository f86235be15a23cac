"""The tables of what sets of defences cost: their commands, and activations that nothing called for."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from mutator.comparison.defended_sets import DefendedSet
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.targets.hazard_and_metric_definitions import MARGIN_PREFIX

_CLOSENESS = {"smallest_gap": "smallest gap", "smallest_ttc": "smallest TTC"}  # metrics, if a target has them


def cost_sheets(sets: Sequence[DefendedSet]) -> tuple[Sheet, ...]:
    """Return the tables of these sets."""
    return _authority_sheet(sets), _golden_sheet(sets), _unneeded_sheet(sets)


def _authority_sheet(sets: Iterable[DefendedSet]) -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for defended in sets:
        commands = dict.fromkeys(name for pair in defended.pairs for name in pair.facts.authority)
        for command in commands:
            values = [
                pair.facts.authority[command] for pair in defended.pairs if command in pair.facts.authority
            ]
            largest = max(values, key=abs)
            lines.append((defended.name, command, len(values), float(np.median(values)), float(largest)))
    return Sheet(
        name="defence_authority",
        title="Commands that defences needed",
        note="Of the experiments in which the set gave this command: the value furthest from 0 in each, in "
        "the command's unit.",
        heads=("defences", "command", "experiments", "median", "largest"),
        lines=tuple(lines),
    )


def _golden_sheet(sets: Iterable[DefendedSet]) -> Sheet:
    return Sheet(
        name="defences_without_faults",
        title="Defences in fault-free drives",
        note="What defences did without a fault. An activation is false if the undefended drive has no "
        "hazard.",
        heads=("defences", "drive", "defence", "first at (s)", "activations", "largest", "false", "hazards"),
        lines=tuple(
            (
                defended.name,
                activity.golden,
                activity.activity.name,
                activity.activity.first,
                activity.activity.activations,
                _largest_commands(activity.activity.commands),
                "yes" if activity.is_false else "no",
                ", ".join(activity.defended_hazards) or "none",
            )
            for defended in sets
            for activity in defended.golden_activities
        ),
    )


def _largest_commands(commands: Iterable[tuple[str, float, float]]) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, _, value in commands)


def _unneeded_sheet(sets: Sequence[DefendedSet]) -> Sheet:
    units = unit_by_metric(sets)
    margins = dict.fromkeys(
        name
        for defended in sets
        for pair in defended.pairs
        if pair.is_unneeded_activation
        for name, _ in pair.undefended.margins
    )
    closeness = [name for name in _CLOSENESS if name in units]
    return Sheet(
        name="unneeded_activations",
        title="Unneeded activations",
        note="Defences that acted in experiments whose undefended run has no hazard, and how close that run "
        "came to one: small gaps, times to collision and margins were close calls.",
        heads=(
            *("defences", "experiment", "fault", "scenario", "acted", "first at (s)"),
            *(_head_with_unit(_CLOSENESS[name], units[name]) for name in closeness),
            *(_head_with_unit(f"margin {name}", units.get(_margin_metric(name), "")) for name in margins),
        ),
        lines=tuple(_unneeded_lines(sets, closeness, [*margins])),
    )


def _unneeded_lines(
    sets: Iterable[DefendedSet], closeness: Sequence[str], margin_names: Sequence[str]
) -> Iterator[tuple[SheetCell, ...]]:
    for defended in sets:
        for pair in defended.pairs:
            if not pair.is_unneeded_activation:
                continue
            row, margins = pair.undefended, dict(pair.undefended.margins)
            metrics = defended.undefended.metrics_by_id.get(row.experiment_id, {})
            yield (
                *(defended.name, row.experiment_id, row.fault, row.scenario_label),
                *(", ".join(pair.facts.acted), pair.facts.first_acted_s),
                *(metrics.get(name) for name in closeness),
                *(margins.get(name) for name in margin_names),
            )


def unit_by_metric(sets: Sequence[DefendedSet]) -> dict[str, str]:
    """Return the units of the metrics of the sets' target, by name."""
    return {metric.name: metric.unit for metric in sets[0].undefended.folder.head.metrics} if sets else {}


def _margin_metric(hazard: str) -> str:
    return f"{MARGIN_PREFIX}{hazard.lower()}"


def _head_with_unit(name: str, unit: str) -> str:
    return name if unit in ("", "-") else f"{name} ({unit})"
