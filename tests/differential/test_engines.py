"""The fork and warm engines give the reference engine's bytes for every fault and every way to end."""

import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import Engine, EngineArguments, Job, JobResult, RunMode
from mutator.engines.engine_kinds import ENGINES
from mutator.limits import Limits
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Hold, Injection, Status, Trigger, Value
from mutator.mutants.mutant_building import build
from mutator.mutants.parsed_files_and_anchors import parsed_file
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace

LIMITS = Limits(cpu_s=2, wall_s=60, memory_mb=1024, steps=500)
GAP = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="gap")
CLOSING = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="closing")
OFFSET = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="offset")
SENT = Anchor(kind=AnchorKind.BEFORE_CALL, name="self.publish")
PUBLISHED = Anchor(kind=AnchorKind.RESULT, name="self.publish")
GAP_VALUE = Anchor(kind=AnchorKind.ASSIGNED_VALUE, name="gap")
CLOSING_VALUE = Anchor(kind=AnchorKind.ASSIGNED_VALUE, name="closing")
GAS = Anchor(kind=AnchorKind.BEFORE_ASSIGN, name="gas")
AT_LEAST = Anchor(kind=AnchorKind.RESULT, name="max", nth=1)
WARNED = Anchor(kind=AnchorKind.AFTER_CALL, name="self.warned.append")
TOO_FAST = Anchor(kind=AnchorKind.CONDITION, name="speed > 30.0")
OF_DRIVER = (GAS, AT_LEAST, WARNED, TOO_FAST)

MODELS: dict[str, tuple[str, Anchor, dict[str, Value]]] = {
    "offset": ("offset", GAP, {"target": "gap", "by": 30.0, "low": 0.0}),
    "scale": ("scale", CLOSING, {"target": "closing", "factor": -0.5}),
    "stuck": ("stuck", OFFSET, {"target": "offset", "value": 0.7}),
    "held": ("stuck", GAP, {"target": "gap"}),
    "drift": ("drift", OFFSET, {"target": "offset", "per_step": 0.02, "stays": False}),
    "drift that stays": ("drift", OFFSET, {"target": "offset", "per_step": 0.02, "stays": True}),
    "noise": ("noise", GAP, {"target": "gap", "std": 9.0, "seed": 5}),
    "omission": ("omission", SENT, {}),
    "delay": ("delay", GAP, {"target": "gap", "delay": 1.0}),
    "ghost_object": (
        "ghost_object",
        CLOSING,
        {"distance_name": "gap", "speed_name": "closing", "distance": 9.0, "speed": -1.0},
    ),
    "bit_flip": ("bit_flip", OFFSET, {"target": "offset", "bit": 62}),
    "clamp": ("clamp", GAP, {"target": "gap", "high": 20.0}),
    "infinity": ("infinity", GAP_VALUE, {}),
    "nan": ("nan", OFFSET, {"target": "offset"}),
    "none": ("none", PUBLISHED, {}),
    "quantise": ("quantise", GAP_VALUE, {"step": 7.0}),
    "reordering": ("reordering", GAS, {}),
    "repetition": ("repetition", WARNED, {}),
    "sign_flip": ("sign_flip", CLOSING_VALUE, {}),
    "slow_call": ("slow_call", AT_LEAST, {"duration": 0.33}),
    "stale": ("stale", CLOSING_VALUE, {"steps": 9}),
    "swapped_arguments": ("swapped_arguments", AT_LEAST, {"first": 1, "second": 2}),
    "unit_mix_up": ("unit_mix_up", GAP_VALUE, {"written_in": "kph", "read_as": "mps"}),
    "waveform": (
        "waveform",
        OFFSET,
        {"target": "offset", "by": 0.8, "shape": "alternating", "period": 1.0, "seed": 1},
    ),
    "bounded noise": ("waveform", GAP_VALUE, {"by": 9.0, "shape": "noise", "low": 0.0, "seed": 5}),
    "wrong_branch": ("wrong_branch", TOO_FAST, {"holds": "always"}),
    "image_effect": (
        "image_effect",
        GAP,
        {
            "target": "gap",
            "effect": "toycar.haze.Haze",
            "amount": 20.0,
            "camera": "self",
            "scene": "world",
            "seed": 3,
        },
    ),
}
ENDS = ("crash", "hang", "hoard", "leave", "segfault")
TRIGGERS = {
    "always": always_trigger(),
    "from 2.01 s": trigger_at_time(2.01),
    "for 1 s": trigger_at_time(3.0, hold_s=1.0),
    "in a context": Trigger(name="x", condition="hwt < 1.915 and rs > 0.0", armed_after_s=1.0),
    "once in a context": Trigger(name="x", condition="hwt < 1.915", hold=Hold.TO_END, armed_after_s=1.0),
    "off and on": Trigger(name="x", condition="v_ego > 18.5 or v_ego < 17.5"),
    "never": Trigger(name="x", condition="d_rel < -5.0"),
}


def fault(model: str, anchor: Anchor, params: dict[str, Value]) -> Fault:
    in_driver = anchor in OF_DRIVER
    path, function = ("driver", "Driver.drive") if in_driver else ("sensing", "Sensor.sense")
    place = FaultLocation(path=f"toycar/{path}.py", function=function, anchor=anchor)
    return fault_at(place, model, params)


class Engines:
    def __init__(self, toy: Workspace, folder: Path, limits: Limits = LIMITS) -> None:
        self.toy = toy
        self.folder = folder
        self.manifest = toy.manifest("toycar")
        self.models = toy.fault_models()
        self.limits = limits
        self.made: dict[str, Any] = {}
        for name in ENGINES:
            work = folder / name
            work.mkdir()
            self.made[name] = make_engine(
                name,
                EngineArguments(manifest=self.manifest, models=self.models, work_folder=work, limits=limits),
            )
        self._goldens: dict[str, Path] = {}

    def close(self) -> None:
        for engine in self.made.values():
            engine.close()

    def golden(self, scenario: str) -> Path:
        if scenario not in self._goldens:
            job = Job(name="golden", scenario=self.toy.scenario(scenario), seed=7)
            execution = self.made["reference"].execute(job, self.folder / f"golden-{scenario}")
            self._goldens[scenario] = execution.out
        return self._goldens[scenario]

    def job(self, fault: Fault | None, trigger: Trigger, scenario: str = "A") -> Job:
        built = build(self.manifest, self.models, fault, trigger)
        return Job(
            name="job",
            scenario=self.toy.scenario(scenario),
            seed=7,
            changed_files=built.files,
            mutant_id=built.id,
            probe_source=built.probe_source,
            injection_ids=built.injection_ids,
            golden_folder=self.golden(scenario),
        )

    def run(self, name: str, job: Job) -> tuple[JobResult, dict[str, bytes]]:
        ((_, execution),) = [
            (job, replace(done, log_tail=done.log_tail)) for job, done in self._kept(self.made[name], [job])
        ]
        files = {path.name: path.read_bytes() for path in execution.out.iterdir()}
        return execution, files

    def _kept(self, engine: Engine, jobs: Sequence[Job]) -> Iterator[tuple[Job, JobResult]]:
        for job, execution in engine.run(jobs):
            kept = self.folder / "kept"
            shutil.rmtree(kept, ignore_errors=True)
            shutil.copytree(execution.out, kept)
            yield job, replace(execution, out=kept)


@pytest.fixture(scope="module")
def three(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Iterator[Engines]:
    folder = tmp_path_factory.mktemp("engines")
    made = Engines(copy_toycar(folder), folder)
    yield made
    made.close()


def values(three: Engines, path: str) -> list[FaultLocation]:
    found, seen = [], Counter[tuple[str, AnchorKind, str, str | None]]()
    for function, known in parsed_file(three.manifest.tree, path).expressions_by_function.items():
        for kind, name, which in (role for one in known for role in dict.fromkeys(one.roles)):
            seen[function, kind, name, which] += 1
            anchor = Anchor(kind=kind, name=name, which=which, nth=seen[function, kind, name, which])
            found.append(FaultLocation(path=path, function=function, anchor=anchor))
    return found


def fault_at(place: FaultLocation, model: str, params: dict[str, Value]) -> Fault:
    injection = Injection(location=place, model=model, params=tuple(sorted(params.items())))
    return Fault("s", "m", "f", "as_described", None, "", "H1", (injection,))


def check_same(three: Engines, job: Job, how: RunMode | None = None) -> JobResult:
    """Check that status, messages, probe report and files equal the reference engine's. Return the fork
    engine's execution."""
    expected, files = three.run("reference", job)
    for name in ("warm", "fork"):
        execution, found = three.run(name, job)
        assert (execution.status, execution.detail) == (expected.status, expected.detail)
        if expected.status is Status.OK:
            assert execution.probe_report is not None
            assert expected.probe_report is not None
            never = all(not told["count"] for told in expected.probe_report["injections"].values())
            assert (
                never
                if execution.mode is RunMode.GOLDEN_REUSED
                else execution.probe_report == expected.probe_report
            )
            assert found == files
    if how is not None:
        assert (execution.mode, execution.fallback_reason) == (how, "")
    return execution


@pytest.mark.parametrize("model", ["offset", "omission", "image_effect", "reordering", "slow_call"])
def test_a_fault_in_a_context_is_forked(three: Engines, model: str) -> None:
    execution = check_same(three, three.job(fault(*MODELS[model]), TRIGGERS["in a context"]), RunMode.FORK)
    assert execution.fork_step > 20


@pytest.mark.slow
@pytest.mark.parametrize("trigger", TRIGGERS)
@pytest.mark.parametrize("model", MODELS)
def test_engines_agree_on_every_model_under_every_trigger(three: Engines, model: str, trigger: str) -> None:
    how = RunMode.GOLDEN_REUSED if trigger == "never" else RunMode.FORK
    for scenario in ("A", "B"):
        check_same(
            three,
            three.job(fault(*MODELS[model]), TRIGGERS[trigger], scenario),
            how if scenario == "A" else None,
        )


def test_a_changed_value_is_forked(three: Engines) -> None:
    anchor = Anchor(kind=AnchorKind.ASSIGNED_VALUE, name="closing")
    place = FaultLocation(path="toycar/sensing.py", function="Sensor.sense", anchor=anchor)
    check_same(
        three, three.job(fault_at(place, "offset", {"by": -4.0}), TRIGGERS["in a context"]), RunMode.FORK
    )


@pytest.mark.slow
@pytest.mark.parametrize("trigger", ["always", "for 1 s", "off and on"])
@pytest.mark.parametrize("path", ["toycar/sensing.py", "toycar/driver.py"])
def test_engines_agree_on_every_value_under_some_triggers(three: Engines, path: str, trigger: str) -> None:
    places = values(three, path)
    assert len(places) > 10
    changes: tuple[tuple[str, dict[str, Value]], ...] = (
        ("stuck", {"value": 0.5}),
        ("offset", {"by": 2.0}),
        ("delay", {"delay": 0.7}),
    )
    for number, place in enumerate(places):
        check_same(three, three.job(fault_at(place, *changes[number % 3]), TRIGGERS[trigger]))


@pytest.mark.slow
@pytest.mark.parametrize("model", ENDS)
def test_every_bad_ending_has_the_same_message(three: Engines, model: str) -> None:
    execution = check_same(three, three.job(fault(model, GAP, {"target": "gap"}), TRIGGERS["from 2.01 s"]))
    assert execution.status is (Status.TIMEOUT if model == "hang" else Status.CRASHED)
    check_same(three, three.job(fault(*MODELS["offset"]), TRIGGERS["from 2.01 s"]), RunMode.FORK)


def test_the_reference_engine_reruns_a_crash(three: Engines) -> None:
    job = three.job(fault("crash", GAP, {"target": "gap"}), TRIGGERS["from 2.01 s"])
    execution, _ = three.run("fork", job)
    assert (execution.status, execution.mode) == (Status.CRASHED, RunMode.REFERENCE)
    assert execution.detail == "IndexError: list index out of range (toycar/sensing.py:11)"
    assert execution.fallback_reason == "ended as crashed: IndexError: list index out of range"
    execution, _ = three.run("fork", three.job(fault(*MODELS["offset"]), TRIGGERS["from 2.01 s"]))
    assert (execution.mode, execution.status) == (RunMode.FORK, Status.OK)


def test_a_run_beyond_the_step_limit_times_out(
    tmp_path: Path, copy_toycar: Callable[[Path], Workspace]
) -> None:
    few = Engines(copy_toycar(tmp_path), tmp_path, replace(LIMITS, steps=100))
    try:
        job = few.job(fault(*MODELS["offset"]), TRIGGERS["from 2.01 s"])
        told = [few.run(name, job)[0] for name in ("reference", "warm")]
        assert {(e.status, e.detail) for e in told} == {(Status.TIMEOUT, "limit of 100 simulation steps")}
    finally:
        few.close()
