"""Measure what a speed sensor's glitch of a few steps does: `python benchmarks/glitch.py`.

The sensor reads too low for a few steps of 10 ms, on both plants, with the speed filter as it is and with a
reset of the filter after a jump of more than 2 m/s, which the original intends. Prints contact, collision
warning and smallest gap of each run.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.car.honda.carstate import SPEED_KALMAN_GAINS  # noqa: E402
from selfdrive.car.honda.interface import CarInterface  # noqa: E402
from selfdrive.common.conversions import MPH_TO_MS  # noqa: E402
from selfdrive.common.kalman import SteadyKalman  # noqa: E402
from selfdrive.common.realtime import DT_CTRL  # noqa: E402
from selfdrive.messages import CanFrame  # noqa: E402
from selfdrive.sim.scenario import PLANTS, load_scenario, with_plant  # noqa: E402
from selfdrive.sim.simulator import Simulator  # noqa: E402
from selfdrive.sim.truth import GroundTruth  # noqa: E402

JUMP = 2.0  # m/s; a larger jump resets the mended filter
SLOWEST = 1e-9  # m/s; the sensor reads 0, but the wheels turn


class Glitch(NamedTuple):
    scenario: str
    mph: float  # by which the sensor reads too low
    start: int  # first step
    steps: int

    def __str__(self) -> str:
        start, end = self.start / 100, (self.start + self.steps) / 100
        return f"{self.scenario}, {self.mph:g} mph, {start:.2f} to {end:.2f} s"


class Result(NamedTuple):
    contact: float | None  # s
    warning: float | None  # s
    gap: float  # m, the smallest


GLITCHES = (
    Glitch("S5", 60, 1000, 2),
    Glitch("S5", 60, 1200, 2),
    Glitch("S5", 60, 1000, 1),
    Glitch("S5", 10, 1000, 5),
    *(Glitch(name, 60, 1000, 2) for name in ("S1", "S2", "S3", "S4")),
)


def drive(glitch: Glitch, plant: str, *, reset_after_jump: bool = False, gap: float = 0.0) -> Result:
    """Run one glitch. `gap` (m) is added to the first distance to the lead."""
    scenario = with_plant(load_scenario(ROOT / "fault_library/scenarios" / f"{glitch.scenario}.yaml"), plant)
    simulator = Simulator()
    simulator.reset(scenario, 0)
    assert simulator._lead is not None
    simulator._lead.position += gap
    _disturb(simulator, glitch)
    if reset_after_jump:
        _mend_filter(simulator)
    while not simulator.is_finished:
        simulator.step()
    result = simulator.result()
    warnings = [alert["t"] for alert in result.record["alerts"] if alert["name"] == "fcw"]
    contact = result.record["hazards"]["H1"]
    return Result(contact, warnings[0] if warnings else None, float(result.trace["d_rel"].min()))


def _disturb(simulator: Simulator, glitch: Glitch) -> None:
    measure = simulator._sensors.measure

    def disturbed(truth: GroundTruth, button: int, frame: int, brake_pedal: float) -> list[CanFrame]:
        if 0 <= frame - glitch.start < glitch.steps:
            truth = truth._replace(v_ego=max(truth.v_ego - glitch.mph * MPH_TO_MS, SLOWEST))
        return measure(truth, button, frame, brake_pedal)

    setattr(simulator._sensors, "measure", disturbed)  # noqa: B010


class ResettingFilter(SteadyKalman):
    """Starts again from a measurement that differs from the estimate by more than JUMP."""

    def update(self, measured: float) -> None:
        if abs(measured - self.value) > JUMP:
            self.value, self.rate = measured, 0.0
        super().update(measured)


def _mend_filter(simulator: Simulator) -> None:
    car = simulator.manager.controlsd._car
    assert isinstance(car, CarInterface)
    car._reader._speed = ResettingFilter(0.0, 0.0, dt=DT_CTRL, gains=SPEED_KALMAN_GAINS)


def lines() -> Iterator[str]:
    def cell(value: float | None) -> str:
        return "-" if value is None else f"{value:.2f}"

    yield f"{'sensor reads low':32} {'plant':9} {'filter':6} {'contact':>8} {'warning':>8} {'gap':>7}"
    for glitch in GLITCHES:
        for plant in PLANTS:
            for mended in (False, True):
                ran = drive(glitch, plant, reset_after_jump=mended)
                label = "mended" if mended else "as is"
                row = f"{glitch!s:32} {plant:9} {label:6} {cell(ran.contact):>8} {cell(ran.warning):>8}"
                yield f"{row} {ran.gap:7.3f}"


def main() -> None:
    for line in lines():
        print(line, flush=True)


if __name__ == "__main__":
    main()
