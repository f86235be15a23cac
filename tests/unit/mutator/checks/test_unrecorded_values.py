"""What `check` says about observed values that no channel records."""

from mutator.checks.check_findings import CheckState
from mutator.checks.unrecorded_values import unrecorded_values_finding
from mutator.workspace import Workspace


def test_values_without_a_channel_of_their_name_are_listed(clone: Workspace, toycar: Workspace) -> None:
    """Their loss cannot be seen; the shipped target records all of them."""
    finding = unrecorded_values_finding(toycar.manifest("toycar"))
    assert finding.level is CheckState.WARN
    assert "no channel has the name d_rel or v_ego or v_lead" in finding.found
    assert unrecorded_values_finding(clone.manifest("openpilot")).level is CheckState.OK
