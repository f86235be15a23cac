"""Findings of checks on a machine, a library or a target, good or bad."""

from dataclasses import dataclass
from enum import StrEnum

from mutator.model import GoldenClass
from mutator.store.checks_file import HazardTimes, describe_golden_hazards


class CheckState(StrEnum):
    """The effect of a finding on campaigns."""

    OK = "ok"
    WARN = "warning"
    FAIL = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingPlace:
    """A line that a finding is about, and what is there. `file` can be relative to the target's root."""

    file: str
    line: int | None
    what: str

    def __str__(self) -> str:
        """Text such as `pkg/driver.py:12 in Driver.drive: time.monotonic() reads the clock`."""
        return f"{self.file}{'' if self.line is None else f':{self.line}'} {self.what}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """The result of one check, with a remedy if there is a problem."""

    name: str
    level: CheckState
    found: str
    remedy: str = ""
    places: tuple[FindingPlace, ...] = ()


def golden_hazard_finding(name: str, success: str, hazards: HazardTimes) -> Finding:
    """Return the warning of a golden run that is sound (`success` says how), but has these hazards."""
    kind = GoldenClass.HAZARD_WITHOUT_FAULT
    return Finding(
        name=name,
        level=CheckState.WARN,
        found=f"{success}; {kind}: {describe_golden_hazards(hazards)}",
        remedy=f"campaigns leave its experiments out, unless they `include: {kind}`",
    )
