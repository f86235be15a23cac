"""Review mutants from Python."""

from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_a_decision_is_stored(toycar: Workspace, tmp_path: Path) -> None:
    found = mutator.load_review(specs=["sensor/lane"], workspace=toycar)
    group = found.undecided[0]
    assert found.find([group.id[:8]]) == [group]
    decided = found.approve([group], "A. Reviewer", "well")
    assert group not in decided.undecided
    again = mutator.load_review(specs=["sensor/lane"], workspace=toycar)
    assert [g.id for g in again.matching('state == "approved"').groups] == [group.id]
    assert again.options == ("--spec", "sensor/lane")
    assert again.write_page(tmp_path / "page.html").read_text().startswith("<!doctype html>")


def test_a_campaign_together_with_specs_is_refused(toycar: Workspace) -> None:
    with pytest.raises(MutatorError, match=r"^campaign: given together with specs"):
        mutator.load_review(campaign="small", specs=["sensor/lane"], workspace=toycar)
