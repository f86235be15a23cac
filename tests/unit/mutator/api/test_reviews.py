"""Review mutants from Python."""

from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_a_decision_is_kept(toycar: Workspace, tmp_path: Path) -> None:
    """An approval is stored and can be read again, and the review page is written."""
    found = mutator.load_review(specs=["sensor/lane"], workspace=toycar)
    group = found.undecided[0]
    assert found.find([group.id[:8]]) == [group]
    decided = found.approve([group], "A. Reviewer", "well")
    assert group not in decided.undecided
    again = mutator.load_review(specs=["sensor/lane"], workspace=toycar)
    assert [g.id for g in again.matching('state == "approved"').groups] == [group.id]
    assert again.options == ("--spec", "sensor/lane")
    assert again.write_page(tmp_path / "page.html").read_text().startswith("<!doctype html>")


def test_a_campaign_or_specs(toycar: Workspace) -> None:
    """A campaign together with specs is refused, and the error names the argument."""
    with pytest.raises(MutatorError, match=r"^campaign: together with specs"):
        mutator.load_review(campaign="small", specs=["sensor/lane"], workspace=toycar)
