"""An audit finds records whose fields contradict each other."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.audit.record_audit import StoredRecord, proof_problems, verdict_problems
from mutator.model import ObservedActivation, Outcome, Record, Status
from mutator.preflight import equivalence_check
from mutator.store.run_folder import RunFolder
from mutator.targets.channels import Channel, Role
from mutator.targets.stored_target_facts import ChannelFacts
from mutator.workspace import Workspace
from tests.made_head import HEAD as MADE_UP

CHANNELS = tuple(ChannelFacts(name, "-", Role.INTERNAL, "", "") for name in ("gas", "brake", "seen"))
HEAD = replace(MADE_UP, hazards=("H1", "H3"), compared=("gas", "brake"), channels=CHANNELS)
MANIFEST: Any = SimpleNamespace(
    compared_channels=[Channel(name="gas", unit="-"), Channel(name="brake", unit="-", tolerance=0.5)]
)
MakeRecord = Callable[..., Record]
FINE = {"max_dev": (("gas", 0.0), ("brake", 0.25)), "trace_digest": "f" * 64}
BAD_END = {"outcome": None, "activation": None, "max_dev": (), "trace_digest": ""}


def flaws(record: Record) -> list[str]:
    return [str(one) for one in verdict_problems(HEAD, [StoredRecord(Path("r.jsonl"), 7, record)], MANIFEST)]


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"left": (("gas", 2.5, 1.0),), "t_manifest": 2.5, "outcome": Outcome.SDC}, ""),
        ({"left": (("seen", 2.5, 1.0),)}, ""),
        ({"left": (), "t_manifest": 2.5, "t_end": 2.4, "outcome": Outcome.SDC}, ""),
        ({"left": (("spare", 2.5, 1.0),)}, "channel spare left golden; expected one of gas, brake, seen"),
        (
            {"left": (("seen", 2.5, 1.0),), "t_end": 2.4},
            "seen left golden at 2.5 s; expected a time up to the end",
        ),
        ({"left": (), "t_manifest": 2.5, "outcome": Outcome.SDC}, "actuators left golden at no time"),
        ({"left": (("gas", 2.5, 1.0),)}, "actuators left golden at [2.5]; expected at no time, as recorded"),
    ],
)
def test_deviations_must_fit_the_target_and_the_drive(
    record: MakeRecord, fields: dict[str, Any], told: str
) -> None:
    found = flaws(record(**FINE | fields))
    assert (len(found) == 1 and told in found[0]) if told else not found


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"outcome": Outcome.NOT_ACTIVATED, "activation": None},
        {"outcome": Outcome.SDC, "t_manifest": 2.0, "left": (("gas", 2.0, 1.0),)},
        {"outcome": Outcome.HAZARD, "hazards": (("H3", 2.5),), "alerts": (("fcw", 2.0), ("lane", 2.0))},
        BAD_END | {"status": Status.TIMEOUT, "detail": "stopped"},
        BAD_END | {"status": Status.CRASHED, "activation": ObservedActivation(first=2.0, last=3.0, count=5)},
        BAD_END | {"status": Status.CRASHED, "detail": "truth: gap is NaN at 2.5 s", "t_end": 2.5},
    ],
)
def test_a_valid_record_is_not_reported(record: MakeRecord, fields: dict[str, Any]) -> None:
    assert flaws(record(**FINE | fields)) == []


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"outcome": Outcome.SDC}, "outcome sdc; expected masked, which follows from the recorded times"),
        ({"hazards": (("H1", 2.5),)}, "outcome masked; expected hazard"),
        ({"outcome": Outcome.NOT_ACTIVATED}, "outcome not_activated; expected masked"),
        ({"outcome": Outcome.SDC, "t_manifest": 1.5}, "manifested at 1.5 s; expected a time at or after"),
        ({"outcome": Outcome.HAZARD, "hazards": (("H1", 1.0),)}, "hazards"),
        ({"outcome": Outcome.HAZARD, "hazards": (("H1", 4.0), ("H3", 3.0))}, "hazards"),
        ({"outcome": Outcome.HAZARD, "hazards": (("H9", 4.0),)}, "hazard H9; expected one of H1, H3"),
        ({"alerts": (("fcw", 2.5), ("fcw", 3.0))}, "alerts"),
        ({"outcome": Outcome.NOT_ACTIVATED, "activation": None, "alerts": (("fcw", 2.5),)}, "alerts"),
        (
            {"activation": ObservedActivation(first=3.0, last=2.0, count=5)},
            "active 5 times, from 3.0 s to 2.0 s",
        ),
        ({"activation": ObservedActivation(first=2.0, last=3.0, count=0)}, "active 0 times, from 2.0 s"),
        ({"trace_digest": ""}, "trace digest ''"),
        ({"max_dev": (("gas", 0.0),)}, "differences of gas; expected those of gas, brake"),
        ({"max_dev": (("gas", 0.1), ("brake", 0.0))}, "gas differs, but no manifestation is recorded"),
        (BAD_END | {"status": Status.CRASHED, "outcome": Outcome.SDC}, "outcome sdc; expected none, because"),
        (BAD_END | {"status": Status.TIMEOUT, "trace_digest": "f"}, "trace_digest f; expected none"),
        (
            BAD_END | {"status": Status.CRASHED, "detail": "ValueError", "t_end": 2.5},
            "t_end 2.5; expected none",
        ),
    ],
)
def test_contradictions_are_reported_with_their_line(
    record: MakeRecord, fields: dict[str, Any], told: str
) -> None:
    found = flaws(record(**FINE | fields))
    assert any(f"r.jsonl:7: {'e' * 16}: {told}" in text for text in found), found


def test_a_record_outside_of_the_sample_of_a_small_run_is_reported(
    toycar: Workspace, tmp_path: Path, write_finished: Callable[..., Path]
) -> None:
    """The plan decides what is proved. Only a proof of all experiments, as made earlier, has more."""
    folder = RunFolder.open_unverified(write_finished(toycar, tmp_path / "run"))
    stored = [StoredRecord(Path("r.jsonl"), 7, record) for record in folder.records().values()]
    sample = equivalence_check.sample_ids_in_folder(folder)
    proven = [one for one in stored if one.record.experiment_id in sample]
    foreign = next(one for one in stored if one not in proven)
    assert len(proven) < len(stored) - 1 < equivalence_check.SMALL_PLAN_SIZE
    assert not [*proof_problems(folder, stored, proven)]
    assert not [*proof_problems(folder, stored, stored)]
    (problem,) = proof_problems(folder, stored, [*proven, foreign])
    assert "only experiments of the sample that the plan determines" in str(problem)
