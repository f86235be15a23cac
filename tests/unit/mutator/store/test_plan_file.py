"""The frozen plan on disk, and plans that other versions wrote."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common.hashing import canonical
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment, Hold
from mutator.store import plan_file
from mutator.store.plan_lines import experiment_as_written

Make = Callable[..., Experiment]


def lines(run: Path, name: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in (run / "plan" / name).read_text().splitlines()]


def test_a_plan_is_read_as_written(experiment: Make, tmp_path: Path) -> None:
    plan = tuple(experiment(value, changes=("no_lead",)) for value in (1.0, 2.5, 3.0))
    chunks = plan_file.write(tmp_path, plan, (2, 1))
    faults = plan_file.read_faults(tmp_path)
    assert plan_file.read_all(tmp_path) == plan
    assert plan_file.read_chunk(tmp_path, chunks[1], faults) == plan[2:]
    assert [*plan_file.ids(tmp_path)] == [e.id for e in plan]


def test_a_line_in_the_usual_format_is_read_fast(experiment: Make) -> None:
    """Any other line takes the slow path."""
    for planned in (
        experiment(),
        experiment(2.5, changes=("no_lead",)),
        replace(experiment(), setting=("a", "b")),
    ):
        faults = {planned.fault.id: planned.fault}
        line = canonical(plan_file.to_plain(planned)).encode() + b"\n"
        found = experiment_as_written(line, faults)
        assert found == plan_file.experiment_from(json.loads(line), faults) == planned
        assert found.id == planned.id and "id" in vars(found)
        for old, new in (
            (b'"seed":', b'"seed":1'),
            (b'"method":', b'"method": '),
            (b"hwt <=", b"hwt <"),
            (b'"name":', b'"Name":'),
        ):
            assert old in line and experiment_as_written(line.replace(old, new), faults) is None
        assert experiment_as_written(line, {}) is None
    stopping = canonical(plan_file.to_plain(replace(planned, after_hazard=AfterHazard.STOP))).encode()
    assert experiment_as_written(stopping, faults) is None


def test_a_missing_field_of_an_older_plan_has_its_default(experiment: Make) -> None:
    planned = experiment()
    planned = replace(planned, trigger=replace(planned.trigger, armed_after_s=0.0))
    line = plan_file.to_plain(planned)
    del line["trigger"]["armed_after_s"], line["trigger"]["hold_s"]
    read = plan_file.experiment_from(line, {planned.fault.id: planned.fault})
    assert (read.trigger.armed_after_s, read.trigger.hold_s, read.trigger.hold) == (0.0, None, Hold.WHILE)


def test_a_pipe_in_place_of_a_plan_is_refused(tmp_path: Path) -> None:
    """Opening a pipe would wait forever for a writer."""
    (tmp_path / "plan").mkdir()
    os.mkfifo(tmp_path / plan_file.EXPERIMENTS)
    with pytest.raises(MutatorError, match=r"experiments\.jsonl: cannot be read"):
        list(plan_file.ids(tmp_path))


@pytest.mark.parametrize("where", ["experiment", "trigger", "fault", "injection", "anchor"])
def test_an_unknown_field_of_a_newer_plan_is_refused(experiment: Make, tmp_path: Path, where: str) -> None:
    """An unknown field could change the experiment."""
    plan_file.write(tmp_path, [experiment()], [1])
    [fault], [line] = lines(tmp_path, "faults.jsonl"), lines(tmp_path, "experiments.jsonl")
    injection = fault["injections"][0]  # type: ignore[index]
    places = {"experiment": line, "trigger": line["trigger"], "fault": fault, "injection": injection}
    places["anchor"] = injection["location"]["anchor"]
    places[where]["repeat"] = 2  # type: ignore[index]
    with pytest.raises(MutatorError, match=f"{where} has 'repeat', .* does not know"):
        known = plan_file.fault_from(fault)
        plan_file.experiment_from(line, {line["fault"]: known})  # type: ignore[dict-item]
