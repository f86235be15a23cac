"""Groups patches that differ only in values: one diff with holes, and a table of the values in the holes.

Patches of the same shape differ only in the numbers, truth values and ids of their injected lines and, in the
probe, in ids and the lines that define the trigger. A value that is equal in all patches stays in the text;
every other value becomes a hole.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

from mutator._common.hashing import content_id
from mutator.model import Fault, FaultLocation, Hold, Injection, Trigger, Value
from mutator.mutants.injected_line_syntax import (
    INJECTION_ID_PATTERN,
    probe_setting_spans,
    tagged_addition_spans,
)
from mutator.mutants.patches_by_file import adds_file, split_into_file_patches
from mutator.operators.operator_lookup import operator_name_of
from mutator.triggers.conditions import TIME, names_in

ValueSpan = tuple[int, int, str]  # position of a value in a patch: begin, end, name (empty: not yet known)

HOLE_CHARACTER = "\0"  # never occurs in Python source
_WORD_CHARS = (
    r"\w.\\\x80-\U0010ffff"  # next to one of these, a number is part of a longer number or of a name
)
_NUMBER_PATTERN = (  # with its sign, and the operator of a sum: `- 3.0`
    rf"(?:[+-] ?){{0,2}}(?:(?<![{_WORD_CHARS}])[0-9]+(?:\.[0-9]*)?(?:e[+-]?[0-9]+)?(?![{_WORD_CHARS}])"
    r"|float\('-?(?:nan|inf)'\))|(?<![\w.])(?:True|False)(?!\w)"
)
_VALUE_PATTERN = re.compile(rf"(?P<id>{INJECTION_ID_PATTERN})|{_NUMBER_PATTERN}")


@dataclass(frozen=True, kw_only=True)
class PatchShape:
    """Patches that differ only in values. A member's patch is `parts` with its values in between.

    Hole `hole_indices[i]` is between `parts[i]` and `parts[i + 1]`; a hole can be in several places.
    `values_by_member[m][h]` fills hole `h` in the patch of `member_ids[m]`. `id` depends only on `name` and
    the text without values.
    """

    id: str
    name: str
    parts: tuple[str, ...]
    hole_indices: tuple[int, ...]
    hole_names: tuple[str, ...]  # distinct names
    member_ids: tuple[str, ...]
    values_by_member: tuple[tuple[str, ...], ...]

    @cached_property
    def diff(self) -> str:
        """The patch with holes like `⟨by⟩`, for display."""
        return self._filled_with([f"⟨{name}⟩" for name in self.hole_names])

    def patch_of(self, member: int) -> str:
        return self._filled_with(self.values_by_member[member])

    def _filled_with(self, values: Iterable[str]) -> str:
        value_by_hole = list(values)
        between = [value_by_hole[place] for place in self.hole_indices]
        return "".join(a + b for a, b in zip(self.parts, [*between, ""], strict=True))

    def with_named_holes(self, parameters: Iterable[Mapping[str, Value]]) -> "PatchShape":
        """Return the shape with each numbered hole named after the parameter that fills it in every member;
        `parameters` are in member order.
        """
        each = list(parameters)
        names: list[str] = []
        for hole, name in enumerate(self.hole_names):
            if name.isdigit() and each:
                texts = [row[hole] for row in self.values_by_member]
                fitting = (p for p in each[0] if all(map(_is_text_of_value, texts, (x.get(p) for x in each))))
                name = next((p for p in fitting if p not in (*names, *self.hole_names)), name)
            names.append(name)
        return replace(self, hole_names=tuple(names))


def shapes_of_patches(patches: Iterable[tuple[str, str, str]]) -> list[PatchShape]:
    """Return the shapes of patches given as (key, name, patch), in the order of their first members.

    Keys are the members' names. Patches with different `name`s never share a shape (see `group_label`).
    """
    builders: dict[tuple[str, str], _ShapeBuilder] = {}
    for key, name, patch in patches:
        spans = list(_value_spans(patch))
        rest = _text_outside_spans(patch, spans)
        builder = builders.get((name, rest))
        if builder is None:
            builder = builders[name, rest] = _ShapeBuilder(tuple(label for *_, label in spans))
        builder.member_ids.append(key)
        builder.values.append([patch[begin:end] for begin, end, _ in spans])
    return [builder.build(name, rest) for (name, rest), builder in builders.items()]


def without_values(patch: str) -> str:
    """Return the patch without values, which is equal for all patches of a shape."""
    return _text_outside_spans(patch, list(_value_spans(patch)))


def group_label(fault: Fault) -> str:
    """Location and template without values; only mutants with equal labels can share a shape.

    `pkg/sensor.py Sensor.measure after_assign gap: offset(by, target=gap)`. An operator's mutants share one
    label in each function: `pkg/sensor.py Sensor.measure: operator constant`.
    """
    if operator := operator_name_of(fault):
        location = fault.injections[0].location
        return f"{location.path} {location.function}: operator {operator}"
    return "; ".join(map(injection_label, fault.injections))


def location_label(location: FaultLocation) -> str:
    anchor = location.anchor
    number = f"#{anchor.nth}" if anchor.nth is not None else ""
    which = f"which {anchor.which}" if anchor.which else ""
    words = (location.path, location.function, anchor.kind.value, anchor.name, which, number)
    return " ".join(filter(None, words))


def injection_label(injection: Injection) -> str:
    """Location, model and parameters without numbers. Names and truth values stay, because they can change
    the injected code.
    """
    parameters = (
        f"{name}={value}" if value is None or isinstance(value, str | bool) else name
        for name, value in injection.params
    )
    label = f"{location_label(injection.location)}: {injection.model}({', '.join(parameters)})"
    return label + _instance_label(injection)


def _instance_label(injection: Injection) -> str:
    where = f" where {re.sub(_NUMBER_PATTERN, '#', injection.where)}" if injection.where else ""
    return where + "".join(f", {name}" for name in ("call", "every") if getattr(injection, name) is not None)


def trigger_kind(trigger: Trigger) -> str:
    """Return `always`, `time` (the condition uses only the time) or `state` (any other condition)."""
    if trigger.condition == "True":
        return "always"
    return "time" if names_in(trigger.condition) == (TIME,) else "state"


def effective_hold(fault: Fault, trigger: Trigger) -> Hold:
    return fault.hold or trigger.hold


def parameter_values(fault: Fault) -> dict[str, Value]:
    """Return the parameters of a fault's injections by name: `by`; with several injections also `1.by`,
    `2.by`.
    """
    parameters = [dict(injection.params) for injection in fault.injections]
    common = {
        name: value
        for name, value in chain.from_iterable(params.items() for params in parameters)
        if all(
            repr(params.get(name, value)) == repr(value) for params in parameters
        )  # repr, since nan != nan
    }
    numbered = {f"{i}.{k}": v for i, params in enumerate(parameters, start=1) for k, v in params.items()}
    return common | numbered if len(parameters) > 1 else common


@dataclass(frozen=True, slots=True)
class _ShapeBuilder:
    """Collects a shape's members; `value_labels` are the names of its values."""

    value_labels: tuple[str, ...]
    member_ids: list[str] = field(default_factory=list)
    values: list[list[str]] = field(default_factory=list)

    def build(self, name: str, rest: str) -> PatchShape:
        """Build the shape: values equal in all members become text, and values equal to each other share a
        hole.
        """
        pieces = rest.split(HOLE_CHARACTER) if self.value_labels else [rest]
        parts, places = [pieces[0]], []
        columns: dict[tuple[str, ...], int] = {}
        holes: list[str] = []
        for label, column, after in zip(
            self.value_labels, zip(*self.values, strict=True), pieces[1:], strict=True
        ):
            if len(set(column)) == 1:
                parts[-1] += column[0] + after
                continue
            if column not in columns:
                columns[column] = len(holes)
                holes.append(_unused_name(label, holes))
            places.append(columns[column])
            parts.append(after)
        return PatchShape(
            id=content_id([name, rest]),
            name=name,
            parts=tuple(parts),
            hole_indices=tuple(places),
            hole_names=tuple(holes),
            member_ids=tuple(self.member_ids),
            values_by_member=tuple(zip(*columns, strict=True)) if columns else ((),) * len(self.member_ids),
        )


def _unused_name(label: str, used_names: list[str]) -> str:
    if not label:
        return str(1 + sum(name.isdigit() for name in used_names))
    same = sum(name.partition("_")[0] == label for name in used_names)
    return f"{label}_{same + 1}" if same else label


def _value_spans(patch: str) -> Iterator[ValueSpan]:
    if HOLE_CHARACTER in patch:  # no holes, because it is not Python source
        return
    begin = 0
    for section in split_into_file_patches(patch):
        end = begin + len(section)
        if adds_file(section):
            yield from probe_setting_spans(patch, begin, end)
        else:
            for start, stop in tagged_addition_spans(patch, begin, end):
                yield from _line_value_spans(patch, start, stop)
        begin = end


def _line_value_spans(patch: str, begin: int, end: int) -> Iterator[ValueSpan]:
    for match in _VALUE_PATTERN.finditer(patch, begin, end):
        label = match.lastgroup or ""
        yield *match.span(label or 0), label


def _text_outside_spans(patch: str, spans: list[ValueSpan]) -> str:
    ends = [0, *(end for _, end, _ in spans)]
    starts = [*(begin for begin, _, _ in spans), len(patch)]
    return HOLE_CHARACTER.join(patch[a:b] for a, b in zip(ends, starts, strict=True))


def _is_text_of_value(text: str, value: Value) -> bool:
    """Whether the text in a patch is this parameter's value, ignoring the sign."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return text == repr(value)
    number = text.lstrip("+- ").removeprefix("float('").removesuffix("')")
    try:
        return abs(float(number)) == abs(float(value)) or number == str(float(value))
    except ValueError:
        return False
