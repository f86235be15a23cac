"""Runs that stop at their first terminal hazard."""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from mutator._common.hashing import digest
from mutator.campaigns.plan import build_plan
from mutator.campaigns.shared_runs import group_by_run
from mutator.engines.engine_jobs import Engine, RunMode
from mutator.engines.fork_engine import ForkEngine
from mutator.engines.in_target.early_stop import compile_stop_condition
from mutator.errors import MutatorError
from mutator.execution.experiment_runner import ExperimentRunner, RecordedExperiment
from mutator.execution.golden_hazards import GoldenHazardRules
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.model import (
    AfterHazard,
    AgainstGolden,
    Experiment,
    GoldenClass,
    Method,
    Outcome,
    Record,
    Status,
)
from mutator.mutants.mutant_building import build
from mutator.outcomes.trace_and_record_loading import trace_until
from mutator.targets.early_stop_code import stop_function_source
from mutator.triggers import trace_formulas
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time

from ..fork_on_toy import Edit, Fork

MANIFEST = "fault_library/targets/toycar.yaml"
HAZARDS = """\
hazards:
  H1: {about: contact, when: "25 >= near and hypot(speed, 0) > 0", terminal: true}
  H3: {when: gap < 22}
  TOO_FAST: {when: speed > 100, terminal: speed > 90}
metrics:
  way: {integral: speed, unit: m, worse: lower, about: x}
  least: {min: gap, unit: m, worse: lower, about: x}
"""
CHANNELS = "  d_rel: {unit: m, from: gap}\nobservation:"
DERIVED = "  derived:\n    near: {is: d_rel / 1, unit: m, about: x}\n"
RECORDED = """
    def recorded(self):
        names = ("time", "gap", "speed", "lead_speed", "offset", "gas", "brake", "wheel_turn")
        return dict(zip(names, self.rows[-1], strict=True))

    def write("""


@pytest.fixture
def stopping(fork: Fork, edit: Edit) -> Iterator[Fork]:
    """The toy with hazards defined as conditions. Its runs report their last recorded values."""
    edit(MANIFEST, "hazards: [H1, H3, TOO_FAST]\n", HAZARDS)
    edit(MANIFEST, "observation:", CHANNELS)
    edit(MANIFEST, "  derived:\n", DERIVED)
    edit("tree/toycar/go.py", "\n    def write(", RECORDED)
    yield fork


def drive(
    fork: Fork, engine: Engine, after: AfterHazard, at: float = 2.0, end_s: float | None = None
) -> Record:
    return run_one(fork, engine, after, at, end_s).record


def run_one(
    fork: Fork, engine: Engine, after: AfterHazard, at: float, end_s: float | None = None
) -> RecordedExperiment:
    manifest = fork.manifest
    experiment = Experiment(
        fault=fork.fault(),
        scenario="A",
        scenario_digest=digest(fork.toy.scenario("A").read_bytes()),
        method=Method.GUIDED,
        trigger=trigger_at_time(at),
        seed=7,
        after_hazard=after,
        end_s=end_s,
    )
    goldens = LoadedGoldens(manifest, lambda experiment: fork.golden)
    rules = GoldenHazardRules(include=GoldenClass.HAZARD_WITHOUT_FAULT)
    runner = ExperimentRunner(
        manifest, fork.models, engine, goldens, fork.toy.scenario, golden_hazard_rules=rules
    )
    finished: RecordedExperiment
    (finished,) = runner.run([experiment])
    if engine is fork.engine and finished.record.status is Status.OK:
        assert finished.mode in (RunMode.FORK, RunMode.GOLDEN_REUSED), finished.fallback_reason
    return finished


def test_a_stopped_run_equals_the_beginning_of_the_complete_run(stopping: Fork) -> None:
    fork = stopping.engine
    null = build(stopping.manifest, stopping.models, None, always_trigger())
    work = stopping.folder / "warm"
    work.mkdir()
    warm = ForkEngine(stopping.manifest, work, stopping.limits, null_mutant=null, before_first_step=True)
    engines: tuple[Engine, ...] = (fork.reference, fork, warm)
    stopped, *others = (drive(stopping, one, AfterHazard.STOP) for one in engines)
    assert others == [stopped, stopped]
    warm.close()
    whole = drive(stopping, fork.reference, AfterHazard.GO_ON)
    assert stopped.t_end is not None
    assert stopped.experiment_id != whole.experiment_id
    assert (stopped.outcome, stopped.t_end) == (Outcome.HAZARD, whole.t_end)
    assert (stopped.metrics, stopped.t_manifest) == (whole.metrics, whole.t_manifest)
    assert stopped.max_dev == stopped.dev == whole.dev
    assert [name for name, _ in whole.hazards] == ["H1", "H3"]
    assert stopped.hazards == tuple((name, t) for name, t in whole.hazards if t <= stopped.t_end)
    assert stopped.trace_digest != whole.trace_digest


@pytest.mark.parametrize("at", [2.0, 1000.0])
@pytest.mark.parametrize("terminal", ["t > 1.0", "t >= 0"])
def test_engines_agree_on_a_run_that_stops_before_its_fault(
    stopping: Fork, edit: Edit, terminal: str, at: float
) -> None:
    edit(MANIFEST, "terminal: speed > 90", f"terminal: {terminal}")
    reference, forked = (
        drive(stopping, one, AfterHazard.STOP, at) for one in (stopping.engine.reference, stopping.engine)
    )
    assert reference == forked
    assert (reference.outcome, reference.activation) == (Outcome.NOT_ACTIVATED, None)
    whole = drive(stopping, stopping.engine, AfterHazard.GO_ON, at)
    assert (whole.activation is not None) == (at == 2.0)


@pytest.mark.parametrize(("terminal", "outcome"), [("t > 3.0", Outcome.SDC), ("t > 9.0", Outcome.HAZARD)])
def test_engines_agree_on_a_run_that_stops_after_its_fault(
    stopping: Fork, edit: Edit, terminal: str, outcome: Outcome
) -> None:
    edit(MANIFEST, "terminal: speed > 90", f"terminal: {terminal}")
    reference, forked = (
        drive(stopping, one, AfterHazard.STOP) for one in (stopping.engine.reference, stopping.engine)
    )
    assert reference == forked
    assert (reference.outcome, reference.activation is not None) == (outcome, True)
    assert reference.t_end is not None


@pytest.mark.parametrize(("at", "end_s"), [(2.0, 2.0), (2.0, 4.5), (4.55, 4.5), (1000.0, 4.5)])
def test_engines_agree_on_a_run_that_ends_at_a_time(
    stopping: Fork, edit: Edit, at: float, end_s: float
) -> None:
    """It equals the beginning of the whole run, and hazards after it are neither its own nor golden's."""
    edit(MANIFEST, '"25 >= near and hypot(speed, 0) > 0"', "t >= 5.0")
    reference, forked = (
        drive(stopping, one, AfterHazard.STOP, at, end_s)
        for one in (stopping.engine.reference, stopping.engine)
    )
    assert reference == forked
    assert (reference.status, reference.t_end, reference.against_golden) == (Status.OK, None, None)
    whole = drive(stopping, stopping.engine, AfterHazard.GO_ON, at)
    assert whole.against_golden is (None if at == 1000.0 else AgainstGolden.SAME)
    assert (reference.activation is not None) == (at <= end_s)
    assert reference.trace_digest != whole.trace_digest
    assert reference.t_manifest == (whole.t_manifest if (whole.t_manifest or 99.0) <= end_s else None)
    assert reference.hazards == tuple((name, t) for name, t in whole.hazards if t <= end_s)


def test_a_hazard_of_golden_in_the_last_step_is_none_of_the_fault(stopping: Fork, edit: Edit) -> None:
    """A run ends with the first step at or after its end."""
    edit(MANIFEST, '"25 >= near and hypot(speed, 0) > 0"', "t >= 5.0")
    record = drive(stopping, stopping.engine, AfterHazard.STOP, end_s=4.99)
    assert (record.hazards, record.against_golden) == ((), AgainstGolden.SAME)


@pytest.mark.parametrize("end_s", [2.3, 2.45, 2.55])
def test_a_trace_may_store_times_less_exactly(stopping: Fork, edit: Edit, end_s: float) -> None:
    rounded = "(struct.unpack('f', struct.pack('f', row[0]))[0], *row[1:])"
    edit("tree/toycar/go.py", "*self.rows, strict=True", f"*({rounded} for row in self.rows), strict=True")
    record = drive(stopping, stopping.engine.reference, AfterHazard.STOP, end_s=end_s)
    assert record.status is Status.OK, record.detail


def test_runs_that_end_at_different_times_are_not_shared(stopping: Fork) -> None:
    first, second = (
        Experiment(
            fault=stopping.fault(),
            scenario="A",
            scenario_digest="",
            method=Method.GUIDED,
            trigger=trigger_at_time(2.0),
            seed=7,
            after_hazard=AfterHazard.STOP,
            end_s=end_s,
        )
        for end_s in (2.5, None)
    )
    assert len(group_by_run(stopping.toy.manifest("toycar"), [first, second])) == 2


def test_a_scenario_that_ends_first_ends_the_run(stopping: Fork) -> None:
    longer = drive(stopping, stopping.engine, AfterHazard.STOP, end_s=1e6)
    assert replace(longer, experiment_id="") == replace(
        drive(stopping, stopping.engine, AfterHazard.STOP), experiment_id=""
    )


@pytest.mark.parametrize(
    ("at", "case", "forks"),
    [
        (2.0, AgainstGolden.SAME, True),
        (3.5, AgainstGolden.SAME, True),
        (4.0, AgainstGolden.NOT_BEFORE, False),
        (4.5, AgainstGolden.NOT_BEFORE, False),
        (1000.0, AgainstGolden.NOT_BEFORE, False),
    ],
)
def test_engines_agree_on_a_run_whose_golden_run_has_a_terminal_hazard(
    stopping: Fork, edit: Edit, at: float, case: AgainstGolden, forks: bool
) -> None:
    """It is forked just before its fault, as any other, unless golden's hazard comes first."""
    edit(MANIFEST, '"25 >= near and hypot(speed, 0) > 0"', "t >= 4.0")
    reference, forked = (
        run_one(stopping, one, AfterHazard.STOP, at) for one in (stopping.engine.reference, stopping.engine)
    )
    assert reference.record == forked.record
    assert (forked.mode, forked.fork_step > 0) == (RunMode.FORK, forks)
    record = forked.record
    assert (record.against_golden, record.hazards) == (case, ())
    assert record.golden_hazards == (("H1", 4.0),)
    assert record.t_end == 4.0
    assert (record.outcome is Outcome.NOT_JUDGED) is (case is AgainstGolden.NOT_BEFORE)
    assert bool(record.detail) is (case is AgainstGolden.NOT_BEFORE)
    whole = drive(stopping, stopping.engine, AfterHazard.GO_ON, at)
    expected = None if at == 1000.0 else case  # a run to its end shows that the fault was never active
    assert whole.against_golden is expected


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("terminal: true", "terminal: true, for_s: 1", "H1 has `for_s`; expected a condition of one step"),
        ("25 >= near", "ever(25 >= near)", "H1 uses `ever`; expected a condition of a single step"),
        ("25 >= near", "rate(near) > 5", "H1 uses `rate`"),
        (
            '{about: contact, when: "25 >= near and hypot(speed, 0) > 0", terminal: true}',
            "{terminal: true}",
            "H1, which is judged by the target itself; expected a condition, `when`",
        ),
        (
            "speed: {unit: m/s, role: truth}",
            "speed: {unit: m/s, role: truth, time: own}",
            "speed has separate times; expected a number in each step",
        ),
        ("  stepwise: begin\n", "", "no `stepwise`"),
    ],
)
def test_a_hazard_that_cannot_be_judged_in_each_step_is_refused(
    stopping: Fork, edit: Edit, old: str, new: str, message: str
) -> None:
    edit(MANIFEST, old, new)
    with pytest.raises(MutatorError, match=re.escape(f"cannot stop at a terminal hazard: {message}")):
        stop_function_source(stopping.toy.manifest("toycar"))


def test_a_target_without_a_terminal_hazard_is_refused(stopping: Fork, edit: Edit) -> None:
    edit(MANIFEST, ", terminal: true", "")
    edit(MANIFEST, ", terminal: speed > 90", "")
    with pytest.raises(MutatorError, match="no terminal hazard"):
        stop_function_source(stopping.toy.manifest("toycar"))


@pytest.mark.parametrize(
    ("gap", "speed", "over"),
    [
        (26.0, 9.0, False),
        (25.0, 9.0, True),
        (25.0, 0.0, False),
        (50.0, 90.5, True),
        (math.nan, 1.0, False),
    ],
)
def test_any_terminal_condition_ends_a_run(stopping: Fork, gap: float, speed: float, over: bool) -> None:
    source = stop_function_source(stopping.toy.manifest("toycar"))
    assert compile_stop_condition(source)({"time": 1.0, "gap": gap, "speed": speed}) is over


@pytest.mark.parametrize("terminal", ["max(d_rel, speed) <= 90", "min(speed, d_rel, t) > 40"])
def test_stopping_agrees_with_the_verdict_on_the_trace(stopping: Fork, edit: Edit, terminal: str) -> None:
    edit(MANIFEST, "terminal: speed > 90", f"terminal: '{terminal}'")
    manifest = stopping.toy.manifest("toycar")
    over = compile_stop_condition(stop_function_source(manifest))
    for numbers in product((math.nan, 30.0, 50.0, 100.0), repeat=3):
        t, gap, speed = ([number] for number in numbers)
        values = {"t": t, "d_rel": gap, "near": gap, "speed": speed}
        trace = {name: np.array(value) for name, value in values.items()}
        judged = [
            r.when if r.terminal_condition == "True" else r.terminal_condition
            for r in manifest.hazard_rules
            if r.terminal_condition
        ]
        expected = any(trace_formulas.condition_at_each_step(text, trace)[0] for text in judged)
        assert over({"time": t[0], "gap": gap[0], "speed": speed[0]}) is expected, numbers


def test_missing_recorded_values_are_a_harness_error(stopping: Fork, edit: Edit) -> None:
    """The values are missing before the fault is active, so the fault is not the cause."""
    edit("tree/toycar/go.py", "def recorded(", "def something_else(")
    record = drive(stopping, stopping.engine.reference, AfterHazard.STOP)
    assert record.status is Status.HARNESS_ERROR
    assert "recorded" in record.detail


def test_after_hazard_changes_the_ids_of_all_experiments(stopping: Fork, edit: Edit) -> None:
    edit("fault_library/campaigns/small.yaml", "chunk: 2", "chunk: 2\nafter_hazard: stop")
    stopped = build_plan(stopping.toy, "small")
    assert {e.after_hazard for e in (*stopped.experiments, stopped.canary)} == {AfterHazard.STOP}
    edit("fault_library/campaigns/small.yaml", "after_hazard: stop", "after_hazard: go_on")
    whole = build_plan(stopping.toy, "small")
    assert [replace(e, after_hazard=AfterHazard.GO_ON).id for e in stopped.experiments] == [
        e.id for e in whole.experiments
    ]
    assert {e.id for e in stopped.experiments}.isdisjoint(e.id for e in whole.experiments)
    assert whole.digest != stopped.digest
    edit("fault_library/campaigns/small.yaml", "after_hazard: go_on", "after_hazard: stop")
    edit(MANIFEST, "25 >= near", "ever(25 >= near)")
    with pytest.raises(MutatorError, match="cannot stop"):
        build_plan(stopping.toy, "small")


def test_a_trace_can_be_cut_at_a_time() -> None:
    trace = {"t": np.arange(4.0), "a": np.arange(4.0), "b": np.array([7.0, 8.0]), "b@": np.array([0.5, 2.5])}
    cut = trace_until(trace, 2.0, "t")
    assert {name: values.tolist() for name, values in cut.items()} == {
        "t": [0.0, 1.0, 2.0],
        "a": [0.0, 1.0, 2.0],
        "b": [7.0],
        "b@": [0.5],
    }
