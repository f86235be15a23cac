"""The part of a report on families."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from mutator.families.family_facts import FamilyFacts
from mutator.report.family_results import FamilyResults
from mutator.report.panels import families_panel
from mutator.statistics.family_statistics import FamilyShare
from mutator.statistics.shares_with_intervals import Share


def family_of(
    golden_hazards: list[str], experiments: int, shares: Sequence[FamilyShare] = ()
) -> FamilyResults:
    scenarios = pd.DataFrame({"golden_hazards": golden_hazards, "experiments": experiments})
    facts = FamilyFacts(name="follow", title="A lead", parameters=())
    return FamilyResults(facts=facts, scenarios=scenarios, shares=[*shares], frequency_source="")


def run_of(*, has_rates: bool) -> Any:
    return SimpleNamespace(folder=SimpleNamespace(head=SimpleNamespace(metrics=())), has_rates=has_rates)


def test_where_counts_are_no_rates_the_panel_has_counts_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the page nor a file beside it divides the counts of an exploration or of an even sample."""
    share = Share(count=3, of=8, low=0.1, high=0.7)
    family = family_of(["", ""], 4, [FamilyShare(what="hazard", share=share, weighted=None)])
    monkeypatch.setattr(families_panel, "results_by_family", lambda run: [family])
    with_rates, without = (
        families_panel.build_families_panel(run_of(has_rates=has_rates)) for has_rates in (True, False)
    )
    assert with_rates is not None and without is not None
    assert "37.5 %" in with_rates.markdown and with_rates.files
    assert "| hazard | 3/8 |" in without.markdown
    assert "%" not in without.markdown and not without.files


def test_a_campaign_without_faults_has_no_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without experiments, the part has the golden runs alone: neither a table nor a word on intervals."""
    monkeypatch.setattr(families_panel, "results_by_family", lambda run: [family_of(["", "H1"], 0)])
    panel = families_panel.build_families_panel(run_of(has_rates=True))
    assert panel is not None
    assert "Without a fault, 1 of 2 scenarios had a hazard." in panel.markdown
    assert "|" not in panel.markdown
    assert "bootstrap" not in panel.markdown + panel.html
