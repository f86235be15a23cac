"""The observations as Markdown and as a table."""

from collections.abc import Iterator, Sequence

from mutator._common.table_rendering import TextTable
from mutator.paper.observation_judging import MIN_RUNS_FOR_VERDICT, JudgedClaim, JudgedObservation
from mutator.statistics.statistics_sheet import Sheet, SheetCell

RULES_TEXT = f"""\
A claim is decided by the 95 % interval of its number, not by the number itself. *above x*: the claim holds if
the whole interval lies above x, and does not hold if it lies below; *below x* and *within x* (plus or minus
x) likewise. With fewer than {MIN_RUNS_FOR_VERDICT} runs there is not enough data. *some x*: the claim holds
if at least one run has the property. *never x*: the claim does not hold if at least one run has the
property. If no run has it, the opposite verdict needs an interval that ends at x or below. A claim with
groups must hold in each group. A claim about all faults needs a complete run with all fault types of the
paper. An observation holds if all claims that it depends on hold, and does not hold if one of them does
not; otherwise there is not enough data. The intervals treat runs as independent, except where whole faults
are resampled, so the true uncertainty is at least as large."""

SESSION_SETUP_CODE = """\
from mutator.paper.measures import *
from mutator.statistics.results_frame import load_usable_results

runs = load_usable_results(Path("results.csv"))"""

CLAIM_HEADS = ("claim", "", "the paper", "verdict on its counts", "here", "rule", "verdict")


def claims_table(observation: JudgedObservation) -> TextTable:
    """Return the table of an observation: a row for each claim, and a row for each of its groups."""
    rows = []
    for claim in observation.claims:
        rule = str(claim.claim.claim_rule or "")
        first_row = [
            claim.number,
            _claim_text(claim),
            describe_paper_result(claim),
            str(claim.verdict_on_paper or "-"),
        ]
        if len(claim.answers) == 1:
            first_row += [claim.answers[0].estimate.text, rule, _describe_verdict(claim)]
        else:
            first_row += ["" if claim.answers else "-", rule, _describe_verdict(claim)]
        rows.append(first_row)
        if len(claim.answers) > 1:
            rows += [
                ["", answer.group, "", "", answer.estimate.text, "", answer.verdict.value]
                for answer in claim.answers
            ]
    return TextTable(heads=CLAIM_HEADS, rows=rows)


def describe_paper_result(claim: JudgedClaim) -> str:
    """Return what the paper says about a claim, counts first."""
    estimate = claim.claim.published_estimate()
    return (
        "; ".join(text for text in (estimate.text if estimate else "", claim.claim.published_words) if text)
        or "-"
    )


def session_setup_code(ends: Sequence[tuple[str, float]]) -> str:
    if not ends:
        return SESSION_SETUP_CODE
    times = ", ".join(f'"{scenario}": {end:g}' for scenario, end in ends)
    return f'{SESSION_SETUP_CODE}\nruns["t_end"] = runs["scenario"].map({{{times}}})'


def render_observations_markdown(
    observations: Sequence[JudgedObservation], ends: Sequence[tuple[str, float]], coverage: str
) -> str:
    parts = ["# The paper's observations", coverage, verdicts_markdown(observations), rules_text()]
    for observation in observations:
        parts += [f"## {observation_heading(observation)}", claims_table(observation).as_markdown()]
    parts += [
        "## The queries",
        "In the run folder, in Python:",
        f"```python\n{session_setup_code(ends)}\n```",
    ]
    for observation in observations:
        for claim in observation.claims:
            queries = "\n".join(answer.query for answer in claim.answers) or f"# {claim.reason}"
            parts += [f"**{claim.number}** {claim.claim.claim_text}", f"```python\n{queries}\n```"]
    return "\n\n".join(parts) + "\n"


def verdicts_markdown(observations: Sequence[JudgedObservation]) -> str:
    rows = [
        [str(observation.number), observation.title, observation.verdict.value]
        for observation in observations
    ]
    return TextTable(heads=("observation", "", "verdict"), rows=rows).as_markdown()


def observation_heading(observation: JudgedObservation) -> str:
    return f"Observation {observation.number}: {observation.title} ({observation.verdict.value})"


def rules_text() -> str:
    return RULES_TEXT.replace("\n", " ") + " Claims that an observation depends on are marked with *."


def observations_sheet(observations: Sequence[JudgedObservation]) -> Sheet:
    return Sheet(
        name="observations",
        title="The paper's observations",
        note=rules_text(),
        heads=(
            *("observation", "claim", "needed", "says", "group", "paper", "paper's counts by the rule"),
            *("N", "estimate", "low", "high", "rule", "verdict", "verdict of the claim", "query"),
        ),
        lines=tuple(_sheet_rows(observations)),
    )


def _sheet_rows(observations: Sequence[JudgedObservation]) -> Iterator[tuple[SheetCell, ...]]:
    for observation in observations:
        for claim in observation.claims:
            head = (observation.number, claim.number, int(claim.claim.needed), claim.claim.claim_text)
            paper, by_rule, rule = (
                describe_paper_result(claim),
                str(claim.verdict_on_paper or ""),
                str(claim.claim.claim_rule or ""),
            )
            if not claim.answers:
                yield (*head, "", paper, by_rule, *[None] * 4, rule, "", claim.verdict.value, "")
            for answer in claim.answers:
                numbers = (
                    answer.estimate.n,
                    answer.estimate.value,
                    answer.estimate.low,
                    answer.estimate.high,
                )
                verdict = (answer.verdict.value, claim.verdict.value, answer.query)
                yield (*head, answer.group, paper, by_rule, *numbers, rule, *verdict)


def _claim_text(claim: JudgedClaim) -> str:
    return claim.claim.claim_text + (" *" if claim.claim.needed else "")


def _describe_verdict(claim: JudgedClaim) -> str:
    return f"{claim.verdict.value}: {claim.reason}" if claim.reason else claim.verdict.value
