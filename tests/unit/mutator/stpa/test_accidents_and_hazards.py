"""Hazards and the accidents that they lead to."""

import pytest

from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_hazards_lead_to_known_accidents(toy: Workspace) -> None:
    assert toy.hazards().accidents_by_hazard == {"H1": ("A1",)}
    path = toy.library / "stpa" / "hazards.yaml"
    path.write_text(path.read_text().replace("leads_to: [A1]", "leads_to: [A2]"))
    with pytest.raises(MutatorError, match=r"hazards.yaml:4: accident 'A2'; expected one of A1"):
        toy.hazards()
