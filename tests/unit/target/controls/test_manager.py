"""The manager starts the parts and calls them in order."""

from types import SimpleNamespace

import pytest
from selfdrive.common.car import CarParams
from selfdrive.manager import START_STEP, Manager
from selfdrive.messages import RadarData


class Log(list):
    def call(self, name: str, result=None):
        def called(*arguments):
            self.append((name, *arguments))
            return result

        return called


@pytest.fixture
def parts(params: CarParams) -> SimpleNamespace:
    log = Log()
    radar = SimpleNamespace(update=log.call("radar", RadarData(0.0)))
    visiond = SimpleNamespace(update=log.call("visiond"), latest="model")
    manager = Manager(SimpleNamespace(params=params), radar, visiond)
    manager.radard = SimpleNamespace(update=log.call("radard", "leads"))
    manager.controlsd = SimpleNamespace(update=log.call("controlsd", ["sent"]), state="state")
    return SimpleNamespace(manager=manager, log=log, radar=radar)


def run(parts: SimpleNamespace, steps: int, view: str | None = None) -> list:
    for k in range(steps):
        sent = parts.manager.step(k * 0.01, ["frame"], view)
    return sent


def test_camera_radar_and_controls_run_in_this_order(parts: SimpleNamespace) -> None:
    assert run(parts, START_STEP + 2, "view") == ["sent"]
    t = (START_STEP + 1) * 0.01
    assert parts.log[-4:] == [
        ("visiond", "view", t),
        ("radar", ["frame"], t),
        ("radard", RadarData(0.0), "model", "state"),
        ("controlsd", t, ["frame"], "leads", "model"),
    ]


def test_controls_start_late_and_without_frames(parts: SimpleNamespace) -> None:
    assert run(parts, START_STEP) == []
    assert "controlsd" not in [name for name, *_ in parts.log]
    parts.manager.step(START_STEP * 0.01, ["frame"], None)
    assert parts.log[-1] == ("controlsd", START_STEP * 0.01, [], None, "model")


def test_the_last_leads_are_used_until_new_ones_arrive(parts: SimpleNamespace) -> None:
    """The planner checks the age of the leads."""
    run(parts, START_STEP + 2)
    parts.radar.update = parts.log.call("radar", None)
    parts.manager.step(0.2, [], None)
    assert parts.log[-1] == ("controlsd", 0.2, [], "leads", "model")
