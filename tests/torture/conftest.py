"""The seeds and tables that all torture tests share."""

from collections.abc import Callable, Sequence

import pytest

from .tally import Tally


@pytest.fixture
def seeds(request: pytest.FixtureRequest) -> Callable[[int], Sequence[int]]:
    """Return a function that gives the seeds of a number of cases. `--tries` overrides the number, and
    `--seed` picks one seed."""
    tries, seed = request.config.getoption("tries"), request.config.getoption("seed")
    return lambda usual: [seed] if seed is not None else range(tries or usual)


@pytest.fixture
def print_tally(record_property: Callable[[str, object], None]) -> Callable[[Tally | str], None]:
    """Print a tally or a text at the end of the session, also from workers of pytest-xdist."""
    return lambda tally: record_property("tally", str(tally))
