"""The descriptions of hazards in a film."""

from pathlib import Path

from mutator.report.experiment_filming import describe_hazards
from mutator.workspace import Workspace


def test_a_film_describes_a_hazard_as_the_page_does() -> None:
    workspace = Workspace.find(root=Path(__file__).parents[4])
    manifest = workspace.manifest("openpilot")
    assert describe_hazards(workspace, manifest) == {rule.name: rule.about for rule in manifest.hazard_rules}
    assert "touches" in describe_hazards(workspace, manifest)["H1"]
