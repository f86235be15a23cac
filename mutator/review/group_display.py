"""Groups for display in the terminal and on the page: a table of values, and triggers as text."""

import re
from collections.abc import Sequence

from mutator.model import Trigger
from mutator.review.mutant_groups import Group
from mutator.review.patch_shapes import PatchShape
from mutator.review.review_entries import describe_ranges

# the condition of a random time: thousands of them become one range
_TIME_CONDITION_PATTERN = re.compile(r"t >= ([0-9.e+-]+)\Z")
_ID_HOLE_PATTERN = re.compile(r"id(_\d+)?\Z")  # readers do not need ids


def fault_value_table(group: Group) -> tuple[list[str], list[list[str]]]:
    """Return the headings, and a row for each fault with the values of its holes, except ids."""
    faults = {fault.id: fault for fault in group.faults}
    names = list(dict.fromkeys(name for shape in group.shapes for name in _hole_names_without_ids(shape)))
    rows = []
    for shape in group.shapes:
        for member, filled in zip(shape.member_ids, shape.values_by_member, strict=True):
            fault = faults.get(member)
            if fault is not None:
                text_by_hole = dict(zip(shape.hole_names, filled, strict=True))
                rows.append([fault.label, fault.reading, *(text_by_hole.get(name, "") for name in names)])
    return ["fault", "reading", *names], rows


def _hole_names_without_ids(shape: PatchShape) -> list[str]:
    return [name for name in shape.hole_names if not _ID_HOLE_PATTERN.match(name)]


def describe_value_ranges(group: Group) -> str:
    """Return the ranges of values that an approval covers: `by: -40 to 40`."""
    return describe_ranges(group.value_ranges)


def trigger_condition_lines(triggers: Sequence[Trigger]) -> list[str]:
    """Each condition once, with the names of its triggers; random times as one range."""
    named: dict[str, list[str]] = {}
    times: list[float] = []
    for trigger in triggers:
        if time := _TIME_CONDITION_PATTERN.match(trigger.condition):
            times.append(float(time[1]))
        else:
            named.setdefault(trigger.condition, []).append(trigger.name)
    lines = [f"{condition}  ({', '.join(dict.fromkeys(names))})" for condition, names in named.items()]
    if len(set(times)) == 1:
        lines.append("starts at a given time")
    elif times:
        lines.append(f"starts at one of {len(set(times))} times ({min(times)} s to {max(times)} s)")
    return lines
