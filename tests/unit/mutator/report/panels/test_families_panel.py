"""The part of a report on families."""

from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from mutator.families.family_facts import FamilyFacts
from mutator.report.family_results import FamilyResults
from mutator.report.panels import families_panel


def family_of(golden_hazards: list[str], experiments: int) -> FamilyResults:
    scenarios = pd.DataFrame({"golden_hazards": golden_hazards, "experiments": experiments})
    facts = FamilyFacts(name="follow", title="A lead", parameters=())
    return FamilyResults(facts=facts, scenarios=scenarios, shares=[], frequency_source="")


def test_a_campaign_without_faults_has_no_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without experiments, the part has the golden runs alone: neither a table nor a word on intervals."""
    monkeypatch.setattr(families_panel, "results_by_family", lambda run: [family_of(["", "H1"], 0)])
    run: Any = SimpleNamespace(folder=SimpleNamespace(head=SimpleNamespace(metrics=())))
    panel = families_panel.build_families_panel(run)
    assert panel is not None
    assert "Without a fault, 1 of 2 scenarios had a hazard." in panel.markdown
    assert "|" not in panel.markdown
    assert "bootstrap" not in panel.markdown + panel.html
