"""Injections into one instance or some executions give the same bytes on each engine."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mutator.engines.engine_jobs import RunMode
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection

from .test_engines import SENT, TRIGGERS, Engines, check_same

STEERED = FaultLocation(
    path="toycar/driver.py",
    function="Driver.drive",
    anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name="wheel"),
)
MEASURED = FaultLocation(
    path="toycar/sensing.py",
    function="Sensor.sense",
    anchor=Anchor(kind=AnchorKind.VALUE, name="world.gap"),
)
SENDS = FaultLocation(path="toycar/sensing.py", function="Sensor.sense", anchor=SENT)
INJECTIONS = (
    Injection(
        location=STEERED,
        model="stuck",
        params=(("target", "wheel"), ("value", 1.0)),
        where="brake == 0.0 or reading[0] is None",
        call=4,
    ),
    Injection(location=MEASURED, model="offset", params=(("by", 30.0),), every=3),
    Injection(location=SENDS, model="omission", where="world.speed > 17.0 and self is not None", every=2),
)


@pytest.fixture(scope="module")
def three(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], object]
) -> Iterator[Engines]:
    folder = tmp_path_factory.mktemp("instances")
    made = Engines(copy_toycar(folder), folder)  # type: ignore[arg-type]
    yield made
    made.close()


def fault(*injections: Injection) -> Fault:
    return Fault("s", "m", "f", "as_described", None, "", "H1", injections)


def test_engines_agree_on_a_mutant_with_all_limits(three: Engines) -> None:
    execution = check_same(three, three.job(fault(*INJECTIONS), TRIGGERS["for 1 s"]), RunMode.FORK)
    assert execution.probe_report is not None
    counts = [told["count"] for told in execution.probe_report["injections"].values()]
    assert execution.probe_report["triggered"]["steps"] == 20
    assert counts[:2] == [1, 6]
    assert 0 < counts[2] <= 10


@pytest.mark.slow
@pytest.mark.parametrize("trigger", TRIGGERS)
@pytest.mark.parametrize("injection", INJECTIONS, ids=["instance", "value", "guard"])
def test_engines_agree_on_each_limit_under_every_trigger(
    three: Engines, injection: Injection, trigger: str
) -> None:
    how = RunMode.GOLDEN_REUSED if trigger == "never" else RunMode.FORK
    check_same(three, three.job(fault(injection), TRIGGERS[trigger]), how)
