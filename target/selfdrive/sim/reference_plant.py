"""The reference plant: openpilot v0.4.2's own PC simulation with its errors, for comparison with recordings.

Do not draw conclusions about driving from it: its lateral motion and messages are crude.
"""

from selfdrive.common.car import CarParams
from selfdrive.common.conversions import DEG_TO_RAD, MS_TO_KPH
from selfdrive.common.realtime import DT_CTRL
from selfdrive.sim.plant import Plant
from selfdrive.sim.truth import GroundTruth

FULL_TORQUE_ANGLE_RATE = 0.1  # deg/s of the steering wheel, for a torque of 1
ANGLE_PER_OFFSET = 0.1067  # deg of the steering wheel per m of lateral motion
OFFSET_CYCLE_STEPS = 5  # steps; only the first moves the car laterally
FIRST_HEADWAY = 30.0  # s


class CrudeLateral:
    """Torque turns the steering wheel slowly; the car moves laterally only while it turns, at any speed."""

    heading = 0.0  # rad

    def __init__(self, offset: float = 0.0) -> None:
        self.offset = offset  # m from the middle of the lane
        self.steer_angle = 0.0  # rad at the steering wheel
        self.steer_rate = 0.0  # rad/s
        self._angle = 0.0  # deg
        self._step = 0

    def step(self, torque: float, speed: float, curvature: float) -> float:
        """Advance 10 ms with `torque` (left positive, 1 is full); return the speed along the road (m/s)."""
        change = DT_CTRL * FULL_TORQUE_ANGLE_RATE * torque
        self._angle += change
        self.steer_angle = self._angle * DEG_TO_RAD
        self.steer_rate = change * DEG_TO_RAD / DT_CTRL
        if self._step % OFFSET_CYCLE_STEPS == 0:
            self.offset += change / ANGLE_PER_OFFSET
        self._step += 1
        return speed


class ReferencePlant(Plant):
    """The standard plant's longitudinal motion with the original's errors.

    The gearbox sends km/h instead of m/s. Lateral positions are right positive although the controller
    expects left positive, so the left lane is sent as the right one and pictures are mirrored. Without
    pictures, camera and radar always see a car in mid-lane. Distances are at least 0; the headway time
    starts at 30 s and keeps its value at standstill.
    """

    gearbox_scale = MS_TO_KPH
    has_mirrored_messages = True

    def __init__(self, car: CarParams, *, speed: float, offset: float = 0.0) -> None:
        super().__init__(car, speed=speed, offset=offset)
        self.lateral = CrudeLateral(offset)
        self._headway = FIRST_HEADWAY

    def distance_to(self, position: float) -> float:
        return max(super().distance_to(position), 0.0)

    def headway(self, d_rel: float) -> float:
        if self.speed > 0.0:
            self._headway = d_rel / self.speed
        return self._headway

    def shown(self, truth: GroundTruth) -> GroundTruth:
        """Hide the car's drift from camera and radar."""
        return truth._replace(lateral_offset=0.0)

    def pictured(self, truth: GroundTruth) -> GroundTruth:
        """Mirror the car's offset."""
        return truth._replace(lateral_offset=-truth.lateral_offset)
