"""Faults as explorations drive them."""

import pytest

from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.explore.plane_building import explored_fault
from mutator.workspace import Workspace


@pytest.mark.parametrize(
    ("spec", "changes", "explored_changes"),
    [
        ("car_sensors/speed/faster", ("no_lead",), ()),
        ("vision_weather/fog/visibility", ("pictures",), ("pictures",)),
    ],
)
def test_a_fault_is_explored_with_the_traffic_of_its_scenario(
    clone: Workspace, spec: str, changes: tuple[str, ...], explored_changes: tuple[str, ...]
) -> None:
    """A change that takes the lead away is left out; one that the fault needs stays."""
    fault = SelectedTarget.of(clone).fault(spec)
    assert fault.changes == changes
    explored = explored_fault(fault, clone.manifest("openpilot"))
    assert (explored.changes, explored.hold) == (explored_changes, None)
