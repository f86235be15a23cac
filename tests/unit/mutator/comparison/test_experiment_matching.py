"""The matching of the experiments of two runs, and the reported changes."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.comparison.compared_runs import ComparedRun
from mutator.comparison.experiment_matching import ExperimentPair, ResultChangeKind, match_experiments
from mutator.model import Experiment, Method, Outcome, Status
from mutator.results.result_rows import ResultRow
from mutator.store.run_folder import RunFolder

Make = Callable[..., Experiment]


def row(experiment_id: str = "e", **given: Any) -> ResultRow:
    fields: dict[str, Any] = {
        "experiment_id": experiment_id,
        **dict.fromkeys(("kind", "variant", "value", "unit", "scenario", "scenario_label", "trigger"), "x"),
        "status": Status.OK,
        "outcome": Outcome.MASKED,
        "t_activation": 2.0,
        "t_manifest": None,
        "hazards": (),
        "alerts": (),
        "t_alert": None,
        "reaction_time": None,
        "detail": "",
    }
    fields |= given
    return ResultRow(ending=(fields["outcome"] or fields["status"]).value, **fields)


def side(*experiments: Experiment, without: tuple[Experiment, ...] = ()) -> ComparedRun:
    """Return a run with these experiments; those in `without` have not run."""
    rows = {e.id: row(e.id) for e in experiments if e not in without}
    return ComparedRun(folder=RunFolder(Path("run")), experiments=experiments, row_by_id=rows)


def test_experiments_are_matched_by_fault_scenario_and_trigger(experiment: Make) -> None:
    one = experiment(method=Method.RANDOM, trigger="random/C1")
    other = dataclasses.replace(
        one,
        fault=dataclasses.replace(one.fault, reading="as_coded"),
        trigger=dataclasses.replace(one.trigger, condition="t >= 3.0", armed_after_s=0.0),
        scenario_digest="e" * 64,
        seed=8,
        setting=("pictures",),
    )
    assert one.id != other.id
    [pair] = match_experiments(side(one), side(other)).pairs
    assert (pair.a, pair.b) == (one, other)


@pytest.mark.parametrize(
    "other",
    [
        {"value": 2.0},
        {"scenario": "S2"},
        {"trigger": "C2"},
        {"method": Method.RANDOM},
        {"spec": "radar/chaff/other"},
    ],
    ids=str,
)
def test_an_experiment_without_a_match_is_reported(experiment: Make, other: dict[str, Any]) -> None:
    a, b = experiment(), experiment(**other)
    found = match_experiments(side(a), side(b))
    assert (found.pairs, found.only_a, found.only_b) == ((), (a,), (b,))


def test_an_experiment_that_did_not_run_forms_no_pair(experiment: Make) -> None:
    a, b = experiment(value=1.0), experiment(value=2.0)
    found = match_experiments(side(a, b, without=(a,)), side(a, b, without=(b,)))
    assert (found.pairs, found.no_result_a, found.no_result_b) == ((), (a,), (b,))


def test_ambiguous_experiments_are_not_matched(experiment: Make) -> None:
    """Identical experiments are matched first, and others only if one is left on each side."""
    a = experiment()
    twin = dataclasses.replace(a, seed=8)
    third = dataclasses.replace(a, seed=9)
    found = match_experiments(side(a, twin), side(third))
    assert (found.pairs, found.ambiguous) == ((), (a, twin, third))
    found = match_experiments(side(a, twin), side(twin, third))
    assert [(p.a, p.b) for p in found.pairs] == [(a, third), (twin, twin)]
    assert match_experiments(side(a, twin), side(a, twin)).ambiguous == ()


HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H1", 5.0),)}
LATER = {"outcome": Outcome.HAZARD, "hazards": (("H1", 6.0),)}
OTHER = {"outcome": Outcome.HAZARD, "hazards": (("H1", 5.0), ("H2", 7.0))}
ALERT = {"alerts": ("fcw",), "t_alert": 3.0}
WARNED = HAZARD | ALERT
WARNED_LATE = HAZARD | {"alerts": ("fcw",), "t_alert": 5.0}
TWO_WARNED = OTHER | {"alerts": ("fcw",), "t_alert": 6.0}  # H1 silently, then H2 after an alert
IDLE = {"outcome": Outcome.NOT_ACTIVATED, "t_activation": None}
CRASH = {"status": Status.CRASHED, "outcome": None}
TIMEOUT = {"status": Status.TIMEOUT, "outcome": None}
BROKEN = {"status": Status.HARNESS_ERROR, "outcome": None, "t_activation": None}
REFUSED = {"status": Status.INVALID_MUTANT, "outcome": None, "t_activation": None}
SDC = {"outcome": Outcome.SDC, "t_manifest": 2.5}
GOLDEN_HAZARD = {"golden_class": "hazard_without_fault"}
LEFT_OUT = GOLDEN_HAZARD | {"status": Status.LEFT_OUT, "outcome": None, "t_activation": None}
NOT_JUDGED = GOLDEN_HAZARD | {"outcome": Outcome.NOT_JUDGED}


@pytest.mark.parametrize(
    ("a", "b", "changes"),
    [
        ({}, {}, ""),
        ({}, SDC, "worse"),
        (SDC, {}, "better"),
        ({}, IDLE, "otherwise"),
        (IDLE, HAZARD, "new-silent-hazard new-hazard worse"),
        (IDLE, WARNED, "new-hazard new-alert worse"),
        (WARNED, HAZARD, "new-silent-hazard lost-alert"),
        (WARNED, WARNED_LATE, "new-silent-hazard"),
        (WARNED | LATER, HAZARD, "new-silent-hazard lost-alert earlier-hazard"),
        (HAZARD, WARNED_LATE, "new-alert"),
        (HAZARD, TWO_WARNED, "other-hazard new-alert"),
        (TWO_WARNED, OTHER, "new-silent-hazard lost-alert"),
        (WARNED, SDC, "hazard-gone better"),
        (HAZARD, SDC, "hazard-gone better"),
        (HAZARD, LATER, "later-hazard"),
        (LATER, HAZARD, "earlier-hazard"),
        (HAZARD, LATER | {"t_activation": 3.0}, ""),
        (HAZARD, OTHER, "new-silent-hazard other-hazard"),
        (HAZARD | {"t_end": 5.0}, OTHER | {"t_end": 5.0}, "other-hazard"),
        (OTHER, HAZARD, ""),
        (ALERT, {}, "lost-alert"),
        ({}, ALERT, "new-alert"),
        (ALERT, ALERT | {"t_alert": 4.0}, ""),
        ({}, CRASH, "new-crash"),
        (CRASH, {}, "crash-gone"),
        (CRASH, TIMEOUT, "otherwise"),
        (HAZARD, CRASH, "new-crash hazard-gone"),
        ({}, BROKEN, "harness-error"),
        ({}, LEFT_OUT, "golden-hazard harness-error"),
        ({}, NOT_JUDGED, "golden-hazard harness-error"),
        ({}, GOLDEN_HAZARD, "golden-hazard"),
        (LEFT_OUT, {}, "golden-hazard-gone mended"),
        (LEFT_OUT, GOLDEN_HAZARD | HAZARD, "mended"),
        (REFUSED, HAZARD, "mended"),
        (BROKEN, REFUSED, ""),
    ],
)
def test_each_kind_of_change_is_reported(
    experiment: Make, a: dict[str, Any], b: dict[str, Any], changes: str
) -> None:
    """Times are compared relative to the activation. A hazard after the end of the drive is not silent."""
    e = experiment()
    pair = ExperimentPair(e, e, row(**a), row(**b))
    assert pair.change_kinds == {ResultChangeKind(name) for name in changes.split()}
    assert pair.is_usable == (not {"harness-error", "mended"} & set(changes.split()) and a != BROKEN)
