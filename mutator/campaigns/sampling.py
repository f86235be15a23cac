"""Draws a small, even and reproducible sample from many experiments."""

import random
from collections import Counter, defaultdict, deque
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import replace

from mutator._common.hashing import digest
from mutator.model import AfterHazard, Experiment

_Cell = tuple[str, str, str, str]  # variant, method or methods, family or scenario, trigger


def evenly_spread_indices(count: int, size: int) -> list[int]:
    """Return `size` of the indices 0 ... count-1, evenly spread."""
    if size >= count:
        return list(range(count))
    return [(2 * i + 1) * count // (2 * size) for i in range(size)]


def draw_balanced(experiments: Sequence[Experiment], count: int, seed: int) -> tuple[Experiment, ...]:
    """Draw `count` experiments, balanced over variants first, then over method, scenario and trigger.

    The experiments keep their order. A hash of seed and id selects values and breaks ties. The scenarios of a
    family count as one, and take turns.
    """
    return _draw_units(experiments, [[experiment] for experiment in experiments], count, seed)


def draw_balanced_pairs(experiments: Sequence[Experiment], count: int, seed: int) -> tuple[Experiment, ...]:
    """Like `draw_balanced`, but take a guided experiment together with its random partner if both exist.

    If `count` does not fit whole pairs, the last pair is split.
    """
    pairs: dict[Hashable, list[Experiment]] = defaultdict(list)
    for experiment in experiments:
        pairs[experiment.scenario, _pair_key(experiment)].append(experiment)
    together = [sorted(pair, key=lambda e: (e.method.value, e.id)) for pair in pairs.values()]
    return _draw_units(experiments, together, count, seed)


def _draw_units(
    experiments: Sequence[Experiment], units: Iterable[list[Experiment]], count: int, seed: int
) -> tuple[Experiment, ...]:
    """Like `draw_balanced`, but draw whole `units`. Only the last one is split if `count` requires it."""
    if count >= len(experiments):
        return tuple(experiments)
    cells: dict[str, dict[_Cell, deque[list[Experiment]]]] = defaultdict(dict)
    # a hash instead of a shuffle: a unit keeps its rank when others join the campaign
    for unit in sorted(units, key=lambda unit: digest([seed, _ignoring_after_hazard(unit[0]).id])):
        cell = _cell(unit)
        cells[cell[0]].setdefault(cell, deque()).append(unit)
    for cells_of_variant in cells.values():
        for cell, units_of_cell in cells_of_variant.items():
            cells_of_variant[cell] = deque(_taking_turns(units_of_cell))
    count_by_property: Counter[Hashable] = Counter()
    chosen: set[str] = set()
    while len(chosen) < count:
        variant = min(cells, key=lambda name: (count_by_property[name], digest([seed, name])))
        cell = min(
            cells[variant], key=lambda c: (*_counts_of_properties(count_by_property, c), digest([seed, c]))
        )
        unit = cells[variant][cell].popleft()
        chosen.update(experiment.id for experiment in unit[: count - len(chosen)])
        count_by_property.update(dict.fromkeys(_balanced_properties(cell), len(unit)))
        if not cells[variant][cell]:
            del cells[variant][cell]
        if not cells[variant]:
            del cells[variant]
    return tuple(e for e in experiments if e.id in chosen)


def _taking_turns(units: Iterable[list[Experiment]]) -> list[list[Experiment]]:
    """Sort units so that the first of each scenario come first, then the second of each, and so on."""
    turns: Counter[str] = Counter()
    ranked = []
    for unit in units:
        ranked.append((turns[unit[0].scenario], unit))
        turns[unit[0].scenario] += 1
    return [unit for _, unit in sorted(ranked, key=lambda turn_and_unit: turn_and_unit[0])]


def _ignoring_after_hazard(experiment: Experiment) -> Experiment:
    """Remove `after_hazard`, so that campaigns with and without it draw the same sample."""
    goes_on = experiment.after_hazard is AfterHazard.GO_ON
    return experiment if goes_on else replace(experiment, after_hazard=AfterHazard.GO_ON)


def _cell(unit: Sequence[Experiment]) -> _Cell:
    first = unit[0]
    methods = "+".join(experiment.method.value for experiment in unit)
    return (first.fault.spec, methods, first.family_or_scenario, first.trigger.name)


def _balanced_properties(cell: _Cell) -> Iterable[Hashable]:
    """Yield the properties whose counts are balanced, the most important first."""
    variant, method, scenario, trigger = cell
    yield variant
    yield variant, method
    yield variant, "scenario", scenario
    yield variant, "trigger", trigger
    yield method, scenario
    yield "method", method
    yield "scenario", scenario
    yield "trigger", trigger


def _counts_of_properties(count_by_property: Counter[Hashable], cell: _Cell) -> list[int]:
    return [count_by_property[mark] for mark in _balanced_properties(cell)]


def draw_in_proportion(experiments: Sequence[Experiment], count: int, seed: int) -> tuple[Experiment, ...]:
    """Draw `count` experiments, guided and random ones in pairs, in their original order.

    Each fault type in each scenario, or family of them, is sampled systematically, in proportion to its
    number of experiments, with at least one pair. ValueError if the count is too small or not a whole number
    of pairs.
    """
    if count >= len(experiments):
        return tuple(experiments)
    strata: dict[_Stratum, dict[_PairKey, list[Experiment]]] = defaultdict(dict)
    for experiment in experiments:
        fault = experiment.fault
        stratum = (fault.module, fault.fault_type, experiment.family_or_scenario)
        in_family = (experiment.scenario,) if experiment.concrete else ()
        strata[stratum].setdefault((*_pair_key(experiment), *in_family), []).append(experiment)
    size = len({experiment.method for experiment in experiments})
    if count % size or count // size < len(strata):
        raise ValueError(f"a multiple of {size}, {size * len(strata)} or more")
    chosen: set[str] = set()
    for stratum, number in _allot_pairs_in_proportion(
        {key: len(pairs) for key, pairs in strata.items()}, count // size
    ).items():
        pairs = sorted(strata[stratum], key=lambda pair: (*pair[:2], digest([seed, pair])))
        # a random start, then equal steps: each experiment is equally likely
        offset = random.Random(digest([seed, stratum])).random()
        for i in range(number):
            members = strata[stratum][pairs[int((i + offset) * len(pairs) / number)]]
            chosen.update(member.id for member in members)
    return tuple(e for e in experiments if e.id in chosen)


_Stratum = tuple[str, str, str]  # module, fault type, family or scenario
_PairKey = tuple[str, ...]  # variant, row of the context table, fault; in a family, also the scenario


def _pair_key(experiment: Experiment) -> tuple[str, str, str]:
    """Return what a guided experiment and its random partner have in common within a scenario."""
    row = experiment.trigger.name.removeprefix("random/")
    return (experiment.fault.spec, row, experiment.fault.id)


def _allot_pairs_in_proportion(sizes: dict[_Stratum, int], total: int) -> dict[_Stratum, int]:
    """Distribute `total` seats over strata: one each, then by the Sainte-Lague method (1910)."""
    seats = dict.fromkeys(sizes, 1)
    while sum(seats.values()) < total:
        stratum = max(sizes, key=lambda key: (sizes[key] / (2 * seats[key] + 1), key))
        seats[stratum] += 1
    return seats
