"""What people read about a group."""

from dataclasses import replace

from mutator.review.group_display_texts import describe_value_ranges, title_lines
from mutator.review.mutant_groups import Group, groups_of_library
from mutator.workspace import Workspace


def groups(toy: Workspace, spec: str) -> tuple[Group, ...]:
    return groups_of_library(toy, toy.manifest("toycar"), specs=[spec])


def test_a_title_has_the_drawn_values_and_the_sentence_of_the_spec(toycar: Workspace) -> None:
    """Values in a title have the unit of the spec; a fault without a value has none."""
    longer = next(g for g in groups(toycar, "sensor/distance") if "sensor/distance/longer" in g.specs)
    values = [fault.value for fault in longer.faults]
    assert title_lines(longer) == [
        f"sensor/distance/longer {min(values)} to {max(values)} m: The other car seems further away."
    ]
    silence, probe = groups(toycar, "sensor/silence")
    assert title_lines(silence) == ["sensor/silence/no_data: The controller keeps using the last reading."]
    assert title_lines(probe) == []


def test_ranges_have_units_of_the_injected_code(toycar: Workspace) -> None:
    """A parameter without a unit has a bare range."""
    longer = next(g for g in groups(toycar, "sensor/distance") if "sensor/distance/longer" in g.specs)
    assert describe_value_ranges(longer) == "by: 1 to 65 m"
    assert describe_value_ranges(replace(longer, unit_by_parameter={})) == "by: 1 to 65"
