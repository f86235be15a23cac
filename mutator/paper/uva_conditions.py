"""From the conditions of the authors' fault files to triggers."""

import math
import re
from dataclasses import dataclass

FREE_ROAD_TERM = "not self.lead_relevancy"
_COMPARISON_PATTERN = re.compile(r"(\(?[\w.\[\]/]+\)?)(>=|<=|>|<)(\d{1,6}(?:\.\d{1,6})?)", re.ASCII)
_STEPS_PER_SECOND = 100

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
    needs_free_road: bool


def parse_condition(text: str) -> FileCondition:
    """Return the trigger of a condition; ValueError, with the part that is not understood."""
    if place_condition := _PLACE_CONDITIONS.get(text):
        return FileCondition(when="", where=place_condition, needs_free_road=False)
    terms = text.split(" and ")
    observed = [_observed_term(term) for term in terms if term != FREE_ROAD_TERM]
    return FileCondition(
        when=" and ".join(filter(None, observed)), where=None, needs_free_road=FREE_ROAD_TERM in terms
    )


def _observed_term(term: str) -> str:
    match = _COMPARISON_PATTERN.fullmatch(term) or re.fullmatch(
        r"((?:self|plant)\.current_time\(\))(>=|<=|>|<)(\d{1,6}(?:\.\d{1,6})?)", term
    )
    if not match:
        raise ValueError(f"a condition that is not understood: {term}")
    name, operator, limit = match[1], match[2], float(match[3])
    if name in _OBSERVED_BY_NAME:
        return f"{_OBSERVED_BY_NAME[name]} {operator} {limit:g}"
    if name not in _COUNTERS:
        raise ValueError(f"a value that is not observed: {name}")
    later, divides_whole = _COUNTERS[name]
    if name == "self.frameIdx":
        limit /= _STEPS_PER_SECOND
    if divides_whole:
        operator, limit = _without_division(operator, limit)
    limit -= later / _STEPS_PER_SECOND
    return "" if operator == ">=" and limit <= 0 else f"t {operator} {limit:g}"


def _without_division(operator: str, limit: float) -> tuple[str, float]:
    """Return the comparison of seconds that holds when that of whole seconds, rounded down, does."""
    if operator in (">=", "<"):
        return operator, float(math.ceil(limit))
    return (">=", math.floor(limit) + 1.0) if operator == ">" else ("<", math.floor(limit) + 1.0)
