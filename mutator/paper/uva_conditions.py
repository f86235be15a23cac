"""From the conditions of the authors' fault files to triggers."""

import math
import operator
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

FREE_ROAD_TERM = "not self.lead_relevancy"
_COMPARISON_PATTERN = re.compile(r"(\(?[\w.\[\]/]+\)?)(>=|<=|>|<)(\d{1,6}(?:\.\d{1,6})?)", re.ASCII)
_STEPS_PER_SECOND = 100
_COMPARE = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt}

# what the files compare, and what the manifest observes instead
_OBSERVED_BY_NAME = {
    "self.headway_time": "hwt",
    "self.current_time()": "t",
    "plant.current_time()": "t",  # after the step, for lanes that the next step shows
    "d_rel": "d_rel",
    "tracks[ids].dRel": "d_rel",
}
# counters of steps: how much later they are than the step's own number, and whether Python 2 divides them
# without a fraction
_COUNTERS = {
    "self.frameIdx": (0, False),  # read after the step, for what the next step shows
    "(self.frameIdx/100.0)": (0, False),
    "(frame/100)": (0, True),
    "frameIdx/100": (1, True),
    "(md.model.frameId/100)": (1, True),
    "(PL.PP.frame/100)": (1, True),
}
# the set speed is not observed, but the plan says whether it or a lead limits the target speed
_PLACE_CONDITIONS = {
    "v_target<(v_cruise * CV.KPH_TO_MS)": "plan.source != 'cruise'",
    "v_target>=(v_cruise * CV.KPH_TO_MS)": "plan.source == 'cruise'",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FileCondition:
    """A condition as a trigger: `when` over observed values, empty if it always holds; `where` at the place.

    `needs_free_road`: it holds only in runs without a lead.
    """

    when: str
    where: str | None
    needs_free_road: bool = field(compare=False)  # the trigger is the same


def parse_condition(text: str) -> FileCondition:
    """Return the trigger of a condition; ValueError, with the part that is not understood, and for one that
    never holds.
    """
    if place_condition := _PLACE_CONDITIONS.get(text):
        return FileCondition(when="", where=place_condition, needs_free_road=False)
    terms = text.split(" and ")
    observed = [_observed_comparison(term) for term in terms if term != FREE_ROAD_TERM]
    for name in dict.fromkeys(comparison.name for comparison in observed):
        if not _can_hold([comparison for comparison in observed if comparison.name == name]):
            raise ValueError(f"a condition that never holds: {text}")
    when = " and ".join(comparison.text for comparison in observed if not comparison.always_holds)
    return FileCondition(when=when, where=None, needs_free_road=FREE_ROAD_TERM in terms)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Comparison:
    """An observed value compared with a limit; times are in s."""

    name: str
    operator: str
    limit: float
    always_holds: bool = False

    @property
    def text(self) -> str:
        # all digits, and no exponent
        return f"{self.name} {self.operator} {f'{self.limit:.9f}'.rstrip('0').rstrip('.')}"


def _can_hold(comparisons: Sequence[_Comparison]) -> bool:
    """Return whether a value can satisfy all comparisons, which have the same name; time has steps."""
    lower = [comparison for comparison in comparisons if comparison.operator in (">=", ">")]
    upper = [comparison for comparison in comparisons if comparison.operator in ("<=", "<")]
    low = max((comparison.limit for comparison in lower), default=-math.inf)
    high = min((comparison.limit for comparison in upper), default=math.inf)
    if comparisons[0].name == "t":
        first = max(0, math.floor(low * _STEPS_PER_SECOND)) if lower else 0
        times = (step / _STEPS_PER_SECOND for step in range(first, first + 3))
        return any(all(_COMPARE[c.operator](time, c.limit) for c in comparisons) for time in times)
    is_open = any(c.operator in ("<", ">") and c.limit in (low, high) for c in comparisons)
    return low < high or (low == high and not is_open)


def _observed_comparison(term: str) -> _Comparison:
    match = _COMPARISON_PATTERN.fullmatch(term) or re.fullmatch(
        r"((?:self|plant)\.current_time\(\))(>=|<=|>|<)(\d{1,6}(?:\.\d{1,6})?)", term, re.ASCII
    )
    if not match:
        raise ValueError(f"a condition that is not understood: {term}")
    name, sign, limit = match[1], match[2], float(match[3])
    if name in _OBSERVED_BY_NAME:
        return _Comparison(name=_OBSERVED_BY_NAME[name], operator=sign, limit=limit)
    if name not in _COUNTERS:
        raise ValueError(f"a value that is not observed: {name}")
    later, divides_whole = _COUNTERS[name]
    if name == "self.frameIdx":
        limit /= _STEPS_PER_SECOND
    if divides_whole:
        sign, limit = _without_division(sign, limit)
    limit = round(limit - later / _STEPS_PER_SECOND, 9)
    always_holds = sign == ">=" and limit <= 0
    return _Comparison(name="t", operator=sign, limit=limit, always_holds=always_holds)


def _without_division(sign: str, limit: float) -> tuple[str, float]:
    """Return the comparison of seconds that holds when that of whole seconds, rounded down, does."""
    if sign in (">=", "<"):
        return sign, float(math.ceil(limit))
    return (">=", math.floor(limit) + 1.0) if sign == ">" else ("<", math.floor(limit) + 1.0)
