"""Faults as explorations drive them."""

import pytest

from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.explore.plane_building import can_be_challenged, explored_fault
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


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("by_m: -distance", "by_m: -distance", True),
        ("by_m: -distance, low_m: 0", "by_m: -9, low_m: distance", False),
        ("model: offset", "model: stuck", False),
    ],
)
def test_an_error_is_challenged_if_its_value_is_its_size(
    toycar: Workspace, before: str, after: str, expected: bool
) -> None:
    """One with a size of its own is as large for every value."""
    path = toycar.library / "faults" / "sensor" / "distance.yaml"
    path.write_text(path.read_text().replace(before, after))
    [_, nearer] = toycar.spec("sensor/distance")
    assert can_be_challenged(nearer, "as_described") is expected
