"""The observations as Markdown and as a table."""

from collections.abc import Iterator, Sequence

from mutator._common.table_rendering import Table
from mutator.paper.observations import FEWEST, JudgedClaim, JudgedObservation
from mutator.statistics.statistics_sheet import Sheet, SheetCell

RULES = f"""\
A claim is decided by the 95 % interval of its number, not by the number itself. *above x*: the claim holds if
the whole interval lies above x, and does not hold if it lies below; *below x* and *within x* (plus or minus
x) likewise. With fewer than {FEWEST} runs there is not enough data. *some x*: the claim holds if at least one
run has the property. *never x*: the claim does not hold if at least one run has the property. If no run has
it, the opposite verdict needs an interval that ends at x or below. A claim with groups must hold in each
group. A claim about all faults needs a complete run with all fault types of the paper. An observation holds
if all claims that it depends on hold, and does not hold if one of them does not; otherwise there is not
enough data. The intervals treat runs as independent, except where whole faults are resampled, so the true
uncertainty is at least as large."""

SESSION = """\
from mutator.paper.measures import *
from mutator.statistics.results_frame import load_usable_results

runs = load_usable_results(Path("results.csv"))"""

HEADS = ("claim", "", "the paper", "verdict on its counts", "here", "rule", "verdict")


def table(observation: JudgedObservation) -> Table:
    """Return the table of an observation: a row for each claim, and a row for each of its groups."""
    made = []
    for one in observation.claims:
        rule = str(one.claim.holds or "")
        first = [one.number, _says(one), published(one), str(one.paper or "-")]
        if len(one.answers) == 1:
            first += [one.answers[0].found.text, rule, _verdict(one)]
        else:
            first += ["" if one.answers else "-", rule, _verdict(one)]
        made.append(first)
        if len(one.answers) > 1:
            made += [["", a.group, "", "", a.found.text, "", a.verdict.value] for a in one.answers]
    return Table(heads=HEADS, rows=made)


def published(one: JudgedClaim) -> str:
    """Return what the paper says about a claim, counts first."""
    found = one.claim.published()
    return "; ".join(text for text in (found.text if found else "", one.claim.told) if text) or "-"


def session(ends: Sequence[tuple[str, float]]) -> str:
    if not ends:
        return SESSION
    times = ", ".join(f'"{scenario}": {end:g}' for scenario, end in ends)
    return f'{SESSION}\nruns["t_end"] = runs["scenario"].map({{{times}}})'


def markdown(
    observations: Sequence[JudgedObservation], ends: Sequence[tuple[str, float]], coverage: str
) -> str:
    parts = ["# The paper's observations", coverage, verdicts(observations), rules()]
    for one in observations:
        parts += [f"## {heading(one)}", table(one).as_markdown()]
    parts += ["## The queries", "In the run folder, in Python:", f"```python\n{session(ends)}\n```"]
    for one in observations:
        for claim in one.claims:
            shown = "\n".join(answer.query for answer in claim.answers) or f"# {claim.why}"
            parts += [f"**{claim.number}** {claim.claim.says}", f"```python\n{shown}\n```"]
    return "\n\n".join(parts) + "\n"


def verdicts(observations: Sequence[JudgedObservation]) -> str:
    rows = [[str(one.number), one.title, one.verdict.value] for one in observations]
    return Table(heads=("observation", "", "verdict"), rows=rows).as_markdown()


def heading(one: JudgedObservation) -> str:
    return f"Observation {one.number}: {one.title} ({one.verdict.value})"


def rules() -> str:
    return RULES.replace("\n", " ") + " Claims that an observation depends on are marked with *."


def sheet(observations: Sequence[JudgedObservation]) -> Sheet:
    return Sheet(
        name="observations",
        title="The paper's observations",
        note=rules(),
        heads=(
            *("observation", "claim", "needed", "says", "group", "paper", "paper's counts by the rule"),
            *("N", "estimate", "low", "high", "rule", "verdict", "verdict of the claim", "query"),
        ),
        lines=tuple(_cells(observations)),
    )


def _cells(observations: Sequence[JudgedObservation]) -> Iterator[tuple[SheetCell, ...]]:
    for observation in observations:
        for one in observation.claims:
            head = (observation.number, one.number, int(one.claim.needed), one.claim.says)
            paper, by_rule, rule = published(one), str(one.paper or ""), str(one.claim.holds or "")
            if not one.answers:
                yield (*head, "", paper, by_rule, *[None] * 4, rule, "", one.verdict.value, "")
            for a in one.answers:
                numbers = (a.found.n, a.found.estimate, a.found.low, a.found.high)
                verdict = (a.verdict.value, one.verdict.value, a.query)
                yield (*head, a.group, paper, by_rule, *numbers, rule, *verdict)


def _says(one: JudgedClaim) -> str:
    return one.claim.says + (" *" if one.claim.needed else "")


def _verdict(one: JudgedClaim) -> str:
    return f"{one.verdict.value}: {one.why}" if one.why else one.verdict.value
