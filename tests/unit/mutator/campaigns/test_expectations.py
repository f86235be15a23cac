"""Which results a campaign expects."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.campaigns.expectations import NO_HAZARD, Expectation
from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.model import Outcome, Record
from mutator.targets.hazard_severity import SeverityScale
from mutator.workspace import Workspace

CLASSES = (("S0", 0.0, ""), ("S1", 2.0, ""), ("S2", 8.0, ""))
SCALE = SeverityScale(name="scale", about="", source="", classes=CLASSES, contact="H1")


@pytest.mark.parametrize(
    ("expectation", "hazards", "delta_v", "problem"),
    [
        (NO_HAZARD, (), None, ""),
        (NO_HAZARD, (("H1", 3.0),), 1.0, "hazard H1, allowed: none"),
        (Expectation(hazards=["H1"]), (("H1", 3.0), ("H3", 4.0)), 1.0, "hazard H3, allowed: H1"),
        (Expectation(hazards=["H1", "H3"]), (("H1", 3.0), ("H3", 4.0)), 9.0, ""),
        (Expectation(severity="S1"), (("H1", 3.0),), 3.0, ""),
        (Expectation(severity="S1"), (("H1", 3.0),), 9.0, "hazard H1 of severity S2, allowed: up to S1"),
        (Expectation(severity="S1"), (("H3", 3.0),), None, "hazard H3 without a class of severity"),
        (Expectation(severity="S0", hazards=["H1"]), (("H1", 3.0),), 3.0, "hazard H1 of severity S1"),
        (Expectation(severity="S0"), (), None, ""),
    ],
)
def test_a_result_is_compared_with_what_is_allowed(
    record: Callable[..., Record],
    expectation: Expectation,
    hazards: tuple[tuple[str, float], ...],
    delta_v: float | None,
    problem: str,
) -> None:
    metrics = () if delta_v is None else (("delta_v", delta_v),)
    result = record(outcome=Outcome.HAZARD if hazards else Outcome.MASKED, hazards=hazards, metrics=metrics)
    answer = expectation.problem_with(result, SCALE)
    assert answer.startswith(problem) if problem else answer == ""


@pytest.mark.parametrize(
    ("expect", "problem"),
    [
        ("{hazards: [H9]}", "hazard 'H9'"),
        ("{severity: S1}", "severity 'S1'"),
        ("{hazard: [H1]}", "hazard"),
    ],
)
def test_what_there_is_not_cannot_be_expected(toycar: Workspace, expect: str, problem: str) -> None:
    """The error names the line. The toy has no severity scale."""
    path = toycar.campaign("small")
    text = path.read_text()
    path.write_text(f"{text}expect: {expect}\n")
    with pytest.raises(MutatorError) as error:
        build_plan(toycar, "small")
    assert problem in str(error.value)
    assert f"{Path(path).name}:{len(text.splitlines()) + 1}" in str(error.value)


def test_an_expectation_changes_no_plan(toycar: Workspace) -> None:
    before = build_plan(toycar, "small").digest
    path = toycar.campaign("small")
    path.write_text(f"{path.read_text()}expect: {{hazards: []}}\n")
    assert build_plan(toycar, "small").digest == before
