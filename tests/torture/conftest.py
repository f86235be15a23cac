"""What every torture needs: its seeds, and a place for its table."""

from collections.abc import Callable, Sequence

import pytest

from .tally import Tally


@pytest.fixture
def seeds(request: pytest.FixtureRequest) -> Callable[[int], Sequence[int]]:
    """The seeds of so many cases; `--tries` says of how many instead, `--seed` which one alone."""
    tries, seed = request.config.getoption("tries"), request.config.getoption("seed")
    return lambda usual: [seed] if seed is not None else range(tries or usual)


@pytest.fixture
def print_tally(record_property: Callable[[str, object], None]) -> Callable[[Tally | str], None]:
    """Has a tally, or a text, printed at the end of the session, also by workers of pytest-xdist."""
    return lambda tally: record_property("tally", str(tally))
