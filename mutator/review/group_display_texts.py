"""Groups for display in the terminal and on the page: titles, a table of values, and triggers as text."""

import re
from collections.abc import Sequence

from mutator.model import Trigger
from mutator.review.mutant_groups import Group
from mutator.review.patch_shapes import PatchShape
from mutator.review.review_entries import describe_range

# the condition of a random time: thousands of them become one range
_TIME_CONDITION_PATTERN = re.compile(r"t >= ([0-9.e+-]+)\Z")
_ID_HOLE_PATTERN = re.compile(r"id(_\d+)?\Z")  # readers do not need ids


def title_lines(group: Group) -> list[str]:
    """Return what the group's faults are, a line for each variant of a spec: its name, the values of its
    faults, and the sentence that says what it does: `sensor/distance/longer 5 to 65 m: The gap ...`.
    """
    return [
        f"{' '.join(filter(None, (variant, _describe_fault_values(group, variant))))}: {about}"
        for variant, about in group.about_by_variant.items()
    ]


def _describe_fault_values(group: Group, variant: str) -> str:
    faults = [fault for fault in group.faults if fault.spec == variant]
    numbers = [fault.value for fault in faults if isinstance(fault.value, int | float)]
    if not numbers:
        return ""
    return _with_unit(describe_range((min(numbers), max(numbers))), faults[0].unit.removeprefix("-"))


def _with_unit(text: str, symbol: str) -> str:
    return f"{text} {symbol}" if symbol else text


def fault_value_table(group: Group) -> tuple[list[str], list[list[str]]]:
    """Return the headings, and a row for each fault with the values of its holes, except ids."""
    faults = {fault.id: fault for fault in group.faults}
    has_readings = any(fault.reading for fault in group.faults)
    names = list(dict.fromkeys(name for shape in group.shapes for name in _hole_names_without_ids(shape)))
    rows = []
    for shape in group.shapes:
        for member, filled in zip(shape.member_ids, shape.values_by_member, strict=True):
            fault = faults.get(member)
            if fault is not None:
                text_by_hole = dict(zip(shape.hole_names, filled, strict=True))
                reading = [fault.reading] if has_readings else []
                rows.append([fault.label, *reading, *(text_by_hole.get(name, "") for name in names)])
    return ["fault", *(["reading"] if has_readings else []), *names], rows


def _hole_names_without_ids(shape: PatchShape) -> list[str]:
    return [name for name in shape.hole_names if not _ID_HOLE_PATTERN.match(name)]


def describe_value_ranges(group: Group) -> str:
    """Return the ranges of values that an approval covers, in the units of the injected code:
    `by: -40 to 40 m`.
    """
    return "; ".join(
        f"{name}: {_with_unit(describe_range(values), group.unit_by_parameter.get(name, ''))}"
        for name, values in group.value_ranges.items()
    )


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
