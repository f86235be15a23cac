"""What reviewers said of a group of mutants: a decision, remarks, a flag. Plain records, without files."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum

from mutator._common.hashing import content_id

# Parameter -> its least and greatest number, then the values that are not finite numbers (`nan`), as words.
Values = Mapping[str, tuple[float | str, ...]]

_WORDS = {
    "template": "template",
    "function": "target function",
    "diff": "diff",
    "calls": "code that it calls",
}


class Verdict(StrEnum):
    """What a reviewer decided."""

    APPROVED = "approved"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """Digests of what a decision is about; when one of them changes, the decision no longer holds."""

    diff: str  # of the hunks with injected lines, without their values and line numbers
    function: str  # of the target's functions that are changed, without injected lines
    template: str  # of the templates that the injected lines were made from
    calls: str | None = None  # of the target's code that the injected lines call; None: was not kept

    def changed(self, now: "Bound") -> list[str]:
        """What has changed, in words."""
        differs = {name: getattr(self, name) != getattr(now, name) for name in _WORDS}
        differs["calls"] &= self.calls is not None
        return [word for name, word in _WORDS.items() if differs[name]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What `by` decided about a group, and what the group was then.

    `at` is the time (UTC, ISO 8601), `commit` that of the library, `tool` the version of mutator; they, the
    values and the digest of what is called are None for a decision from a file that did not keep them.
    """

    group: str
    what: str
    verdict: Verdict
    by: str
    at: str | None = None
    commit: str | None = None
    tool: str | None = None
    bound: Bound
    values: Values | None = None

    def changed(self, bound: Bound, values: Values) -> list[str]:
        """What of the group has changed since, in words; empty: the decision holds."""
        beyond = _beyond(self.values, values) if self.values is not None else ""
        return self.bound.changed(bound) + ([f"values ({beyond})"] if beyond else [])

    @property
    def words(self) -> str:
        """Who decided what, and on which day: `approved by Jane Doe on 2026-11-24`."""
        return f"{self.verdict} by {self.by}" + (f" on {self.at[:10]}" if self.at else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """A line that somebody left on a group; `at` as in a decision."""

    by: str
    at: str | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """Somebody's mark to look at a group again."""

    by: str
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """All that was said of a group: its block in the file."""

    group: str
    what: str
    decision: Decision | None = None
    remarks: tuple[Remark, ...] = ()
    flag: Flag | None = None

    @property
    def says_nothing(self) -> bool:
        """Whether nothing of it is left."""
        return not (self.decision or self.remarks or self.flag)

    @property
    def revision(self) -> str:
        """Digest of all of it: another one as soon as anybody has said anything more."""
        return content_id(asdict(self))


def values_in_words(values: Values) -> str:
    """The ranges for a reader: `by: -40 to 40; seed: 3`."""
    return "; ".join(f"{name}: {_range(value)}" for name, value in values.items())


def _beyond(approved: Values, now: Values) -> str:
    """The values that are not within the approved ones, in words; empty if all are."""
    wider = [name for name in now if not _within(now[name], approved.get(name, ()))]
    told = (f"{name}: {_range(now[name])}; approved {_range(approved.get(name, ()))}" for name in wider)
    return "; ".join(told)


def _within(inner: tuple[float | str, ...], outer: tuple[float | str, ...]) -> bool:
    numbers = [value for value in outer if not isinstance(value, str)]
    return all(
        value in outer if isinstance(value, str) else bool(numbers) and numbers[0] <= value <= numbers[-1]
        for value in inner
    )


def _range(values: tuple[float | str, ...]) -> str:
    numbers = [f"{value:g}" for value in values if not isinstance(value, str)]
    words = [value for value in values if isinstance(value, str)]
    return ", ".join(filter(None, (" to ".join(dict.fromkeys(numbers)), *words))) or "none"
