"""Judges published observations. Each claim is a query on the results, and a rule decides the verdict.

Claims, queries and rules are data in the fault library (`references/paper_observations.yaml`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import Field, model_validator

from mutator.config.yaml_files import StrictModel, read
from mutator.config.yaml_sources import Source
from mutator.paper.measures import MEASURES, Estimate, of_difference, of_share
from mutator.statistics.shares import share

FILE = "paper_observations.yaml"
SCHEMA = "paper_observations/1"
FEWEST = 10  # minimum number of runs for a verdict from an interval


class Verdict(StrEnum):
    """The verdict on a claim."""

    HOLDS = "holds"
    FAILS = "does not hold"
    UNDECIDED = "not enough data"


class Rule(StrictModel):
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
    def _check(self) -> "Rule":
        if len(self.model_dump(exclude_none=True)) != 1:
            raise ValueError("exactly one of above, below, within, some, never")
        return self

    def verdict(self, found: Estimate) -> Verdict:
        if self.some is not None or self.never is not None:
            return self._seen(found)
        if found.n < FEWEST:
            return Verdict.UNDECIDED
        low, high = found.low, found.high  # comparisons with NaN are false
        if self.within is not None:
            holds, fails = -self.within < low and high < self.within, low > self.within or high < -self.within
        elif self.above is not None:
            holds, fails = low > self.above, high < self.above
        else:
            assert self.below is not None
            holds, fails = high < self.below, low > self.below
        return Verdict.HOLDS if holds else Verdict.FAILS if fails else Verdict.UNDECIDED

    def _seen(self, found: Estimate) -> Verdict:
        wanted = self.some is not None
        if found.count:
            return Verdict.HOLDS if wanted else Verdict.FAILS
        if found.n and found.high <= (self.some or self.never or 0.0):
            return Verdict.FAILS if wanted else Verdict.HOLDS
        return Verdict.UNDECIDED

    def __str__(self) -> str:
        [(name, value)] = self.model_dump(exclude_none=True).items()
        return f"{name} {value:g}"


class _Each(StrictModel):
    column: str
    values: list[str] = Field(min_length=1)


class Claim(StrictModel):
    """One claim. The comment at the top of the file of observations explains the fields.

    If the results cannot decide the claim, it has no measure, and `see` says where to look instead.
    """

    says: str
    measure: str | None = None
    of: str = ""
    against: str | None = None
    part: str | None = None
    start: str | None = None
    end: str | None = None
    each: _Each | None = None
    holds: Rule | None = None
    see: str = ""
    paper: list[list[int]] = Field(default_factory=list, max_length=2)
    told: str = ""
    mixture: bool = False
    needed: bool = False

    @model_validator(mode="after")
    def _check(self) -> "Claim":
        if self.measure is not None and self.measure not in MEASURES:
            raise ValueError(f"a `measure` that is one of {', '.join(MEASURES)}")
        if (self.measure is None) != (self.holds is None) or (self.measure is None) != bool(self.see):
            raise ValueError("either `measure` and `holds`, or `see`")
        if any(len(pair) != 2 for pair in self.paper):
            raise ValueError("pairs of a count and a total")
        return self

    def calls(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield each group with the arguments of the measure. A claim without groups has one group, ''."""
        named = {name: getattr(self, name) for name in ("of", "against", "part", "start", "end")}
        # an empty `of` means all runs
        arguments = {name: text for name, text in named.items() if text is not None}
        if self.each is None:
            yield "", arguments
            return
        for value in self.each.values:
            chosen = f'({self.of}) and {self.each.column} == "{value}"'
            yield value, arguments | {"of": chosen}

    def published(self) -> Estimate | None:
        """Return the paper's counts as an estimate."""
        shares = [share(count, of) for count, of in self.paper]
        if len(shares) == 2:
            return of_difference(*shares)
        return of_share(shares[0]) if shares else None


class Observation(StrictModel):
    """One observation, divided into claims."""

    title: str
    claims: list[Claim] = Field(min_length=1)


class Observations(StrictModel):
    """The file of observations."""

    source: str
    observations: list[Observation] = Field(min_length=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A query and its result. `group` is '' if the claim has no groups."""

    group: str
    query: str
    found: Estimate
    verdict: Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedClaim:
    """A claim with its results and verdict. `why` gives reasons beyond the rule."""

    number: str  # "1.2" is the second claim of the first observation
    claim: Claim
    answers: tuple[Answer, ...]
    verdict: Verdict
    paper: Verdict | None  # verdict of the same rule on the published counts
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedObservation:
    """An observation and its verdict."""

    number: int
    title: str
    claims: tuple[JudgedClaim, ...]
    verdict: Verdict


def judge(
    path: Path, runs: pd.DataFrame, lacks: Sequence[str], *, only_needed: bool = False
) -> tuple[JudgedObservation, ...]:
    """Judge the observations in a file against a frame of results.

    With `only_needed`, judge only the claims on which observations depend. `lacks` says how the runs differ
    from the paper's mixture of faults. MutatorError with file and line if the file or a query is invalid.
    """
    model, source = read(path, Observations, SCHEMA)
    made = []
    for i, observation in enumerate(model.observations):
        claims = tuple(
            _judged(f"{i + 1}.{k + 1}", claim, runs, lacks, source, ("observations", i, "claims", k))
            for k, claim in enumerate(observation.claims)
            if claim.needed or not only_needed
        )
        needed = [one.verdict for one in claims if one.claim.needed]
        made.append(
            JudgedObservation(number=i + 1, title=observation.title, claims=claims, verdict=together(needed))
        )
    return tuple(made)


def together(verdicts: Sequence[Verdict]) -> Verdict:
    """Return FAILS if any verdict is FAILS, else HOLDS if all (at least one) are HOLDS, else UNDECIDED."""
    for verdict in (Verdict.FAILS, Verdict.UNDECIDED):
        if verdict in verdicts:
            return verdict
    return Verdict.HOLDS if verdicts else Verdict.UNDECIDED


def _judged(
    number: str,
    claim: Claim,
    runs: pd.DataFrame,
    lacks: Sequence[str],
    source: Source,
    keys: tuple[str | int, ...],
) -> JudgedClaim:
    if claim.measure is None or claim.holds is None:
        return JudgedClaim(
            number=number,
            claim=claim,
            answers=(),
            verdict=Verdict.UNDECIDED,
            paper=None,
            why=claim.see.strip(),
        )
    answers = tuple(
        _answer(group, claim.measure, claim.holds, arguments, runs, source, keys)
        for group, arguments in claim.calls()
    )
    verdict, why = together([one.verdict for one in answers]), ""
    if claim.mixture and lacks:
        verdict, why = Verdict.UNDECIDED, "; ".join(lacks)
    published = claim.published()
    return JudgedClaim(
        number=number,
        claim=claim,
        answers=answers,
        verdict=verdict,
        paper=claim.holds.verdict(published) if published else None,
        why=why,
    )


def _answer(
    group: str,
    measure: str,
    rule: Rule,
    arguments: dict[str, str],
    runs: pd.DataFrame,
    source: Source,
    keys: tuple[str | int, ...],
) -> Answer:
    query = f"{measure}(runs, {', '.join(f'{name}={text!r}' for name, text in arguments.items())})"
    call: Any = MEASURES[measure]
    try:
        found: Estimate = call(runs, **arguments)
    except (NameError, SyntaxError, TypeError, ValueError, KeyError, AttributeError) as err:
        raise source.error(
            keys,
            f"a query that fails: {err}",
            expected=f"arguments that {measure} accepts, with names of columns of the results",
            remedy="see mutator/paper/measures.py",
        ) from err
    return Answer(group=group, query=query, found=found, verdict=rule.verdict(found))
