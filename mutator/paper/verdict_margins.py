"""How much a number would have to change for another verdict on its claim."""

import math
from dataclasses import dataclass

from mutator.paper.measures import Estimate, estimate_of_share
from mutator.paper.observation_judging import (
    MIN_RUNS_FOR_VERDICT,
    ClaimRule,
    ClaimVerdict,
    JudgedClaim,
    JudgedObservation,
)
from mutator.statistics.shares_with_intervals import share_with_interval

_BEYOND = 1e-9  # how far an interval is moved past a bound
_TIME_MEASURES = ("mean_time", "median_time")


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictMargin:
    """The smallest change of one number after which its verdict is another one. `size` orders changes: a
    number of runs, of pairs, or of tenths of a second.
    """

    verdict: ClaimVerdict
    size: float
    text: str


def smallest_change(rule: ClaimRule, estimate: Estimate, measure: str) -> VerdictMargin | None:
    """Return the smallest change of a count, with the total as it is. Of a difference, a time or a weighted
    share, the interval is moved as a whole. None if no change alters the verdict.
    """
    verdict = rule.verdict_on(estimate)
    if estimate.n < MIN_RUNS_FOR_VERDICT and rule.some is None and rule.never is None:
        return None
    count, is_occurrence = estimate.count_with_property, rule.some is not None or rule.never is not None
    if measure == "share" and count is not None and (is_occurrence or not _is_weighted(estimate, count)):
        return _change_of_count(rule, count, estimate.n, verdict)
    return _change_of_interval(rule, estimate, measure, verdict)


def _is_weighted(estimate: Estimate, count: int) -> bool:
    plain = share_with_interval(count, estimate.n)
    return (plain.low, plain.high) != (estimate.low, estimate.high)


def _change_of_count(rule: ClaimRule, count: int, of: int, verdict: ClaimVerdict) -> VerdictMargin | None:
    for size in range(1, of + 1):
        for changed in (count - size, count + size):
            if 0 <= changed <= of:
                other = rule.verdict_on(estimate_of_share(share_with_interval(changed, of)))
                if other is not verdict:
                    text = f"{changed:,} instead of {count:,} of {of:,} ({changed - count:+,})"
                    return VerdictMargin(verdict=other, size=size, text=text)
    return None


def _change_of_interval(
    rule: ClaimRule, estimate: Estimate, measure: str, verdict: ClaimVerdict
) -> VerdictMargin | None:
    bounds = [bound for bound in (rule.above, rule.below) if bound is not None]
    bounds += [-rule.within, rule.within] if rule.within is not None else []
    shifts = [bound - end for bound in bounds for end in (estimate.low, estimate.high)]
    for shift in sorted((s for s in shifts if math.isfinite(s)), key=abs):
        moved = shift + math.copysign(_BEYOND, shift)
        other = rule.verdict_on(
            Estimate(
                value=estimate.value + moved,
                low=estimate.low + moved,
                high=estimate.high + moved,
                n=estimate.n,
                text="",
            )
        )
        if other is not verdict:
            return _described_shift(shift, estimate, measure, other)
    return None


def _described_shift(shift: float, estimate: Estimate, measure: str, verdict: ClaimVerdict) -> VerdictMargin:
    if measure in _TIME_MEASURES:
        return VerdictMargin(verdict=verdict, size=10 * abs(shift), text=f"{shift:+.2f} s")
    if measure == "stratified":
        return VerdictMargin(verdict=verdict, size=abs(shift) * estimate.n, text=f"{shift:+.3f}")
    count = math.ceil(abs(shift) * estimate.n)
    sign = "+" if shift > 0 else "-"
    text = f"{100 * shift:+.1f} points, {sign}{count:,} of {estimate.n:,}"
    return VerdictMargin(verdict=verdict, size=count, text=text)


def describe_observation_margin(observation: JudgedObservation) -> str:
    """Say what the observation's verdict would need to change: the smallest change of one claim if it holds,
    and a change of each claim that does not hold, or is not decided, otherwise.
    """
    needed = [claim for claim in observation.claims if claim.claim.needed]
    margins = [margin for claim in needed for margin in _margins_of(claim)]
    if observation.verdict is ClaimVerdict.HOLDS:
        single_changes = [(name, margin) for name, _, margin in margins if margin]
        if not single_changes:
            return "no single count"
        name, margin = min(single_changes, key=lambda entry: entry[1].size)
        return _change_of_claim(name, margin)
    parts = [(name, margin) for name, verdict, margin in margins if verdict is observation.verdict]
    texts = [_change_of_claim(name, margin) for name, margin in parts if margin]
    if unchangeable := [name for name, margin in parts if not margin]:
        texts.append(f"{', '.join(unchangeable)}: more runs")
    return "; ".join(texts) or "all fault types of the paper"


def _change_of_claim(name: str, margin: VerdictMargin) -> str:
    return f"{name}: {margin.text}, then {margin.verdict.value}"


def _margins_of(claim: JudgedClaim) -> list[tuple[str, ClaimVerdict, VerdictMargin | None]]:
    """Return name, verdict and margin of each answer; the name is the claim's number with the group."""
    rule, measure = claim.claim.claim_rule, claim.claim.measure
    if rule is None or measure is None:
        return []
    return [
        (
            f"{claim.number} {answer.group}".strip(),
            answer.verdict,
            smallest_change(rule, answer.estimate, measure),
        )
        for answer in claim.answers
    ]
