"""Hazards, which a run must avoid, and metrics, which measure how bad a run was."""

import math
from dataclasses import dataclass, field
from typing import Literal

from mutator.targets.stored_phrases import PhraseByCase
from mutator.triggers.conditions import GOLDEN_PREFIX

Aggregate = Literal["min", "max", "mean", "last", "integral", "duration", "at_end", "at_hazard"]
WorseDirection = Literal["higher", "lower"]

MARGIN_PREFIX = "margin_"  # of the metric with the smallest margin of a hazard


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A number for each run: an aggregate of `formula` over the steps in which `where` holds, up to the first
    terminal hazard. Both may name values of the golden run (`golden.gap`).

    `at_hazard` is the value when `hazard` first occurs, if that is not after the end.
    With `ends_before_s`, the metric ends that long before this hazard; 0 leaves out the hazard's step.
    """

    name: str
    aggregate: Aggregate
    step_formula: str
    where: str = ""
    ends_before_s: float | None = None
    unit: str
    worse: WorseDirection
    about: str
    source: str = ""
    hazard: str = ""

    @property
    def uses_golden(self) -> bool:
        return GOLDEN_PREFIX in self.step_formula or GOLDEN_PREFIX in self.where

    def end_s(self, drive_end_s: float | None) -> float:
        """Return the time (s) at which the metric ends; infinite in a drive without a terminal hazard."""
        return math.inf if drive_end_s is None else drive_end_s - (self.ends_before_s or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hazard:
    """A hazard, and how to find it in a trace. Without `when` and `required_stl`, the target's record reports
    it.

    It occurs when `when` has held for `for_s` seconds, or when the STL formula `required_stl`, which must
    hold, is violated and all values that the formula needs are known. `margin` is a step's distance from the
    hazard, in `unit`; for `required_stl` it is the robustness. Once `terminal_condition` holds, the drive is
    over, and metrics ignore later steps ('': never; `True`: from the hazard on). Later hazards are still
    recorded. `phrase` is the hazard as a clause.
    """

    name: str
    about: str = ""
    when: str = ""
    required_stl: str = ""
    for_s: float = 0.0
    margin: str = ""
    unit: str = "-"
    terminal_condition: str = ""
    phrase: PhraseByCase = field(default_factory=dict)

    @property
    def is_in_record(self) -> bool:
        return not (self.when or self.required_stl)

    @property
    def margin_metric(self) -> Metric | None:
        """The metric `margin_<hazard>`: a run's smallest margin."""
        if not (self.margin or self.required_stl):
            return None
        return Metric(
            name=f"{MARGIN_PREFIX}{self.name.lower()}",
            aggregate="min",
            step_formula=self.margin,
            unit=self.unit,
            worse="lower",
            about=f"smallest distance from the limit of {self.name}; negative beyond the limit",
        )
