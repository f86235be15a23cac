"""The order of fault types by hazards is compared with the published one."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from mutator.paper.fault_type_rank_agreement import GUIDED, measure_agreement, rank_correlation
from mutator.paper.published_numbers import load_published_numbers
from mutator.statistics.tallies import Tally

REFERENCES = Path(__file__).parents[4] / "fault_library/references"


def test_the_correlation_is_that_of_scipy_also_with_ties() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.integers(0, 6, (2, 5, 17)).astype(float)
    expected = [spearmanr(a, b).statistic for a, b in zip(first, second, strict=True)]
    assert rank_correlation(first, second) == pytest.approx(expected)
    assert math.isnan(rank_correlation(np.ones(4), np.arange(4.0)))


def test_the_publication_agrees_with_itself_and_ties_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four of 17 fault types have no guided hazard there; one that is not activated is left out."""
    published = load_published_numbers(REFERENCES)
    ours = dict(published.tally_by_fault_type)
    monkeypatch.setattr("mutator.paper.fault_type_rank_agreement.tally_by_fault_type", lambda frame: ours)
    found = measure_agreement(None, published)  # type: ignore[arg-type]
    assert found.correlation == pytest.approx(1.0)
    assert (found.fault_types, found.tied_here, found.tied_there) == (17, 4, 4)
    ours[GUIDED, "radar/jamming"] = Tally(injected=2, activated=0, hazards=0)
    assert measure_agreement(None, published).fault_types == 16  # type: ignore[arg-type]
    ours[GUIDED, "radar/chaff"] = Tally(injected=9, activated=9, hazards=0)
    found = measure_agreement(None, published)  # type: ignore[arg-type]
    assert found.low < found.correlation < found.high <= 1.0
