"""Every engine gives the same reason why a run did not end normally."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from mutator._common.hashing import digest
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import Engine, EngineArguments, Job
from mutator.engines.engine_kinds import ENGINES
from mutator.engines.reference_engine import ReferenceEngine
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
    Record,
    Status,
    Trigger,
    Value,
)
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

from .moods import EDITS, MODEL, MODELS, MOODS

SEED = 7
GAP = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="gap")
SEEN = Anchor(kind=AnchorKind.BEFORE_ASSIGN, name="self.seen")
FROM_2_S = trigger_at_time(2.0)
IN_ONE_STEP = Trigger(name="x", condition="t > 1.97 and t < 2.02")
FIRST_ACTIVE_S = 2.0


def prepare(toy: Workspace) -> None:
    tree = toy.library.parent / "tree" / "toycar"
    (tree / "moods.py").write_text(MOODS)
    for name, pairs in EDITS.items():
        text = (tree / name).read_text()
        for old, new in pairs:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        (tree / name).write_text(text)
    case = toy.scenario("A").read_text()
    for name, more in {"careful": "careful: 1", **{f"early{n}": f"early: {n}" for n in range(4)}}.items():
        toy.scenario("A").with_stem(name).write_text(f"{case}{more}\n")
    for name, (line, more) in MODELS.items():
        (toy.templates / f"{name}.yaml").write_text(MODEL.format(name=name, more=more))
        (toy.templates / f"{name}.py.j2").write_text(f'if _fi.active("{{{{ fi }}}}"):\n    {line}\n')


def at_gap(model: str, **params: Value) -> Fault:
    return fault(Injection(location=at(GAP), model=model, params=(*params.items(), ("target", "gap"))))


def fault(*injections: Injection) -> Fault:
    return Fault("s", "m", "f", "as_described", None, "", "H1", injections)


def at(anchor: Anchor) -> FaultLocation:
    return FaultLocation(path="toycar/sensing.py", function="Sensor.sense", anchor=anchor)


def sensed(mood: str | None) -> Fault:
    return at_gap("stuck", value=mood)


class Blamed:
    def __init__(self, toy: Workspace, folder: Path) -> None:
        prepare(toy)
        self.toy = toy
        self.folder = folder
        self.manifest = toy.manifest("toycar")
        self.models = toy.fault_models()
        limits = Limits(cpu_s=1, wall_s=900, memory_mb=1024, steps=500)
        self.reference = ReferenceEngine(self.manifest, folder, limits)
        self.goldens: dict[str, Path] = {}  # by scenario
        self.engines: dict[str, Engine] = {}
        for name in ENGINES:
            work = folder / name
            work.mkdir()
            setting = EngineArguments(
                manifest=self.manifest, models=self.models, work_folder=work, limits=limits
            )
            self.engines[name] = make_engine(name, setting)

    def golden(self, experiment: Experiment) -> Path:
        scenario = experiment.scenario
        if scenario not in self.goldens:
            job = Job(name="g", scenario=self.toy.scenario(scenario), seed=SEED)
            self.goldens[scenario] = self.reference.execute(job, self.folder / f"golden-{scenario}").out
        return self.goldens[scenario]

    def experiment(self, fault: Fault, trigger: Trigger = FROM_2_S, scenario: str = "A") -> Experiment:
        return Experiment(
            fault=fault,
            scenario=scenario,
            scenario_digest=digest(self.toy.scenario(scenario).read_bytes()),
            method=Method.GUIDED,
            trigger=trigger,
            seed=SEED,
        )

    def run(self, engine: str, experiments: Sequence[Experiment]) -> list[Record]:
        goldens = LoadedGoldens(self.manifest, self.golden)
        runner = ExperimentRunner(
            self.manifest, self.models, self.engines[engine], goldens, self.toy.scenario
        )
        return [finished.record for finished in runner.run(experiments)]

    def record(self, fault: Fault, trigger: Trigger = FROM_2_S, scenario: str = "A") -> Record:
        experiment = self.experiment(fault, trigger, scenario)
        reference, *others = [record for name in ENGINES for record in self.run(name, [experiment])]
        assert others == [reference, reference]
        return reference

    def line(self, place: str) -> str:
        """Return the line of the target's own file."""
        path, _, number = place.partition(":")
        return self.manifest.tree.files[path].decode().splitlines()[int(number) - 1].strip()


@pytest.fixture(scope="module")
def blamed(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Iterator[Blamed]:
    folder = tmp_path_factory.mktemp("blame")
    made = Blamed(copy_toycar(folder), folder)
    yield made
    for engine in made.engines.values():
        engine.close()


@pytest.mark.parametrize(
    ("mood", "detail", "place"),
    [
        (None, "TypeError: unsupported operand type(s) for -: 'NoneType' and 'float'", "toycar/driver.py"),
        ("fail", "ValueError: no such gap", "toycar/moods.py"),
        ("leave", "exit status 3", "toycar/moods.py"),
        ("recur", "RecursionError: maximum recursion depth exceeded", "toycar/moods.py"),
        ("want_too_much", "MemoryError", "toycar/moods.py"),
        ("be_silent", "Silent: its text cannot be told (ValueError)", "toycar/moods.py"),
        ("vanish", "left with status 7 without a report", None),
        ("break_down", "killed by SIGSEGV", None),
    ],
)
def test_a_target_that_ends_after_the_activation_has_crashed(
    blamed: Blamed, mood: str | None, detail: str, place: str | None
) -> None:
    record = blamed.record(sensed(mood))
    assert record.status is Status.CRASHED
    if place is None:
        assert (record.detail, record.error, record.activation) == (detail, None, None)
        return
    assert record.error is not None and record.activation is not None
    assert record.error.place.partition(":")[0] == place
    assert record.detail == f"{detail} ({record.error.place})"
    assert detail.startswith((record.error.kind, "exit")) and detail.endswith(record.error.message)
    assert record.activation.first == FIRST_ACTIVE_S


def test_an_exception_in_a_guarded_statement_is_a_crash(blamed: Blamed) -> None:
    """A guarded statement belongs to the target."""
    left_out = fault(Injection(location=at(SEEN), model="omission"))
    record = blamed.record(left_out, IN_ONE_STEP)
    assert record.status is Status.CRASHED
    assert record.error is not None and record.error.kind == "KeyError"
    assert blamed.line(record.error.place).startswith("self.seen = {")


GAP_LINE = "gap = world.gap"
WORLD = Anchor(kind=AnchorKind.BEFORE_ASSIGN, name="offset")


@pytest.mark.parametrize(
    ("injected", "scenario", "code", "anchored", "error"),
    [
        (at_gap("raising"), "A", "gap = [][1]", GAP_LINE, "IndexError: list index out of range"),
        (
            at_gap("calling"),
            "A",
            "self.sense(gap)",
            GAP_LINE,
            "AttributeError: 'float' object has no attribute 'gap'",
        ),
        (at_gap("raising"), "careful", "gap = [][1]", GAP_LINE, "RuntimeError: the sensor is gone"),
        (
            fault(Injection(location=at(WORLD), model="bit_flip", params=(("bit", 3), ("target", "world")))),
            "A",
            "world = _fi.flip_bit(world, 3)",
            "offset = world.offset",
            "error: required argument is not a float",
        ),
    ],
    ids=["itself", "in the target's code that it calls", "the target wraps it", "in a helper of the probe"],
)
def test_an_injected_line_that_raises_makes_the_mutant_invalid(
    blamed: Blamed, injected: Fault, scenario: str, code: str, anchored: str, error: str
) -> None:
    """The place is the statement at the anchor, in the target's own file."""
    record = blamed.record(injected, scenario=scenario)
    assert record.status is Status.INVALID_MUTANT
    named, _, rest = record.detail.partition(": the injected ")
    assert blamed.line(named) == anchored
    assert rest.startswith(f"`{code}` ended the run: {error}")
    assert record.error is not None and record.activation is None


def test_an_exception_that_the_model_declares_is_a_crash(blamed: Blamed) -> None:
    record = blamed.record(at_gap("declared"))
    assert record.status is Status.CRASHED
    assert record.detail == "IndexError: list index out of range (toycar/sensing.py:12)"


@pytest.mark.parametrize(
    ("model", "params", "kind"),
    [("repetition", (), "KeyError"), ("exception", (("error", "TimeoutError"),), "TimeoutError")],
)
def test_an_exception_in_a_repeated_statement_is_a_crash(
    blamed: Blamed, model: str, params: tuple[tuple[str, Value], ...], kind: str
) -> None:
    """A repeated statement belongs to the target. An exception that a model raises on purpose is also a
    crash."""
    seen = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="self.seen")
    record = blamed.record(fault(Injection(location=at(seen), model=model, params=params)))
    assert record.status is Status.CRASHED
    assert record.error is not None and record.error.kind == kind


@pytest.mark.parametrize(
    ("number", "detail"),
    [
        (0, "ValueError: no such gap"),
        (1, "exit status 3"),
        (2, "left with status 7 without a report"),
        pytest.param(3, "CPU time limit of 1 s", marks=pytest.mark.slow),
    ],
)
def test_a_bad_end_before_the_first_activation_is_a_harness_error(
    blamed: Blamed, number: int, detail: str
) -> None:
    record = blamed.record(sensed("fail"), scenario=f"early{number}")
    place = f" ({record.error.place})" if record.error else ""
    assert (record.error is not None) is (number < 2)
    assert record.status is Status.HARNESS_ERROR
    assert record.detail == f"{detail}{place}, before the fault was active"


@pytest.mark.slow
def test_a_hang_after_the_activation_is_a_timeout(blamed: Blamed) -> None:
    record = blamed.record(sensed("hang"))
    assert (record.status, record.detail) == (Status.TIMEOUT, "CPU time limit of 1 s")


@pytest.mark.parametrize(
    ("mood", "detail"),
    [
        ("damage_the_counts", "its probe's report of the injections is damaged"),
        ("make_it_nan", "its probe's report of the trigger is damaged"),
        ("forget_an_injection", "the injections in its probe's report are not its own"),
        ("report_what_is_no_report", "its probe has no report"),
        ("take_the_probe_apart", "the probe failed: AttributeError: 'NoneType' object has no attribute 't'"),
    ],
)
def test_a_damaged_probe_is_a_harness_error(blamed: Blamed, mood: str, detail: str) -> None:
    record = blamed.record(sensed(mood))
    assert record.status is Status.HARNESS_ERROR
    assert record.detail.startswith(detail)


def test_a_damaged_report_affects_only_one_experiment(blamed: Blamed) -> None:
    experiments = [blamed.experiment(f) for f in (at_gap("offset", by=1.0), sensed("damage_the_counts"))]
    experiments.append(blamed.experiment(at_gap("offset", by=2.0)))
    for engine in blamed.engines:
        records = blamed.run(engine, experiments)
        assert [record.status for record in records] == [Status.OK, Status.HARNESS_ERROR, Status.OK]


@pytest.mark.parametrize("mood", ["stop_the_time", "observe_again_and_hide_it", "lose_the_lead"])
def test_a_failed_observation_is_a_probe_error(blamed: Blamed, mood: str) -> None:
    record = blamed.record(sensed(mood))
    assert record.status is Status.HARNESS_ERROR
    assert record.error is not None
    if mood != "lose_the_lead":
        assert record.error.message == "observed twice: at 2.0 s, after 2.0 s"
    assert blamed.line(record.error.place).startswith(("now = world.advance(", "probe().observe("))
    assert record.detail.endswith(f"({record.error.place})")
    assert record.detail.startswith(f"the probe failed: {record.error.kind}: ")
