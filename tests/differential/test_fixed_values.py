"""Constants and defaults that the probe sets give the same bytes on each engine and change the result."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mutator.engines.engine_jobs import RunMode
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Status
from mutator.workspace import Workspace

from .test_engines import TRIGGERS, Engines, check_same

TUNING = '''"""How the controller is tuned."""

from dataclasses import dataclass

HEADWAY = 1.5


class Gains:
    __gap = 0.4

    @classmethod
    def gap(cls):
        return cls.__gap


@dataclass(frozen=True)
class Strength:
    gas: float = 3.0
    brake: float = 6.0


class Softer(Strength):
    pass
'''
DRIVER = '''"""The controller: keeps a headway and the middle of the lane."""

from toycar.tuning import HEADWAY as WANTED
from toycar.tuning import Gains, Softer


class Driver:
    def __init__(self):
        self.warned = []

    def drive(self, t, speed, reading):
        gap, closing, offset = reading
        wanted = Gains.gap() * (gap - 5.0 - WANTED * speed) - 1.2 * closing
        strength = Softer()
        gas = min(max(wanted / strength.gas, 0.0), 1.0)
        brake = min(max(-wanted / strength.brake, 0.0), 1.0)
        return gas, brake, self.wheel(offset)

    @staticmethod
    def wheel(offset, *, gain=-0.6):
        return max(min(gain * offset, 1.0), -1.0)
'''


@pytest.fixture(scope="module")
def three(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Iterator[Engines]:
    folder = tmp_path_factory.mktemp("fixed")
    toy = copy_toycar(folder)
    tree = toy.library.parent / "tree" / "toycar"
    (tree / "tuning.py").write_text(TUNING)
    (tree / "driver.py").write_text(DRIVER)
    made = Engines(toy, folder)
    yield made
    made.close()


def constant(name: str) -> FaultLocation:
    return FaultLocation(
        path="toycar/tuning.py", function="", anchor=Anchor(kind=AnchorKind.CONSTANT, name=name)
    )


GAIN = FaultLocation(
    path="toycar/driver.py", function="Driver.wheel", anchor=Anchor(kind=AnchorKind.DEFAULT, name="gain")
)
PLACES = {
    "of a module, imported under another name": constant("HEADWAY"),
    "private, of a class": constant("Gains.__gap"),
    "of a field that a class inherits": constant("Strength.brake"),
    "of a parameter by keyword": GAIN,
}


def fault(*locations: FaultLocation) -> Fault:
    params = (("factor", 0.3),)
    injections = tuple(Injection(location=one, model="scale", params=params) for one in locations)
    return Fault("s", "m", "f", "as_described", None, "", "H1", injections)


def test_engines_agree_on_a_mutant_that_sets_all_values(three: Engines) -> None:
    job = three.job(fault(*PLACES.values()), TRIGGERS["off and on"])
    execution = check_same(three, job, RunMode.FORK)
    assert execution.probe_report is not None
    steps = execution.probe_report["triggered"]["steps"]
    assert [told["count"] for told in execution.probe_report["injections"].values()] == [steps] * 4
    assert 0 < steps < 400


@pytest.mark.slow
@pytest.mark.parametrize("trigger", TRIGGERS)
@pytest.mark.parametrize("place", PLACES)
def test_engines_agree_on_each_value_under_every_trigger(three: Engines, place: str, trigger: str) -> None:
    how = RunMode.GOLDEN_REUSED if trigger == "never" else RunMode.FORK
    execution = check_same(three, three.job(fault(PLACES[place]), TRIGGERS[trigger]), how)
    assert execution.status is Status.OK
    _, files = three.run("fork", three.job(fault(PLACES[place]), TRIGGERS[trigger]))
    golden = (three.golden("A") / "log.npz").read_bytes()
    assert (files["log.npz"] == golden) is (trigger == "never")
