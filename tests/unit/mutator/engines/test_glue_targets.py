"""Targets whose entry uses the harness's glue, in the reference and fork engines."""

from pathlib import Path

import pytest

import mutator
from mutator.engines.engine_jobs import RunMode
from mutator.engines.in_target.run_once import HarnessImportFinder
from mutator.model import Status
from mutator.triggers.trigger_kinds import trigger_at_time

from ..fork_on_toy import Edit, Fork

MANIFEST = "fault_library/targets/toycar.yaml"
ENTRY = """
import sys

from mutator.glue import Run
from toycar.driver import Driver
from toycar.sensing import Sensor
from toycar.world import World


class Drive(Run):
    def __init__(self, scenario, seed):
        super().__init__(step_s=0.05, duration_s=scenario["steps"] * 0.05)
        self.world, self.sensor, self.driver = World(scenario), Sensor(), Driver()
        self.commands = (0.0, 0.0, 0.0)
        print(sys.modules["mutator"].__file__)

    def step(self):
        world = self.world
        now = world.advance(*self.commands)
        world.judge(now)
        self.sensor.sense(world)
        self.commands = gas, brake, wheel_turn = self.driver.drive(now, world.speed, self.sensor.reading)
        self.record(gap=world.gap, speed=world.speed, gas=gas, brake=brake, wheel_turn=wheel_turn)


if __name__ == "__main__":
    Drive.main()
"""


@pytest.fixture
def glued(fork: Fork, edit: Edit) -> Fork:
    (fork.toy.library.parent / "tree" / "toycar" / "go.py").write_text(ENTRY)
    edit(
        MANIFEST,
        '["{scenario}", --to, "{out}", --number, "{seed}"]',
        "[--scenario, '{scenario}', --seed, '{seed}', --out, '{out}']",
    )
    edit(MANIFEST, "stepwise: begin", "stepwise: Drive.open")
    edit(MANIFEST, "trace: {file: log.npz, time: time}", "trace: {file: trace.npz, time: t}")
    edit(MANIFEST, "record: said.json", "record: record.json")
    return fork


def test_both_engines_give_the_same_bytes(glued: Fork) -> None:
    job = glued.job(trigger_at_time(2.0))
    forked = glued.engine.execute(job, glued.folder / "work" / "forked")
    plain = glued.engine.reference.execute(job, glued.folder / "plain")
    assert (forked.status, forked.mode, forked.fallback_reason) == (Status.OK, RunMode.FORK, "")
    assert plain.status is Status.OK
    assert plain.probe_report and plain.probe_report["triggered"]
    for name in ("trace.npz", "record.json"):
        assert (forked.out / name).read_bytes() == (plain.out / name).read_bytes()


def test_a_run_imports_the_glue_of_the_harness_that_started_it(glued: Fork) -> None:
    """Otherwise, a run could import another installed version of mutator."""
    plain = glued.engine.reference.execute(glued.job(trigger_at_time(2.0)), glued.folder / "plain")
    assert Path(plain.log_tail.strip()) == Path(mutator.__file__)
    assert "mutator" not in plain.third_party_modules
    assert "numpy" in plain.third_party_modules


def test_the_import_hook_of_the_glue_finds_no_other_modules() -> None:
    assert HarnessImportFinder.find_spec("tests") is None
    assert HarnessImportFinder.find_spec("mutator.glue") is None
