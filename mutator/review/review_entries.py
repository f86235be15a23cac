"""The review of a group of mutants as plain records: a decision, remarks, a flag."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum

from mutator._common.hashing import added_field, content_id
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata

# for each parameter: least and greatest number, then values that are not finite (`nan`), as text
ValueRanges = Mapping[str, tuple[float | str, ...]]

_PART_NAMES = {
    "template": "template",
    "function": "target function",
    "diff": "diff",
    "calls": "called code",
}


TIME_PATTERN = r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$"  # how times are written
_NON_EMPTY = yaml_metadata(pattern=r"\S")


class DecisionVerdict(StrEnum):
    APPROVED = "approved"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True, kw_only=True)
class BasisDigests:
    """Digests of what a decision is about. If one changes, the decision is no longer valid."""

    diff: str  # the hunks with injected lines, without values and line numbers
    function: str  # the changed target functions, without injected lines
    template: str  # the templates of the injected lines
    calls: str | None = None  # the target code that the injected lines call; None: not stored

    def changed_parts(self, now: "BasisDigests") -> list[str]:
        differs = {name: getattr(self, name) != getattr(now, name) for name in _PART_NAMES}
        differs["calls"] &= self.calls is not None  # decisions from older files have no such digest
        return [word for name, word in _PART_NAMES.items() if differs[name]]


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupDecision:
    """A decision about a group, made by the reviewer `by`, and the group's state at that time.

    `at` is the time (UTC, ISO 8601), `commit` the commit of the library, `tool` the version of mutator. In
    decisions from older files, `at`, `commit`, `tool`, `values` and `bound.calls` are None. `reason` is why a
    group was rejected, in the reviewer's words; None if they gave no reason.
    """

    group: str
    what: str
    verdict: DecisionVerdict
    by: str
    at: str | None = None
    commit: str | None = None
    tool: str | None = None
    bound: BasisDigests
    values: ValueRanges | None = None
    reason: str | None = added_field(None)

    def changed_parts(self, bound: BasisDigests, values: ValueRanges) -> list[str]:
        """Return the parts of the group that changed since the decision, as text; empty if none did."""
        beyond = _describe_wider_ranges(self.values, values) if self.values is not None else ""
        return self.bound.changed_parts(bound) + ([f"values ({beyond})"] if beyond else [])

    @property
    def summary(self) -> str:
        """Text such as `rejected by Jane Doe on 2026-11-24 (too large)`."""
        day = f" on {self.at[:10]}" if self.at else ""
        return f"{self.verdict} by {self.by}{day}" + (f" ({self.reason})" if self.reason else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """A line of text about a group."""

    __pydantic_config__ = pydantic_mapping_config("A remark")

    by: str = field(metadata=_NON_EMPTY)
    at: str | None = field(default=None, metadata=yaml_metadata(pattern=TIME_PATTERN))
    text: str = field(metadata=_NON_EMPTY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A mark that asks for another look at a group."""

    __pydantic_config__ = pydantic_mapping_config("A flag")

    by: str = field(metadata=_NON_EMPTY)
    at: str = field(metadata=yaml_metadata(pattern=TIME_PATTERN))


@dataclass(frozen=True, slots=True, kw_only=True)
class ReviewEntry:
    """The review of a group: its block in the target's review file."""

    group: str
    what: str
    decision: GroupDecision | None = None
    remarks: tuple[Remark, ...] = ()
    flag: Flag | None = None

    @property
    def is_empty(self) -> bool:
        return not (self.decision or self.remarks or self.flag)

    @property
    def revision(self) -> str:
        return content_id(asdict(self))


def describe_ranges(values: ValueRanges) -> str:
    """Return the ranges as text: `by: -40 to 40; seed: 3`."""
    return "; ".join(f"{name}: {describe_range(value)}" for name, value in values.items())


def _describe_wider_ranges(approved_ranges: ValueRanges, now: ValueRanges) -> str:
    """Return the values outside the approved ranges, as text."""
    wider = [name for name in now if not _is_within(now[name], approved_ranges.get(name, ()))]
    descriptions = (
        f"{name}: {describe_range(now[name])}; approved {describe_range(approved_ranges.get(name, ()))}"
        for name in wider
    )
    return "; ".join(descriptions)


def _is_within(inner: tuple[float | str, ...], outer: tuple[float | str, ...]) -> bool:
    numbers = [value for value in outer if not isinstance(value, str)]
    return all(
        value in outer if isinstance(value, str) else bool(numbers) and numbers[0] <= value <= numbers[-1]
        for value in inner
    )


def describe_range(values: tuple[float | str, ...]) -> str:
    """Return the least and the greatest number, then the other values: `-40 to 40, nan`."""
    numbers = [f"{value:g}" for value in values if not isinstance(value, str)]
    words = [value for value in values if isinstance(value, str)]
    return ", ".join(filter(None, (" to ".join(dict.fromkeys(numbers)), *words))) or "none"
