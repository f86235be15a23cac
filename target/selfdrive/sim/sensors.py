"""The car's own sensors and switches, as reported on the car bus."""

from selfdrive.can.dbc import load_dbc
from selfdrive.can.packer import MessagePacker
from selfdrive.car.honda.values import CAR_BUS, CAR_DBC, GEAR_CODE_BY_NAME
from selfdrive.common.conversions import MS_TO_KPH, RAD_TO_DEG
from selfdrive.messages import CanFrame
from selfdrive.sim.truth import GroundTruth

STANDSTILL_SPEED = 0.3  # m/s; below this the speed reads 0 although the wheels turn

# Constant signals, by period in steps: doors closed, seat belt fastened, gear in drive, main switch on.
_RELEASED_PEDALS = {"PEDAL_GAS": 0, "BRAKE_SWITCH": 0, "BRAKE_PRESSED": 0}
_PRESSED_BRAKE = {"PEDAL_GAS": 0, "BRAKE_SWITCH": 1, "BRAKE_PRESSED": 1}
_CONSTANT_SIGNALS = {
    1: {
        "STEER_STATUS": {"STEER_TORQUE_SENSOR": 0, "STEER_STATUS": 0},
        "POWERTRAIN_DATA": _RELEASED_PEDALS,
    },
    2: {
        "GEARBOX": {"GEAR_SHIFTER": GEAR_CODE_BY_NAME["drive"]},
        "VSA_STATUS": {"ESP_DISABLED": 0, "BRAKE_HOLD_ACTIVE": 0},
    },
    10: {
        "EPB_STATUS": {"EPB_STATE": 0},
        "SCM_FEEDBACK": {"MAIN_ON": 1, "LEFT_BLINKER": 0, "RIGHT_BLINKER": 0},
        "SEATBELT_STATUS": {"SEATBELT_DRIVER_LAMP": 0, "SEATBELT_DRIVER_LATCHED": 1},
        "CRUISE": {"CRUISE_SPEED_PCM": 0},
        "DOORS_STATUS": {"DOOR_OPEN_FL": 0, "DOOR_OPEN_FR": 0, "DOOR_OPEN_RL": 0, "DOOR_OPEN_RR": 0},
    },
}
_COUNTERS = 4  # values of the two-bit counter, so a constant message has four frames


class CarSensors:
    """Measures the car in each 10 ms step. The gearbox reports `gearbox_scale` times the speed."""

    def __init__(self, gearbox_scale: float = 1.0) -> None:
        self._gearbox_scale = gearbox_scale
        messages = load_dbc(CAR_DBC)
        self._gearbox_speed = MessagePacker(messages["ENGINE_DATA"], ("XMISSION_SPEED",), CAR_BUS)
        wheels = [f"WHEEL_SPEED_{corner}" for corner in ("FL", "FR", "RL", "RR")]
        self._wheel_speeds = MessagePacker(messages["WHEEL_SPEEDS"], wheels, CAR_BUS)
        self._steering = MessagePacker(
            messages["STEERING_SENSORS"], ("STEER_ANGLE", "STEER_ANGLE_RATE"), CAR_BUS
        )
        self._standstill = MessagePacker(messages["STANDSTILL"], ("WHEELS_MOVING",), CAR_BUS)
        self._buttons = MessagePacker(messages["SCM_BUTTONS"], ("CRUISE_BUTTONS",), CAR_BUS)
        constant = [(period, _constant_frames(names)) for period, names in _CONSTANT_SIGNALS.items()]
        pressed = _constant_frames(_CONSTANT_SIGNALS[1] | {"POWERTRAIN_DATA": _PRESSED_BRAKE})
        self._constant, self._with_pressed_brake = constant, [(1, pressed), *constant[1:]]

    def measure(
        self, truth: GroundTruth, button: int, frame: int, brake_pedal: float = 0.0
    ) -> list[CanFrame]:
        """Return all frames of step `frame`; `button` is the cruise button held (CruiseButton), `brake_pedal`
        is 1 while the driver brakes.
        """
        speed = truth.v_ego if truth.v_ego >= STANDSTILL_SPEED else 0.0
        speed_kph = speed * MS_TO_KPH
        steer_angle = truth.steer_angle
        steer_angle_deg = steer_angle * RAD_TO_DEG
        steer_rate_deg = truth.steer_rate * RAD_TO_DEG
        frames = [
            self._gearbox_speed.pack((speed_kph * self._gearbox_scale,), frame),
            self._wheel_speeds.pack((speed_kph, speed_kph, speed_kph, speed_kph)),
            self._steering.pack((steer_angle_deg, steer_rate_deg), frame),
            self._buttons.pack((button,), frame),
            self._standstill.pack((truth.v_ego > 0.0,), frame),
        ]
        for period, by_counter in self._with_pressed_brake if brake_pedal else self._constant:
            if frame % period == 0:
                frames += by_counter[frame // period % _COUNTERS]
        return frames


def _constant_frames(values: dict[str, dict[str, int]]) -> list[list[CanFrame]]:
    messages = load_dbc(CAR_DBC)
    packers = [
        (MessagePacker(messages[name], tuple(v), CAR_BUS), tuple(v.values())) for name, v in values.items()
    ]
    return [[packer.pack(v, counter) for packer, v in packers] for counter in range(_COUNTERS)]
