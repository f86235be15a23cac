"""A small part of many experiments that still shows everything: picked evenly, the same each time."""

from collections import Counter, defaultdict, deque
from collections.abc import Hashable, Iterable, Sequence

from mutator.ids import digest
from mutator.model import Experiment

_Cell = tuple[str, str, str, str]  # variant, method, scenario, trigger


def spread(count: int, wanted: int) -> list[int]:
    """`wanted` of the indices 0 ... count-1, evenly over them."""
    if wanted >= count:
        return list(range(count))
    return [(2 * i + 1) * count // (2 * wanted) for i in range(wanted)]


def pick(experiments: Sequence[Experiment], count: int, seed: int) -> tuple[Experiment, ...]:
    """`count` of the experiments, in their order: each spec's variant as often as any other, and within a
    variant each method, scenario and trigger; which values, and ties, by a hash of seed and id."""
    if count >= len(experiments):
        return tuple(experiments)
    cells: dict[str, dict[_Cell, deque[Experiment]]] = defaultdict(dict)
    for experiment in sorted(experiments, key=lambda e: digest([seed, e.id])):
        cell = _cell(experiment)
        cells[cell[0]].setdefault(cell, deque()).append(experiment)
    taken: Counter[Hashable] = Counter()
    chosen: set[str] = set()
    while len(chosen) < count:
        variant = min(cells, key=lambda name: (taken[name], digest([seed, name])))
        cell = min(cells[variant], key=lambda c: (*_load(taken, c), digest([seed, c])))
        chosen.add(cells[variant][cell].popleft().id)
        taken.update(_marks(cell))
        if not cells[variant][cell]:
            del cells[variant][cell]
        if not cells[variant]:
            del cells[variant]
    return tuple(e for e in experiments if e.id in chosen)


def _cell(experiment: Experiment) -> _Cell:
    return (experiment.fault.spec, experiment.method.value, experiment.scenario, experiment.trigger.name)


def _marks(cell: _Cell) -> Iterable[Hashable]:
    """What is counted for a cell, from what matters most to what matters least."""
    variant, method, scenario, trigger = cell
    yield variant
    yield variant, method
    yield variant, "scenario", scenario
    yield variant, "trigger", trigger
    yield method, scenario
    yield "method", method
    yield "scenario", scenario
    yield "trigger", trigger


def _load(taken: Counter[Hashable], cell: _Cell) -> list[int]:
    return [taken[mark] for mark in _marks(cell)]
