"""The cells of a row of the results table."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.model import Experiment, Method, Outcome, Record, Status
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.severity_and_sentence_columns import severity_and_time_columns
from mutator.results.table_columns import cells_by_column, result_columns
from mutator.targets.hazard_severity import SeverityScale

HAZARDS = ("H1", "H2", "H3")
COLUMNS = result_columns(
    HAZARDS, ("gas", "brake", "steer_torque"), (), severity_and_time_columns(has_classes=True)
)
MakeRecord = Callable[..., Record]


def row_of(experiment: Experiment, record: Record, scale: SeverityScale | None = None) -> dict[str, object]:
    cells = cells_by_column(COLUMNS, [FinishedExperiment(experiment, record, scale)])
    return {column.name: cell for column, (cell,) in zip(COLUMNS, cells, strict=True)}


def test_the_row_of_a_run_with_a_hazard_has_the_expected_cells(
    experiment: Callable[..., Experiment], record: MakeRecord
) -> None:
    one = experiment(24, method=Method.RANDOM, trigger="random/C2")
    kept = record(
        one.id,
        outcome=Outcome.HAZARD,
        t_manifest=0.35000000000000003,
        hazards=(("H3", 5.13), ("H1", 7.0)),
        alerts=(("steer_saturated", 3.02), ("fcw", 6.0)),
        max_dev=(("gas", 0.1), ("brake", 0.0), ("steer_torque", 1.5)),
    )
    cells = row_of(one, kept)
    expected = {
        "value": 24,
        "unit": "m",
        "method": "random",
        "trigger": "random/C2",
        "status": "ok",
        "outcome": "hazard",
        "activated": 1,
        "t_activation": 2.0,
        "activations": 5,
        "manifested": 1,
        "t_manifest": 0.35,
        "h1": 1,
        "t_h1": 7.0,
        "h2": 0,
        "t_h2": None,
        "h3": 1,
        "t_h3": 5.13,
        "alerts": "steer_saturated;fcw",
        "t_alert": 3.02,
        "reaction_time": 2.11,
        "max_dev_gas": 0.1,
        "max_dev_brake": 0.0,
        "max_dev_steer": 1.5,
        "condition": "t >= 2.0",
        "variant": "distance",
        "aim": "H1",
        "detail": None,
    }
    assert {name: cells[name] for name in expected} == expected


SCALE = SeverityScale(
    name="x",
    about="",
    source="",
    classes=(("S0", 0.0, ""), ("S1", 1.0, ""), ("S2", 5.0, ""), ("S3", 11.0, "")),
)


@pytest.mark.parametrize(
    ("given", "severity", "tolerant", "after_manifest"),
    [
        ({}, "S2", 3.5, 3.25),
        ({"metrics": (("delta_v", 0.0),)}, "S0", 3.5, 3.25),
        ({"metrics": (("delta_v", 11.0),)}, "S3", 3.5, 3.25),  # the limit belongs to the higher class
        ({"metrics": ()}, None, 3.5, 3.25),  # no contact
        ({"t_end": 1.5}, None, 3.5, 3.25),  # a contact before the fault was active
        ({"t_manifest": 6.0}, "S2", 3.5, None),  # the hazard came before the manifestation
        ({"t_manifest": None}, "S2", 3.5, None),
        ({"hazards": (), "outcome": Outcome.SDC, "metrics": ()}, None, None, None),
    ],
)
def test_a_row_has_the_severity_and_the_times_to_the_hazard(
    experiment: Callable[..., Experiment],
    record: MakeRecord,
    given: dict[str, object],
    severity: str | None,
    tolerant: float | None,
    after_manifest: float | None,
) -> None:
    """The fault is activated at 2 s."""
    hit = {"outcome": Outcome.HAZARD, "t_manifest": 2.25, "t_end": 5.5, "metrics": (("delta_v", 5.5),)}
    kept = record(**hit | {"hazards": (("H1", 5.5), ("H2", 7.0))} | given)
    cells = row_of(experiment(), kept, SCALE)
    told = (cells["severity"], cells["time_to_hazard"], cells["manifest_to_hazard"])
    assert told == (severity, tolerant, after_manifest)
    assert row_of(experiment(), kept)["severity"] is None  # without a scale


def test_a_hazard_without_a_class_says_why(experiment: Callable[..., Experiment], record: MakeRecord) -> None:
    """The reason names the hazard; there is none with a class, and none without a hazard."""
    scale = replace(SCALE, contact="H1")
    reasons = {
        (("H1", 5.5), ("H2", 7.0)): None,
        (("H2", 5.0),): "the scale `x` has no rule for H2",
        (("H2", 7.0),): "H2 came after the end of the drive",
        (): None,
    }
    for hazards, reason in reasons.items():
        metrics = (("delta_v", 5.5),) if reason is None else ()
        cells = row_of(experiment(), record(hazards=hazards, t_end=5.5, metrics=metrics), scale)
        assert cells["no_severity"] == reason


def test_a_scale_determines_the_columns_of_severity() -> None:
    times = ["time_to_hazard", "manifest_to_hazard"]
    for has_classes, names in (
        (True, ["severity", "severity_hazard", "no_severity", *times]),
        (False, times),
    ):
        severity = severity_and_time_columns(has_classes=has_classes)
        columns = [c.name for c in result_columns(("H1",), ("gas",), (), severity)]
        assert columns[columns.index("max_dev_gas") + 1 : columns.index("variant")] == names
    assert typed_value_from_json(SeverityScale, as_json_types(SCALE)) == SCALE
    with pytest.raises(ValueError, match="no class of severity begins at 0"):
        replace(SCALE, classes=SCALE.classes[1:])


@pytest.mark.parametrize(
    ("status", "activation", "activated"),
    [
        (Status.CRASHED, True, 1),
        (Status.CRASHED, False, None),
        (Status.TIMEOUT, False, None),
        (Status.INVALID_MUTANT, False, None),
        (Status.HARNESS_ERROR, False, None),
    ],
)
def test_unknown_values_of_a_failed_run_are_empty(
    experiment: Callable[..., Experiment],
    record: MakeRecord,
    status: Status,
    activation: bool,
    activated: int | None,
) -> None:
    given = {} if activation else {"activation": None}
    failed = record(status=status, outcome=None, detail="why", max_dev=(), **given)
    cells = row_of(experiment(), failed)
    assert (cells["status"], cells["activated"], cells["detail"]) == (status.value, activated, "why")
    for name in ("outcome", "manifested", "t_manifest", "h1", "h2", "h3", "alerts", "reaction_time"):
        assert cells[name] is None


def test_flags_and_counts_of_a_run_without_activation_are_zero(
    experiment: Callable[..., Experiment], record: MakeRecord
) -> None:
    cells = row_of(experiment(), record(outcome=Outcome.NOT_ACTIVATED, activation=None))
    assert (cells["activated"], cells["activations"], cells["manifested"], cells["h1"]) == (0, 0, 0, 0)
    assert cells["t_activation"] is None
