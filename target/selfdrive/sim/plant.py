"""The standard plant: openpilot's longitudinal PC simulation with realistic steering."""

from selfdrive.common.car import CarParams
from selfdrive.common.interp import interp
from selfdrive.common.realtime import DT_CTRL
from selfdrive.messages import Actuators
from selfdrive.sim.lateral import LateralDynamics, LateralMotion
from selfdrive.sim.truth import GroundTruth

LONGITUDINAL_MASS = 1700.0  # kg, for the longitudinal motion
GRAVITY = 9.81  # m/s^2
ROLLING_RESISTANCE = 0.01  # force as a share of the weight
DRAG_COEFFICIENT = 0.5 * 1.225 * 0.3  # N s^2/m^2
PEAK_FORCE = 3.0 * LONGITUDINAL_MASS  # N
PEAK_POWER = 100_000.0  # W
FORCE_SHARE_PER_GAS = 3.33  # a pedal of 0.3 already gives the peak force
BRAKE_FORCE = 10.0 * LONGITUDINAL_MASS  # N
FORCE_SHARE_PER_BRAKE = 0.3  # full brake decelerates by 3 m/s^2
BASE_SPEED = PEAK_POWER / PEAK_FORCE  # m/s; above this, power, not force, limits acceleration
CREEP_BP = (0.0, 1.5)  # m/s
CREEP_V = (1.0, 0.0)  # m/s^2 from an idling automatic gearbox
MOST_EXTRA_DECELERATION = 9.0  # m/s^2; more than this, tyres do not transmit on a dry road


def longitudinal_acceleration(
    speed: float, gas: float, brake: float, grade: float, extra_deceleration: float = 0.0
) -> float:
    """Return the longitudinal acceleration (m/s^2); pedals in 0..1, `grade` in m/s^2, uphill positive.

    The brakes follow the stronger of `brake` and `extra_deceleration` (m/s^2), as a hydraulic brake does that
    two systems can apply.
    """
    force = gas * FORCE_SHARE_PER_GAS * (PEAK_FORCE if speed < BASE_SPEED else PEAK_POWER / speed)
    extra = min(extra_deceleration, MOST_EXTRA_DECELERATION) * LONGITUDINAL_MASS
    force -= max(brake * BRAKE_FORCE * FORCE_SHARE_PER_BRAKE, extra)
    force -= ROLLING_RESISTANCE * LONGITUDINAL_MASS * GRAVITY + DRAG_COEFFICIENT * speed * speed
    force += (interp(speed, CREEP_BP, CREEP_V) - grade) * LONGITUDINAL_MASS
    return force / LONGITUDINAL_MASS


class Plant:
    """The host car. `position` (m) is along the road; the gearbox reports `gearbox_scale` times the speed."""

    gearbox_scale = 1.0
    has_mirrored_messages = False  # whether messages mirror left and right

    def __init__(self, car: CarParams, *, speed: float, offset: float = 0.0) -> None:
        self.speed = speed
        self.acceleration = 0.0
        self.position = 0.0
        self.lateral: LateralMotion = LateralDynamics(car, offset)

    def step(self, actuators: Actuators, grade: float, curvature: float) -> None:
        """Advance 10 ms by Euler's method: the position with the old speed, then the speed."""
        old = self.speed
        self.position += DT_CTRL * self.lateral.step(actuators.steer, old, curvature)
        self.acceleration = longitudinal_acceleration(
            old, actuators.gas, actuators.brake, grade, actuators.extra_deceleration
        )
        self.speed = old + DT_CTRL * self.acceleration
        if self.speed <= 0.0:
            self.speed = self.acceleration = 0.0

    def distance_to(self, position: float) -> float:
        """Distance (m) from the front bumper to `position` on the road; negative if it is behind."""
        return position - self.position

    def headway(self, d_rel: float) -> float:
        """Headway time (s) to an object `d_rel` m ahead; infinite at standstill."""
        return d_rel / self.speed if self.speed > 0.0 else float("inf")

    def shown(self, truth: GroundTruth) -> GroundTruth:
        """Return what camera and radar can detect: here, everything."""
        return truth

    def pictured(self, truth: GroundTruth) -> GroundTruth:
        """Return what the camera's pictures show: here, everything."""
        return truth
