"""The closed loop: plant, sensors, camera and the controller, 10 ms a step."""

from dataclasses import dataclass
from typing import NamedTuple


class GroundTruth(NamedTuple):
    """The world after the plant's step that began at `t`. SI units, radians, left positive."""

    t: float
    d_rel: float  # m, bumper to bumper
    v_ego: float  # m/s
    v_lead: float  # m/s
    a_ego: float  # m/s^2
    lateral_offset: float  # m from the middle of the lane
    heading: float  # rad relative to the road
    steer_angle: float  # rad at the steering wheel


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationResult:
    """What a finished run leaves: `record` (plain data for record.json) and `trace` (name to array)."""

    record: dict
    trace: dict


class Simulator:
    """Runs one scenario at a time; may be reset and used again."""

    def reset(self, scenario, seed: int = 0) -> None:
        """Build car, controller and recorder anew for `scenario` (a sim.scenario.Scenario)."""
        raise NotImplementedError

    @property
    def done(self) -> bool:
        """True once the scenario's duration has been simulated."""
        raise NotImplementedError

    def step(self) -> None:
        """Advance 10 ms: plant, ground truth, sensors, controller, recorder."""
        raise NotImplementedError

    def result(self) -> SimulationResult:
        """Record and trace of the steps made so far."""
        raise NotImplementedError
