"""How executions become records, and which of them are harness errors."""

import json
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator._common.hashing import digest
from mutator.campaigns.plan import build_plan
from mutator.engines.engine_jobs import Job, JobResult, RunMode
from mutator.engines.fork_engine import ForkEngine
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.execution.experiment_runner import ExperimentRunner
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.limits import Limits
from mutator.model import (
    Anchor,
    AnchorKind,
    Experiment,
    Fault,
    FaultLocation,
    Injection,
    Method,
    ObservedActivation,
    Outcome,
    Record,
    Status,
)
from mutator.mutants.mutant_building import build
from mutator.outcomes import trace_files
from mutator.preflight.check_run_problems import output_digest_of
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_choices import Choices
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace

from ..fork_on_toy import Edit

T = np.arange(20) * 0.05
TRACE = "log.npz"
Outputs = dict[str, Any]


class PlayedEngine:
    """An engine that runs nothing and leaves the given outputs for every job."""

    def __init__(self, out: Path, status: Status, outputs: Outputs) -> None:
        self.out = out
        self.status = status
        self.outputs = outputs

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, JobResult]]:
        for job in jobs:
            self.out.mkdir(exist_ok=True)
            write(self.out, **self.outputs.get("trace", {}))
            if "said" in self.outputs:
                (self.out / "said.json").write_text(json.dumps(self.outputs["said"]))
            probe = {"mutant": job.mutant_id, "triggered": None, "injections": self.outputs.get("ran", {})}
            yield (
                job,
                JobResult(
                    status=self.status,
                    detail="" if self.status is Status.OK else "why",
                    out=self.out,
                    probe_report=probe,
                    cpu_s=1.0,
                    was_fault_active=bool(self.outputs.get("ran")),
                    wall_s=2.0,
                ),
            )


def write(out: Path, **channels: np.ndarray) -> None:
    if channels or not out.name.startswith("faulty"):
        quiet = {name: np.zeros(20) for name in ("gas", "brake", "wheel_turn")}
        with (out / TRACE).open("wb") as file:
            np.savez(file, **{"time": T, **quiet, **channels})


def write_golden(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    write(out)
    (out / "said.json").write_text(json.dumps({"hazards": {}, "alert_events": []}))


METRICS = """\
metrics:
  gas_apart: {max: abs(gas - golden.gas), unit: "-", worse: higher, about: difference of gas from golden}
"""


@pytest.fixture
def with_metrics(toycar: Workspace) -> None:
    with toycar.manifest("toycar").path.open("a") as file:
        file.write(METRICS)


@pytest.fixture
def judged(toycar: Workspace, tmp_path: Path) -> Callable[..., Record]:
    manifest = toycar.manifest("toycar")
    experiment = build_plan(toycar, "small", Choices(only='fault_type == "distance"', limit=1)).experiments[0]
    write_golden(tmp_path / "golden")

    def judge(status: Status = Status.OK, **outputs: Any) -> Record:
        outputs = {"said": {"hazards": {}, "alert_events": []}, "trace": {"gas": np.zeros(20)}} | outputs
        engine = PlayedEngine(tmp_path / "faulty", status, outputs)
        goldens = LoadedGoldens(manifest, lambda experiment: tmp_path / "golden")
        runner = ExperimentRunner(manifest, toycar.fault_models(), engine, goldens, toycar.scenario)
        (finished,) = runner.run([experiment])
        assert finished.experiment == experiment
        assert finished.record.experiment_id == experiment.id
        assert finished.mutant is not None
        assert finished.record.tree == finished.mutant.tree_digest
        return finished.record

    return judge


def stepped(row: int, height: float = 1.0) -> np.ndarray:
    return np.where(np.arange(20) >= row, height, 0.0)


RAN = {"a": {"first": 0.25, "last": 0.5, "count": 3}, "b": {"first": 0.2, "last": 0.4, "count": 2}}
NEVER = {"a": {"first": None, "last": None, "count": 0}}


def test_an_active_fault_without_an_effect_is_masked(judged: Callable[..., Record]) -> None:
    record = judged(ran=RAN)
    assert (record.status, record.outcome) == (Status.OK, Outcome.MASKED)
    assert record.activation == ObservedActivation(first=0.2, last=0.5, count=5)
    assert record.max_dev == (("gas", 0.0), ("brake", 0.0), ("wheel_turn", 0.0))


def test_a_difference_in_the_activation_step_is_sdc(judged: Callable[..., Record]) -> None:
    record = judged(ran=RAN, trace={"brake": stepped(4, 0.5)})
    assert (record.outcome, record.t_manifest) == (Outcome.SDC, T[4])
    assert dict(record.max_dev)["brake"] == 0.5


def test_hazards_and_alerts_after_the_activation_are_kept(judged: Callable[..., Record]) -> None:
    said = {
        "hazards": {"H1": 0.9, "H3": 0.3, "TOO_FAST": None},
        "alert_events": [{"name": "brake_hard", "t": t} for t in (0.1, 0.6, 0.7)] + [{"name": "x", "t": 0.5}],
    }
    record = judged(ran=RAN, trace={"gas": stepped(5)}, said=said)
    assert record.outcome is Outcome.HAZARD
    assert record.hazards == (("H3", 0.3), ("H1", 0.9))
    assert record.alerts == (("brake_hard", 0.6),)


def test_a_mutant_whose_fault_never_ran_is_not_activated(judged: Callable[..., Record]) -> None:
    assert judged(ran=NEVER).outcome is Outcome.NOT_ACTIVATED


@pytest.mark.parametrize(("ran", "told"), [(NEVER, "never active"), (RAN, "first active (0.2 s)")])
def test_a_difference_that_the_fault_cannot_cause_is_a_harness_error(
    judged: Callable[..., Record], ran: dict, told: str
) -> None:
    record = judged(ran=ran, trace={"gas": stepped(3)})
    assert (record.status, record.outcome) == (Status.HARNESS_ERROR, None)
    assert told in record.detail


@pytest.mark.parametrize("outputs", [{"trace": {}}, {"said": []}, {"trace": {"gas": np.zeros(3)}}])
def test_a_run_without_usable_outputs_is_a_crash_only_if_its_fault_was_active(
    judged: Callable[..., Record], outputs: Outputs
) -> None:
    record = judged(ran=RAN, **outputs)
    assert (record.status, record.outcome) == (Status.CRASHED, None)
    assert record.activation is not None
    assert record.detail.startswith(("log.npz: ", "said.json: "))
    assert "/" not in record.detail
    assert judged(ran=NEVER, **outputs).status is Status.HARNESS_ERROR


IMPORTER = """\
from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator.errors import BadTrace
from mutator.outcomes.trace_files import Importer

def read(request):
    arrays = TRACE_IMPORTER_DOOR.load("npz").read(request)
    if request.path.parent.name == "faulty":
        return RESULT
    return arrays

boom = Importer(about="", read=read)
"""


@pytest.fixture
def boom(
    toycar: Workspace, tmp_path: Path, install: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], None]:
    """Have the target's traces read by an importer of another package, whose result is an expression."""
    manifest = toycar.manifest("toycar").path
    manifest.write_text(manifest.read_text().replace("log.npz", "log.boom"))
    monkeypatch.setattr(sys.modules[__name__], "TRACE", "log.boom")

    def installed(result: str) -> None:
        (tmp_path / "rvtraces.py").write_text(IMPORTER.replace("RESULT", result))
        text = '[project]\nname = "rvtraces"\nversion = "0.3"\n[project.entry-points."mutator.importers"]\n'
        (tmp_path / "pyproject.toml").write_text(f'{text}boom = "rvtraces:boom"\n')
        monkeypatch.delitem(sys.modules, "rvtraces", raising=False)
        trace_files._importer_for.cache_clear()
        install(tmp_path)

    return installed


@pytest.mark.parametrize(
    ("result", "said"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("arrays['gass']", "KeyError: 'gass'"),
        ("arrays[b'a' * (1 << 60)]", "MemoryError"),
        ("None", "AttributeError: 'NoneType'"),
        ("{}", "TypeError: no array for brake, gas, time, wheel_turn"),
        ("{name: list(array) for name, array in arrays.items()}", "TypeError: no array for some channels"),
    ],
)
def test_a_failing_importer_of_another_package_never_makes_a_run_a_crash(
    result: str, said: str, boom: Callable[[str], None], request: pytest.FixtureRequest
) -> None:
    boom(result)
    record = request.getfixturevalue("judged")(ran=RAN)
    assert (record.status, record.outcome) == (Status.HARNESS_ERROR, None)
    assert f"importer 'boom' of package rvtraces 0.3 fails: {said}" in record.detail


def test_what_an_importer_of_another_package_says_of_a_run_is_judged_as_usual(
    boom: Callable[[str], None], request: pytest.FixtureRequest
) -> None:
    boom("exec('raise BadTrace(\"half\", \"whole\")') if arrays['gas'].any() else arrays")
    judged = request.getfixturevalue("judged")
    assert judged(ran=RAN).outcome is Outcome.MASKED
    assert judged(ran=RAN, trace={"gas": stepped(5)}).status is Status.CRASHED


@pytest.mark.parametrize(
    ("status", "kept"), [(Status.CRASHED, True), (Status.TIMEOUT, False), (Status.HARNESS_ERROR, False)]
)
def test_a_crash_keeps_its_activation_and_a_timeout_does_not(
    judged: Callable[..., Record], status: Status, kept: bool
) -> None:
    """The number of activations before a timeout depends on the machine's speed."""
    record = judged(status, ran=RAN)
    assert (record.status, record.outcome, record.detail) == (status, None, "why")
    assert (record.activation is not None) == kept


@pytest.mark.usefixtures("with_metrics")
def test_a_metric_compares_each_judged_run_with_its_golden_run(judged: Callable[..., Record]) -> None:
    values = [judged(ran=ran).metrics for ran in (RAN, NEVER)]
    assert values == [(("gas_apart", 0.0),)] * 2
    assert judged(ran=RAN, trace={"gas": stepped(5, 0.5)}).metrics == (("gas_apart", 0.5),)
    assert judged(Status.CRASHED, ran=RAN, trace={"gas": stepped(5, 0.5)}).metrics == ()


def test_mutants_that_cannot_be_built_are_not_run(toycar: Workspace, tmp_path: Path) -> None:
    manifest = toycar.manifest("toycar")
    experiments: tuple[Experiment, ...] = build_plan(toycar, "hostile").experiments
    engine = PlayedEngine(tmp_path / "faulty", Status.CRASHED, {"ran": RAN})
    write_golden(tmp_path)
    goldens = LoadedGoldens(manifest, lambda experiment: tmp_path)
    runner = ExperimentRunner(manifest, toycar.fault_models(), engine, goldens, toycar.scenario)
    records = {f.experiment.fault.fault_type: f.record for f in runner.run(experiments)}
    assert len(records) == len(experiments)
    assert records.pop("unsound").status is Status.INVALID_MUTANT
    assert {record.status for record in records.values()} == {Status.CRASHED}
    manifest = toycar.manifest("toycar")  # of which no mutant was built yet
    del manifest.tree.files["toycar/sensing.py"]  # type: ignore[attr-defined]
    runner = ExperimentRunner(manifest, toycar.fault_models(), engine, goldens, toycar.scenario)
    statuses = [f.record.status for f in runner.run(experiments[:1])]
    assert statuses == [Status.HARNESS_ERROR]


@pytest.mark.parametrize("change", ["before", "while it runs"])
def test_nothing_is_compared_with_a_changed_golden_run(
    toycar: Workspace, tmp_path: Path, change: str
) -> None:
    """A mutant can write to it, and put the bytes back."""
    manifest = toycar.manifest("toycar")
    experiment = build_plan(toycar, "small", Choices(only='fault_type == "distance"', limit=1)).experiments[0]
    place = tmp_path / "golden" / "A"
    write_golden(place)
    digests = {
        GoldenRun.for_experiment(experiment, several_seeds=False).key: output_digest_of(manifest, place)
    }
    said: Outputs = {"said": {"hazards": {}, "alert_events": []}, "trace": {"gas": np.zeros(20)}, "ran": RAN}

    class Changing(PlayedEngine):
        def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, JobResult]]:
            for job, execution in super().run(jobs):
                (place / "said.json").write_bytes((place / "said.json").read_bytes())
                yield job, execution

    kind = PlayedEngine if change == "before" else Changing
    engine = kind(tmp_path / "faulty", Status.OK, said)
    goldens = LoadedGoldens(manifest, lambda experiment: place, digests=digests)
    runner = ExperimentRunner(manifest, toycar.fault_models(), engine, goldens, toycar.scenario)
    if change == "before":
        (place / "said.json").write_text("{ }")
    with pytest.raises(MutatorError, match="changed while it was in use"):
        list(runner.run([experiment]))


def test_nothing_is_kept_of_a_run_with_a_changed_scenario(
    judged: Callable[..., Record], toycar: Workspace
) -> None:
    with toycar.scenario("A").open("a") as file:
        file.write("# another\n")
    with pytest.raises(MutatorError, match=r"A\.yaml: changed while it was in use"):
        judged(ran=RAN)


SUM = "self.speed + (3.0 * gas - 8.0 * brake) * STEP"
OBSERVED_CHANNEL = "  d_rel: {unit: m, role: truth, from: gap}\n"


@pytest.fixture
def with_observed_channel(toycar: Workspace) -> None:
    path = toycar.manifest("toycar").path
    path.write_text(path.read_text().replace("observation:\n", f"{OBSERVED_CHANNEL}observation:\n", 1))


@pytest.mark.usefixtures("with_observed_channel")
def test_an_observed_value_that_becomes_nan_ends_the_drive(
    toycar: Workspace, tmp_path: Path, judged: Callable[..., Record]
) -> None:
    """It is the target's crash, unless it came before the fault or the golden run has NaN there, too."""
    write(tmp_path / "golden", gap=np.zeros(20))
    record = judged(ran=RAN, trace={"gap": np.where(np.arange(20) < 7, 0.0, np.nan)})
    assert (record.status, record.outcome, record.metrics) == (Status.CRASHED, None, ())
    assert record.detail == "truth: d_rel is NaN at 0.35 s"
    assert record.t_end == pytest.approx(0.35)
    assert record.activation == ObservedActivation(first=0.2, last=0.5, count=5)
    early = judged(ran=RAN, trace={"gap": np.where(np.arange(20) < 3, 0.0, np.nan)})
    assert early.status is Status.HARNESS_ERROR
    assert early.detail.startswith("truth: d_rel is NaN at 0.15 s: ")
    assert early.t_end is None


@pytest.mark.usefixtures("with_observed_channel")
def test_both_engines_end_the_drive_at_the_same_nan(toycar: Workspace, tmp_path: Path, edit: Edit) -> None:
    edit("tree/toycar/world.py", "max(0.0, self.speed + (3.0 * gas - 8.0 * brake) * STEP)", SUM)
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    place = FaultLocation(
        path="toycar/driver.py",
        function="Driver.drive",
        anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name="gas"),
    )
    injection = Injection(location=place, model="nan", params=(("target", "gas"),))
    fault = Fault("s", "m", "f", "as_described", None, "", "H1", (injection,))
    scenario = toycar.scenario("A")
    experiment = Experiment(fault, "A", digest(scenario.read_bytes()), Method.GUIDED, trigger_at_time(1.0), 7)
    limits = Limits(cpu_s=20, wall_s=60, memory_mb=1024, steps=500)
    null = build(manifest, models, None, always_trigger())
    records = []
    for engine in (
        ReferenceEngine(manifest, tmp_path, limits),
        ForkEngine(manifest, tmp_path, limits, null_mutant=null),
    ):
        golden_job = Job(name="golden", scenario=scenario, seed=7)
        golden = ReferenceEngine(manifest, tmp_path, limits).execute(golden_job, tmp_path / f"{len(records)}")
        goldens = LoadedGoldens(manifest, lambda experiment, out=golden.out: out)  # type: ignore[misc]
        (finished,) = ExperimentRunner(manifest, models, engine, goldens, toycar.scenario).run([experiment])
        engine.close()
        records.append((finished.record, finished.mode))
    assert records[0][0] == records[1][0]
    assert [mode for _, mode in records] == [RunMode.REFERENCE, RunMode.FORK]
    assert (records[0][0].status, records[0][0].detail) == (
        Status.CRASHED,
        "truth: d_rel is NaN at 1.05 s",
    )
