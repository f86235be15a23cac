"""What fills the holes of a group, and what triggers it, in words: for the terminal and the page."""

import re
from collections.abc import Sequence

from mutator.model import Trigger
from mutator.review.catalogue import Group
from mutator.review.groups import Shape

_TIME = re.compile(r"t >= ([0-9.e+-]+)\Z")
_NOT_TOLD = re.compile(r"id(_\d+)?\Z")  # ids say nothing to a reader


def values(group: "Group") -> tuple[list[str], list[list[str]]]:
    """What fills the holes: a row for each fault; the ids in the lines are left out."""
    faults = {fault.id: fault for fault in group.faults}
    names = list(dict.fromkeys(name for shape in group.shapes for name in _told(shape)))
    rows = []
    for shape in group.shapes:
        for member, filled in zip(shape.members, shape.values, strict=True):
            fault = faults.get(member)
            if fault is not None:
                found = dict(zip(shape.holes, filled, strict=True))
                words = [fault.label, fault.reading]
                rows.append([*words, *(found.get(name, "") for name in names)])
    return ["fault", "reading", *names], rows


def _told(shape: "Shape") -> list[str]:
    return [name for name in shape.holes if not _NOT_TOLD.match(name)]


def conditions(triggers: Sequence["Trigger"]) -> list[str]:
    """The conditions, each once, with the names that they have; random times as the span they lie in."""
    named: dict[str, list[str]] = {}
    times: list[float] = []
    for trigger in triggers:
        if time := _TIME.match(trigger.condition):
            times.append(float(time[1]))
        else:
            named.setdefault(trigger.condition, []).append(trigger.name)
    lines = [f"{condition}  ({', '.join(dict.fromkeys(names))})" for condition, names in named.items()]
    if len(times) == 1:
        lines.append("from a time on")
    elif times:
        lines.append(f"from a time on, {len(set(times))} of them from {min(times)} s to {max(times)} s")
    return lines
