"""Judges published observations. Each claim is a query on the results, and a rule decides the verdict.

Claims, queries and rules are data in the fault library (`references/paper_observations.yaml`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, model_validator

from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.paper.measures import MEASURES, Estimate, estimate_of_difference, estimate_of_share
from mutator.statistics.shares_with_intervals import share_with_interval

if TYPE_CHECKING:
    import pandas as pd

FILE_NAME = "paper_observations.yaml"
SCHEMA = "paper_observations/1"
MIN_RUNS_FOR_VERDICT = 10  # minimum number of runs for a verdict from an interval


class ClaimVerdict(StrEnum):
    """The verdict on a claim."""

    HOLDS = "holds"
    FAILS = "does not hold"
    UNDECIDED = "not enough data"


class ClaimRule(StrictModel):
    """The condition under which a claim holds. Exactly one field is set.

    Shares and differences are fractions; times are in s. `above`, `below` and `within` (plus or minus) are
    bounds for the whole interval. With `some`, at least one run must have the property; with `never`, no run
    may have it. If no run has it, a verdict needs an interval that ends at or below the given share.
    """

    above: float | None = None
    below: float | None = None
    within: float | None = Field(None, gt=0)
    some: float | None = Field(None, gt=0, lt=1)
    never: float | None = Field(None, gt=0, lt=1)

    @model_validator(mode="after")
    def _check(self) -> "ClaimRule":
        if len(self.model_dump(exclude_none=True)) != 1:
            raise ValueError("exactly one of above, below, within, some, never")
        return self

    def verdict_on(self, estimate: Estimate) -> ClaimVerdict:
        if self.some is not None or self.never is not None:
            return self._verdict_on_occurrence(estimate)
        if estimate.n < MIN_RUNS_FOR_VERDICT:
            return ClaimVerdict.UNDECIDED
        low, high = estimate.low, estimate.high  # comparisons with NaN are false
        if self.within is not None:
            holds, fails = -self.within < low and high < self.within, low > self.within or high < -self.within
        elif self.above is not None:
            holds, fails = low > self.above, high < self.above
        else:
            assert self.below is not None
            holds, fails = high < self.below, low > self.below
        return ClaimVerdict.HOLDS if holds else ClaimVerdict.FAILS if fails else ClaimVerdict.UNDECIDED

    def _verdict_on_occurrence(self, estimate: Estimate) -> ClaimVerdict:
        must_occur = self.some is not None
        if estimate.count_with_property:
            return ClaimVerdict.HOLDS if must_occur else ClaimVerdict.FAILS
        if estimate.n and estimate.high <= (self.some or self.never or 0.0):
            return ClaimVerdict.FAILS if must_occur else ClaimVerdict.HOLDS
        return ClaimVerdict.UNDECIDED

    def __str__(self) -> str:
        [(name, value)] = self.model_dump(exclude_none=True).items()
        return f"{name} {value:g}"


class _ClaimGroups(StrictModel):
    column: str
    values: list[str] = Field(min_length=1)


class Claim(StrictModel):
    """One claim. The comment at the top of the file of observations explains the fields.

    If the results cannot decide the claim, it has no measure, and `see` says where to look instead.
    """

    claim_text: str = Field(alias="says")
    measure: str | None = None
    runs_query: str = Field("", alias="of")
    against: str | None = None
    part: str | None = None
    start: str | None = None
    end: str | None = None
    each: _ClaimGroups | None = None
    claim_rule: ClaimRule | None = Field(None, alias="holds")
    see: str = ""
    paper: list[list[int]] = Field(default_factory=list, max_length=2)
    published_words: str = Field("", alias="told")
    mixture: bool = False
    needed: bool = False

    @model_validator(mode="after")
    def _check(self) -> "Claim":
        if self.measure is not None and self.measure not in MEASURES:
            raise ValueError(f"a `measure` that is one of {', '.join(MEASURES)}")
        if (self.measure is None) != (self.claim_rule is None) or (self.measure is None) != bool(self.see):
            raise ValueError("either `measure` and `holds`, or `see`")
        if any(len(pair) != 2 for pair in self.paper):
            raise ValueError("pairs of a count and a total")
        return self

    def measure_calls(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield each group with the arguments of the measure. A claim without groups has one group, ''."""
        text_by_argument = {"of": self.runs_query}
        text_by_argument |= {name: getattr(self, name) for name in ("against", "part", "start", "end")}
        # an empty `of` means all runs
        arguments = {name: text for name, text in text_by_argument.items() if text is not None}
        if self.each is None:
            yield "", arguments
            return
        for value in self.each.values:
            group_query = f'({self.runs_query}) and {self.each.column} == "{value}"'
            yield value, arguments | {"of": group_query}

    def published_estimate(self) -> Estimate | None:
        """Return the paper's counts as an estimate."""
        shares = [share_with_interval(count, of) for count, of in self.paper]
        if len(shares) == 2:
            return estimate_of_difference(*shares)
        return estimate_of_share(shares[0]) if shares else None


class PublishedObservation(StrictModel):
    """One observation, divided into claims."""

    title: str
    claims: list[Claim] = Field(min_length=1)


class ObservationsFile(StrictModel):
    """The file of observations."""

    source: str
    observations: list[PublishedObservation] = Field(min_length=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimAnswer:
    """A query and its result. `group` is '' if the claim has no groups."""

    group: str
    query: str
    estimate: Estimate
    verdict: ClaimVerdict


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedClaim:
    """A claim with its results and verdict. `reason` gives reasons beyond the rule."""

    number: str  # "1.2" is the second claim of the first observation
    claim: Claim
    answers: tuple[ClaimAnswer, ...]
    verdict: ClaimVerdict
    verdict_on_paper: ClaimVerdict | None  # verdict of the same rule on the published counts
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedObservation:
    """An observation and its verdict."""

    number: int
    title: str
    claims: tuple[JudgedClaim, ...]
    verdict: ClaimVerdict


def judge_observations(
    path: Path,
    runs: "pd.DataFrame",
    differences_from_papers_mixture: Sequence[str],
    *,
    only_needed: bool = False,
) -> tuple[JudgedObservation, ...]:
    """Judge the observations in a file against a frame of results.

    With `only_needed`, judge only the claims on which observations depend. With differences from the paper's
    mixture of faults, claims that need this mixture stay undecided. MutatorError with file and line if the
    file or a query is invalid.
    """
    model, source = load_yaml_model(path, ObservationsFile, SCHEMA)
    judged = []
    for i, observation in enumerate(model.observations):
        claims = tuple(
            _judge_claim(
                f"{i + 1}.{k + 1}",
                claim,
                runs,
                differences_from_papers_mixture,
                source,
                ("observations", i, "claims", k),
            )
            for k, claim in enumerate(observation.claims)
            if claim.needed or not only_needed
        )
        needed = [judged_claim.verdict for judged_claim in claims if judged_claim.claim.needed]
        judged.append(
            JudgedObservation(
                number=i + 1, title=observation.title, claims=claims, verdict=combined_verdict(needed)
            )
        )
    return tuple(judged)


def combined_verdict(verdicts: Sequence[ClaimVerdict]) -> ClaimVerdict:
    """Return FAILS if any verdict is FAILS, else HOLDS if all (at least one) are HOLDS, else UNDECIDED."""
    for verdict in (ClaimVerdict.FAILS, ClaimVerdict.UNDECIDED):
        if verdict in verdicts:
            return verdict
    return ClaimVerdict.HOLDS if verdicts else ClaimVerdict.UNDECIDED


def _judge_claim(
    number: str,
    claim: Claim,
    runs: "pd.DataFrame",
    differences_from_papers_mixture: Sequence[str],
    source: YamlSource,
    yaml_keys: tuple[str | int, ...],
) -> JudgedClaim:
    if claim.measure is None or claim.claim_rule is None:
        return JudgedClaim(
            number=number,
            claim=claim,
            answers=(),
            verdict=ClaimVerdict.UNDECIDED,
            verdict_on_paper=None,
            reason=claim.see.strip(),
        )
    answers = tuple(
        _answer_claim(group, claim.measure, claim.claim_rule, arguments, runs, source, yaml_keys)
        for group, arguments in claim.measure_calls()
    )
    verdict, reason = combined_verdict([answer.verdict for answer in answers]), ""
    if claim.mixture and differences_from_papers_mixture:
        verdict, reason = ClaimVerdict.UNDECIDED, "; ".join(differences_from_papers_mixture)
    published = claim.published_estimate()
    return JudgedClaim(
        number=number,
        claim=claim,
        answers=answers,
        verdict=verdict,
        verdict_on_paper=claim.claim_rule.verdict_on(published) if published else None,
        reason=reason,
    )


def _answer_claim(
    group: str,
    measure_name: str,
    rule: ClaimRule,
    arguments: dict[str, str],
    runs: "pd.DataFrame",
    source: YamlSource,
    yaml_keys: tuple[str | int, ...],
) -> ClaimAnswer:
    # a call that readers can repeat in Python
    query = f"{measure_name}(runs, {', '.join(f'{name}={text!r}' for name, text in arguments.items())})"
    call: Any = MEASURES[measure_name]
    try:
        estimate: Estimate = call(runs, **arguments)
    except (NameError, SyntaxError, TypeError, ValueError, KeyError, AttributeError) as err:
        raise source.error(
            yaml_keys,
            f"a query that fails: {err}",
            expected=f"arguments that {measure_name} accepts, with names of columns of the results",
            remedy="see mutator/paper/measures.py",
        ) from err
    return ClaimAnswer(group=group, query=query, estimate=estimate, verdict=rule.verdict_on(estimate))
