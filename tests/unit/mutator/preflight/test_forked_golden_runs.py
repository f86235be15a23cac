"""Which golden runs of families are driven in a fork only."""

from types import SimpleNamespace

import pytest

from mutator.preflight.forked_golden_runs import runs_driven_once
from mutator.store.golden_runs import GoldenRun


def driven_on_reference(count_by_family: dict[str, int], seed: int = 7) -> list[GoldenRun]:
    """Return the golden runs of families of so many scenarios that the reference engine drives, too."""
    by_name = {
        f"{family}-{number}": SimpleNamespace(scenario=SimpleNamespace(family=family))
        for family, count in count_by_family.items()
        for number in range(count)
    }
    golden_runs = [GoldenRun("A"), *map(GoldenRun, by_name)]
    once = runs_driven_once(golden_runs, SimpleNamespace(by_name=by_name), seed)  # type: ignore[arg-type]
    assert GoldenRun("A") not in once  # a scenario of the library
    return [run for run in golden_runs[1:] if run not in once]


@pytest.mark.parametrize(
    ("scenarios", "expected"), [(6, (6,)), (24, (20, 21)), (1000, (20, 21)), (5000, (50, 51))]
)
def test_twenty_or_one_in_a_hundred_are_driven_on_the_reference_engine(
    scenarios: int, expected: tuple[int, ...]
) -> None:
    """And one more, if the first of the family is none of them."""
    assert len(driven_on_reference({"follow": scenarios})) in expected


def test_the_first_of_each_family_is_driven_on_the_reference_engine() -> None:
    count_by_family = {"many": 1000} | {f"single{number}": 1 for number in range(30)}
    driven = {run.scenario for run in driven_on_reference(count_by_family)}
    assert {f"{family}-0" for family in count_by_family} <= driven


def test_the_seed_draws_them() -> None:
    assert driven_on_reference({"follow": 100}) == driven_on_reference({"follow": 100})
    assert driven_on_reference({"follow": 100}, seed=8) != driven_on_reference({"follow": 100})
