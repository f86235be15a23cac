"""Patches that differ in values alone, told once: a diff with holes, and a table of what fills them.

Only injected lines can differ between two mutants of one shape: in their numbers, truth values and ids; in
the probe, its ids and the lines that say when it is triggered. All of these are cut out of a patch, and
patches with one rest are one shape. What is equal in all its members is put back, so holes are what varies.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

from mutator._common.hashing import content_id
from mutator.model import Fault, FaultLocation, Hold, Injection, Trigger, Value
from mutator.triggers.conditions import VARIABLES

Span = tuple[int, int, str]  # of a value in a patch: begin, end, what it is called (empty: not known yet)

HOLE = "\0"  # no Python source has one
_TAGGED = re.compile(r"^\+.*# fi:[0-9a-z]+(?: guard:\d+)?\r?$", re.MULTILINE)
_ID = r"(?<![0-9A-Za-z])[0-9a-f]{8}(?![0-9A-Za-z])"
_WORD = r"\w.\\\x80-\U0010ffff"  # beside a number: it goes on, or is part of a name
_NUMBER = (  # with its sign, and that of a sum it may stand in: `- 3.0`
    rf"(?:[+-] ?){{0,2}}(?:(?<![{_WORD}])[0-9]+(?:\.[0-9]*)?(?:e[+-]?[0-9]+)?(?![{_WORD}])"
    r"|float\('-?(?:nan|inf)'\))|(?<![\w.])(?:True|False)(?!\w)"
)
_VALUE = re.compile(rf"(?P<id>{_ID})|{_NUMBER}")
_VARIABLE = re.compile(rf"\b(?:{'|'.join(VARIABLES)})\b")
_PROBE = re.compile(
    r"(?<![0-9A-Za-z])(?P<mutant>[0-9a-f]{16})(?![0-9A-Za-z])"
    rf"|(?P<id>{_ID})"
    r'|^\+HOLD = "(?P<hold>\w+)"$'
    r"|^\+HOLD_S = (?P<hold_s>.+)$"
    r"|^\+ARMED_AFTER_S = (?P<armed_after_s>.+)$"
    r"|^\+def _condition\(.*\n\+    return (?P<condition>.+)$",
    re.MULTILINE,
)


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Patches that are equal but for values. A member's patch is `parts` with its values between them.

    Between `parts[i]` and `parts[i + 1]` stands hole `places[i]`; a hole may stand in several places.
    `values[m][h]` fills hole `h` in the patch of `members[m]`. `id` depends on `name` and on the text with
    every value cut out, so it is the same whichever members there are.
    """

    id: str
    name: str
    parts: tuple[str, ...]
    places: tuple[int, ...]
    holes: tuple[str, ...]  # what each is called; different names
    members: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]

    @cached_property
    def diff(self) -> str:
        """The patch for reading, with holes like `⟨by⟩`."""
        return self._with([f"⟨{name}⟩" for name in self.holes])

    def patch(self, member: int) -> str:
        """The patch of a member, as it was given."""
        return self._with(self.values[member])

    def _with(self, values: Iterable[str]) -> str:
        known = list(values)
        between = [known[place] for place in self.places]
        return "".join(a + b for a, b in zip(self.parts, [*between, ""], strict=True))

    def named(self, parameters: Iterable[Mapping[str, Value]]) -> "Shape":
        """The same, its numbered holes named after the parameter that they hold in every member.

        `parameters` are those of each member, in the order of the members.
        """
        each = list(parameters)
        names: list[str] = []
        for hole, name in enumerate(self.holes):
            if name.isdigit() and each:
                texts = [row[hole] for row in self.values]
                fitting = (p for p in each[0] if all(map(_is, texts, (x.get(p) for x in each))))
                name = next((p for p in fitting if p not in (*names, *self.holes)), name)
            names.append(name)
        return replace(self, holes=tuple(names))


def shapes(patches: Iterable[tuple[str, str, str]]) -> list[Shape]:
    """The shapes of patches given as (key, name, patch), in the order of their first members.

    Keys are the members' names. Patches with different `name`s are never put together: it says what else
    they must have in common (see `label`), or nothing.
    """
    found: dict[tuple[str, str], _Growing] = {}
    for key, name, patch in patches:
        spans = list(_spans(patch))
        rest = _rest(patch, spans)
        growing = found.get((name, rest))
        if growing is None:
            growing = found[name, rest] = _Growing(tuple(label for *_, label in spans))
        growing.members.append(key)
        growing.values.append([patch[begin:end] for begin, end, _ in spans])
    return [growing.shape(name, rest) for (name, rest), growing in found.items()]


def cut(patch: str) -> str:
    """The patch with every value cut out: equal for all patches of a shape."""
    return _rest(patch, list(_spans(patch)))


def label(fault: Fault, trigger: Trigger) -> str:
    """Where, what and when, in words without values: mutants of one label may be of one shape.

    `selfdrive/sim/radar.py RadarSensor.measure after_assign d_rel: offset(by, target=d_rel); state, while`.
    """
    when = f"{trigger_kind(trigger)}, {hold(fault, trigger).value}"
    return "; ".join((*map(injected, fault.injections), when))


def place(location: FaultLocation) -> str:
    """A location in words."""
    anchor = location.anchor
    number = f"#{anchor.nth}" if anchor.nth is not None else ""
    return " ".join(filter(None, (location.path, location.function, anchor.kind.value, anchor.name, number)))


def injected(injection: Injection) -> str:
    """Where, the model, and what it is given but for numbers: names and truth values may choose its lines."""
    given = (
        f"{name}={value}" if isinstance(value, str | bool) else name
        for name, value in injection.params
        if value is not None
    )
    return f"{place(injection.location)}: {injection.model}({', '.join(given)})"


def trigger_kind(trigger: Trigger) -> str:
    """`always`, `time` (a condition on the time alone) or `state` (anything else, like a context)."""
    if trigger.condition == "True":
        return "always"
    return "time" if set(_VARIABLE.findall(trigger.condition)) == {"t"} else "state"


def hold(fault: Fault, trigger: Trigger) -> Hold:
    """How long the fault stays: its own word goes before the trigger's."""
    return fault.hold or trigger.hold


def parameters(fault: Fault) -> dict[str, Value]:
    """What its injections are given, for `Shape.named`: `by`; with several injections also `1.by`, `2.by`."""
    given = [dict(injection.params) for injection in fault.injections]
    common = {
        name: value
        for name, value in chain.from_iterable(params.items() for params in given)
        if all(repr(params.get(name, value)) == repr(value) for params in given)  # nan is no nan's equal
    }
    numbered = {f"{i}.{k}": v for i, params in enumerate(given, start=1) for k, v in params.items()}
    return common | numbered if len(given) > 1 else common


@dataclass(frozen=True, slots=True)
class _Growing:
    """A shape whose members are still being collected; `labels` are those of its values."""

    labels: tuple[str, ...]
    members: list[str] = field(default_factory=list)
    values: list[list[str]] = field(default_factory=list)

    def shape(self, name: str, rest: str) -> Shape:
        """Values that are equal in all members become text, and those that are equal in each one hole."""
        pieces = rest.split(HOLE) if self.labels else [rest]
        parts, places = [pieces[0]], []
        columns: dict[tuple[str, ...], int] = {}
        holes: list[str] = []
        for label, column, after in zip(self.labels, zip(*self.values, strict=True), pieces[1:], strict=True):
            if len(set(column)) == 1:
                parts[-1] += column[0] + after
                continue
            if column not in columns:
                columns[column] = len(holes)
                holes.append(_free(label, holes))
            places.append(columns[column])
            parts.append(after)
        return Shape(
            id=content_id([name, rest]),
            name=name,
            parts=tuple(parts),
            places=tuple(places),
            holes=tuple(holes),
            members=tuple(self.members),
            values=tuple(zip(*columns, strict=True)) if columns else ((),) * len(self.members),
        )


def _free(label: str, taken: list[str]) -> str:
    """The label, with a number if it is taken; a number alone if there is none."""
    if not label:
        return str(1 + sum(name.isdigit() for name in taken))
    same = sum(name.partition("_")[0] == label for name in taken)
    return f"{label}_{same + 1}" if same else label


def _spans(patch: str) -> Iterator[Span]:
    """Where the values are, from the top of the patch to its end."""
    if HOLE in patch:  # of no Python source; such a patch is told as it is
        return
    for begin, end in _sections(patch):
        if patch.startswith("new file mode ", patch.find("\n", begin) + 1):
            yield from _found(_PROBE, patch, begin, _head_of_probe(patch, begin, end))
            continue
        for line in _TAGGED.finditer(patch, begin, end):
            yield from _found(_VALUE, patch, line.start() + 1, line.end())


def _sections(patch: str) -> Iterator[tuple[int, int]]:
    """Begin and end of what the patch does to each file."""
    begin = 0
    while begin < len(patch):
        end = patch.find("\ndiff --git ", begin) + 1 or len(patch)
        yield begin, end
        begin = end


def _head_of_probe(patch: str, begin: int, end: int) -> int:
    """The end of its trigger's condition: what follows is the same in every probe, and long."""
    condition = patch.find("\n+def _condition(", begin, end)
    line = patch.find("\n+    return ", condition, end) if condition >= 0 else -1
    return end if line < 0 else patch.find("\n", line + 1, end) + 1 or end


def _found(pattern: re.Pattern[str], patch: str, begin: int, end: int) -> Iterator[Span]:
    for match in pattern.finditer(patch, begin, end):
        label = match.lastgroup or ""
        yield *match.span(label or 0), label


def _rest(patch: str, spans: list[Span]) -> str:
    ends = [0, *(end for _, end, _ in spans)]
    starts = [*(begin for begin, _, _ in spans), len(patch)]
    return HOLE.join(patch[a:b] for a, b in zip(ends, starts, strict=True))


def _is(text: str, value: Value) -> bool:
    """Whether the text in a patch is this parameter, whatever its sign."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return text == repr(value)
    number = text.lstrip("+- ").removeprefix("float('").removesuffix("')")
    try:
        return abs(float(number)) == abs(float(value)) or number == str(float(value))
    except ValueError:
        return False
