"""The mutation score of a closed loop."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from mutator.model import OPERATOR_FAULTS_MODULE, Experiment, Fault
from mutator.statistics.mutation_score import mutant_effect_flags, mutation_score_sheet
from mutator.statistics.shares_with_intervals import share_with_interval

from .results_frame import results

ACTIVE = {"t_activation": 1.0}
CHANGED = ACTIVE | {"t_manifest": 1.1}
HIT = CHANGED | {"h1": 1, "t_h1": 3.0}
GOLDEN = {("S1", ""): frozenset({"own"})}
HEADS = ("of", "counted", "fault", "number", "not activated", "actuator changed", "new alert", "hazard")


def drive(mutant: str, became: dict[str, Any], **given: str) -> dict[str, Any]:
    told = {
        "module": OPERATOR_FAULTS_MODULE,
        "fault_type": "arithmetic",
        "trigger": "always",
        "fault_id": mutant,
    }
    return told | became | given


@pytest.fixture
def faults(experiment: Callable[..., Experiment]) -> dict[str, Fault]:
    """Four mutants, of which the first two are in one function."""
    one = experiment().fault
    (injection,) = one.injections
    found = {}
    for name, function in (("a", "f"), ("b", "f"), ("c", "g"), ("d", "g")):
        place = replace(injection, location=replace(injection.location, function=function))
        found[name] = replace(one, module=OPERATOR_FAULTS_MODULE, injections=(place,))
    return found


def lines(sheet: Any) -> dict[tuple[str, str, str], dict[str, Any]]:
    assert sheet.heads[: len(HEADS)] == HEADS
    return {line[:3]: dict(zip(sheet.heads, line, strict=True)) for line in sheet.lines}


def test_a_mutant_is_counted_once_for_all_its_runs(faults: dict[str, Fault]) -> None:
    frame = results(drive("a", HIT), drive("a", ACTIVE), drive("b", CHANGED), drive("c", {}))
    found = lines(mutation_score_sheet(frame, faults, GOLDEN))
    total = found["all", "mutants", "permanent"]
    assert (total["number"], total["not activated"], total["no effect"]) == (3, 1, 0)
    assert total["actuator changed"] == share_with_interval(2, 2)
    assert total["hazard"] == share_with_interval(1, 2)
    drives = found["all", "drives", "permanent"]
    assert (drives["number"], drives["not activated"], drives["no effect"]) == (4, 1, 1)
    assert (drives["hazard"].count, drives["hazard"].of) == (1, 3)
    assert found["pkg/radar.py::f", "mutants", "permanent"]["hazard"] == share_with_interval(1, 2)
    none = found["pkg/radar.py::g", "mutants", "permanent"]["hazard"]
    assert (none.count, none.of) == (0, 0)  # without an interval: its bounds are NaN, which equals nothing


def test_permanent_and_transient_mutants_have_separate_lines(faults: dict[str, Fault]) -> None:
    frame = results(drive("a", HIT), drive("a", ACTIVE, trigger="C1"), drive("b", ACTIVE, trigger="C1"))
    found = lines(mutation_score_sheet(frame, faults, GOLDEN))
    assert found["all", "mutants", "permanent"]["hazard"] == share_with_interval(1, 1)
    assert found["all", "mutants", "transient"]["hazard"] == share_with_interval(0, 2)
    assert found["all", "mutants", "either"]["hazard"] == share_with_interval(1, 2)
    assert not any(counted == "drives" for _, counted, _ in found)


def test_alerts_of_the_fault_free_run_are_not_attributed_to_a_mutant(faults: dict[str, Fault]) -> None:
    frame = results(
        drive("a", ACTIVE, alerts="own", t_alert="2.0"), drive("b", ACTIVE, alerts="own;brake", t_alert="2.0")
    )
    found = lines(mutation_score_sheet(frame, faults, GOLDEN))
    assert found["all", "mutants", "permanent"]["new alert"] == share_with_interval(1, 2)
    assert found["all", "mutants", "permanent"]["no effect"] == 1
    unknown = mutation_score_sheet(frame, faults, None)
    assert lines(unknown)["all", "mutants", "permanent"]["new alert"] is None
    assert "alerts are not compared" in unknown.note
    of_a_seed = {("S1", "1"): frozenset({"own", "brake"})}
    assert not mutant_effect_flags(frame, faults, of_a_seed)["new alert"].any()


def test_harness_errors_are_excluded_from_all_shares(faults: dict[str, Fault]) -> None:
    frame = results(
        drive("a", CHANGED),
        drive("b", {}, status="crashed"),
        drive("c", {}, status="harness_error"),
        drive("d", {}, status="invalid_mutant"),
    )
    sheet = mutation_score_sheet(frame, faults, GOLDEN, ["pkg/**: 4 of 9 mutants; left out: 5"])
    assert "Chosen: `pkg/**: 4 of 9 mutants; left out: 5`." in sheet.note
    total = lines(sheet)["all", "mutants", "permanent"]
    assert (total["number"], total["not activated"]) == (2, 0)
    assert total["crash or timeout"] == share_with_interval(1, 2)
    assert total["hazard"] == share_with_interval(0, 2)
    assert "Without a result, and therefore not counted: 2 of 4." in sheet.note


def test_the_note_warns_of_several_draws(faults: dict[str, Fault]) -> None:
    """The draws have different populations, and the overall share has no weights."""
    small, large = "a: 4 draws of 9 mutants of operators", "b: 4 draws of 900 mutants of operators"
    frame = results(drive("a", HIT))
    assert "without weights" in mutation_score_sheet(frame, faults, GOLDEN, [small, large]).note
    assert "without weights" not in mutation_score_sheet(frame, faults, GOLDEN, [small]).note


def test_scores_are_given_by_operator(faults: dict[str, Fault]) -> None:
    frame = results(drive("a", HIT), drive("b", ACTIVE, fault_type="branch"), {"fault_id": "x"} | HIT)
    found = lines(mutation_score_sheet(frame, faults, GOLDEN))
    assert found["arithmetic", "mutants", "permanent"]["hazard"] == share_with_interval(1, 1)
    assert found["branch", "mutants", "permanent"]["hazard"] == share_with_interval(0, 1)
    assert found["all", "mutants", "permanent"]["number"] == 2


def test_a_run_without_operators_has_no_score(faults: dict[str, Fault]) -> None:
    assert not mutation_score_sheet(results(HIT), {"a": replace(faults["a"], module="radar")}, GOLDEN).lines


def test_intervals_of_drives_resample_mutants(faults: dict[str, Fault]) -> None:
    frame = results(*(drive(name, HIT if name == "a" else ACTIVE) for name in "ab" for _ in range(10)))
    found = lines(mutation_score_sheet(frame, faults, GOLDEN))["all", "drives", "permanent"]["hazard"]
    assert (found.low, found.high) == (0.0, 1.0)
    alike = results(*(drive(name, HIT) for name in "ab" for _ in range(2)))
    told = lines(mutation_score_sheet(alike, faults, GOLDEN))["all", "drives", "permanent"]["hazard"]
    assert str(told) == "100.0 % (4/4)"


def test_a_sample_of_mutants_has_counts_but_no_rates(faults: dict[str, Fault]) -> None:
    frame = results(drive("a", HIT), drive("b", CHANGED), drive("c", {})).assign(weight=2.0)
    sheet = mutation_score_sheet(frame, faults, GOLDEN)
    assert str(lines(sheet)["all", "mutants", "permanent"]["hazard"]) == "- (1/2)"
    assert "are a sample" in sheet.note
