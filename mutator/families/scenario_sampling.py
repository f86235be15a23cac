"""Draws concrete scenarios from a family: reproducibly, without duplicates, within its constraints."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from mutator._common.message_text import counted
from mutator._common.random_streams import random_generator
from mutator.errors import MutatorError
from mutator.families.family import Family
from mutator.families.parameters import ParameterValue
from mutator.model import ConcreteScenario

_Indices = tuple[int, ...]  # the index of each parameter's value
_MOST_GRID_POINTS = 1_000_000  # beyond this, a grid is not searched for those that meet the constraints
_MOST_DRAWS_PER_SCENARIO = 200  # so many draws may break the constraints, or be there already
_MOST_EXPECTED_REPETITIONS = 0.1  # of the likeliest scenario, for draws to count as independent
_ROUND = 1024  # points that are drawn at a time


def sample_scenarios(
    family: Family, count: int | None, method: str, seed: int
) -> tuple[ConcreteScenario, ...]:
    """Return `count` scenarios of a family, or, of a grid, all (None), by one of SAMPLING_METHODS.

    The first scenarios of `random` and `sobol` are the same for each count. MutatorError if the family does
    not have as many, or if two have names that agree.
    """
    if method == "grid":
        chosen = _grid_points(family, count)
    elif count is None:
        raise MutatorError(
            f"family {family.name} without a `sample`",
            expected=f"the number of scenarios to draw by `{method}`",
            remedy=f"write {{family: {family.name}, sample: 100}}, or `sampling: grid` for all",
        )
    else:
        chosen = _drawn_points(family, count, _POINT_STREAMS[method](family, count, seed))
    scenarios = tuple(family.concrete(_values_at(family, indices)) for indices in chosen)
    _check_names_differ(family, scenarios)
    return scenarios


def has_independent_draws(family: Family, count: int, method: str) -> bool:
    """Whether so many scenarios are drawn nearly as often as their probabilities say. As no scenario is drawn
    twice, likely ones are soon all there; values that are equally likely stay so.
    """
    shares = [max(p.probabilities) for p in family.parameters if p.probabilities is not None]
    return method == "grid" or not shares or count * math.prod(shares) <= _MOST_EXPECTED_REPETITIONS


def frequency_weight(family: Family, values: Mapping[str, ParameterValue], method: str) -> float:
    """Return how often these values (by key) occur on the road, relative to how often `method` draws them.

    Parameters without a frequency are taken to occur as they are drawn. ValueError for values that the family
    does not draw.
    """
    weight = 1.0
    for parameter in family.parameters:
        probabilities = family.frequency.probabilities.get(parameter.name) if family.frequency else None
        if probabilities is not None:
            index = list(parameter.values).index(values[parameter.key])
            drawn = 1 / len(parameter.values) if method == "grid" else parameter.probability(index)
            weight *= probabilities[index] / drawn
    return weight


def _values_at(family: Family, indices: Sequence[int]) -> list[int | float | str]:
    return [parameter.values[index] for parameter, index in zip(family.parameters, indices, strict=True)]


def _meets_constraints(family: Family, indices: Sequence[int]) -> bool:
    return family.meets_constraints(_values_at(family, indices))


def _grid_points(family: Family, count: int | None) -> list[_Indices]:
    sizes = [len(parameter.values) for parameter in family.parameters]
    point_count = math.prod(sizes)
    if point_count > _MOST_GRID_POINTS:
        raise MutatorError(
            f"a grid of {point_count} scenarios in family {family.name}",
            where=family.path,
            expected=f"at most {_MOST_GRID_POINTS}",
            remedy="use larger steps, or another `sampling`",
        )
    points = [point for point in np.ndindex(*sizes) if _meets_constraints(family, point)]
    if not points or (count is not None and count > len(points)):
        raise _too_few_error(family, len(points), count or 1)
    if count is None:
        return points
    return [points[(2 * i + 1) * len(points) // (2 * count)] for i in range(count)]


def _drawn_points(family: Family, count: int, points: Iterator[Sequence[float]]) -> list[_Indices]:
    chosen: dict[_Indices, None] = {}
    for point in islice(points, count * _MOST_DRAWS_PER_SCENARIO):
        indices = tuple(
            parameter.index_at(quantile) for parameter, quantile in zip(family.parameters, point, strict=True)
        )
        if indices not in chosen and _meets_constraints(family, indices):
            chosen[indices] = None
            if len(chosen) == count:
                return list(chosen)
    raise _too_few_error(family, len(chosen), count)


def _random_points(family: Family, count: int, seed: int) -> Iterator[Sequence[float]]:
    generator = random_generator(seed, f"family/{family.name}/random")
    while True:
        yield from generator.random((_ROUND, len(family.parameters)))


def _latin_hypercube_points(family: Family, count: int, seed: int) -> Iterator[Sequence[float]]:
    """Yield points of which each `count` lie in different rows of each axis."""
    generator = random_generator(seed, f"family/{family.name}/latin_hypercube")
    while True:
        rows = np.stack([generator.permutation(count) for _ in family.parameters], axis=1)
        yield from (rows + generator.random(rows.shape)) / count


def _sobol_points(family: Family, count: int, seed: int) -> Iterator[Sequence[float]]:
    """Yield the Sobol sequence, shifted by a random vector, so that the seed has an effect in any version of
    scipy.
    """
    from scipy.stats import qmc  # type: ignore[import-untyped]

    shift = random_generator(seed, f"family/{family.name}/sobol").random(len(family.parameters))
    sequence = qmc.Sobol(len(family.parameters), scramble=False)
    while True:
        yield from (sequence.random(_ROUND) + shift) % 1.0


_POINT_STREAMS: dict[str, Callable[[Family, int, int], Iterator[Sequence[float]]]] = {
    "random": _random_points,
    "latin_hypercube": _latin_hypercube_points,
    "sobol": _sobol_points,
}
SAMPLING_METHODS = ("grid", *_POINT_STREAMS)


def _too_few_error(family: Family, found_count: int, count: int) -> MutatorError:
    return MutatorError(
        f"family {family.name}: only {counted(found_count, 'scenario')} that differ and meet its constraints",
        where=family.path,
        expected=f"at least {count}",
        remedy="draw fewer, use smaller steps, or relax the constraints",
    )


def _check_names_differ(family: Family, scenarios: Sequence[ConcreteScenario]) -> None:
    scenario_by_name: dict[str, ConcreteScenario] = {}
    for scenario in scenarios:
        other = scenario_by_name.setdefault(scenario.name, scenario)
        if other is not scenario:
            raise MutatorError(
                f"family {family.name}: {other.label}, and {scenario.label} are both {scenario.name}",
                where=family.path,
                expected="a text of its own for each choice of values",
                remedy="use every parameter in the template",
            )
