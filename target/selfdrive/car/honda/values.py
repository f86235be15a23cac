"""Buses, codes and message rates of the car's electronics."""

from pathlib import Path

from selfdrive.can.parser import ExpectedMessage

CAR_BUS = 0
RADAR_BUS = 1
CAR_DBC = Path(__file__).parent / "honda_civic_touring_2016.dbc"
RADAR_DBC = Path(__file__).parent / "nidec_radar.dbc"


class CruiseButton:
    """Codes of SCM_BUTTONS.CRUISE_BUTTONS."""

    NONE = 0
    MAIN = 1
    CANCEL = 2
    DECEL_SET = 3
    RES_ACCEL = 4


GEAR_NAME_BY_CODE = {1: "park", 2: "reverse", 4: "neutral", 8: "drive", 16: "sport", 32: "low"}
GEAR_CODE_BY_NAME = {name: code for code, name in GEAR_NAME_BY_CODE.items()}

STEER_STATUS_NORMAL = 0
STEER_STATUS_FAULT = 5  # assumed until the EPS reports otherwise
STEER_STATUSES_WITHOUT_FAULT = (0, 2, 3, 4, 6)  # the EPS might temporarily refuse torque, but is not broken

RADAR_STATE_GOOD = 0x79  # the radar's state in normal operation
NO_TRACK_DISTANCE = 255.0  # m; at this distance or more, there is no track

STEER_COUNTS = 0x1000  # sent for a demand of 1
STEER_FULL_COUNTS = 0xF00  # full torque for the EPS
BRAKE_COUNTS = 256  # full brake
PEDAL_COUNTS = 1004  # of the pedal interceptor for a demand of 1
PEDAL_REST_COUNTS = 328  # counts of a released pedal, added to every demand
STEER_OVERRIDE_TORQUE = 1200  # counts; above this, the driver's hands are on the wheel

# The messages that the controller reads. Some, such as STEER_STATUS, start in their unsafe state.
CAR_MESSAGES = {
    "ENGINE_DATA": ExpectedMessage(("XMISSION_SPEED",), 100),
    "WHEEL_SPEEDS": ExpectedMessage(
        ("WHEEL_SPEED_FL", "WHEEL_SPEED_FR", "WHEEL_SPEED_RL", "WHEEL_SPEED_RR"), 100
    ),
    "STEERING_SENSORS": ExpectedMessage(("STEER_ANGLE", "STEER_ANGLE_RATE"), 100),
    "STEER_STATUS": ExpectedMessage(("STEER_TORQUE_SENSOR", "STEER_STATUS"), 100, (0, STEER_STATUS_FAULT)),
    "POWERTRAIN_DATA": ExpectedMessage(("PEDAL_GAS", "ACC_STATUS", "BRAKE_SWITCH", "BRAKE_PRESSED"), 100),
    "GEARBOX": ExpectedMessage(("GEAR_SHIFTER",), 50),
    "VSA_STATUS": ExpectedMessage(("ESP_DISABLED", "BRAKE_HOLD_ACTIVE"), 50, (1, 0)),
    "STANDSTILL": ExpectedMessage(("WHEELS_MOVING", "BRAKE_ERROR_1", "BRAKE_ERROR_2"), 50, (1, 0, 0)),
    "EPB_STATUS": ExpectedMessage(("EPB_STATE",), 10),
    "SCM_BUTTONS": ExpectedMessage(("CRUISE_BUTTONS", "CRUISE_SETTING"), 25),
    "SCM_FEEDBACK": ExpectedMessage(("MAIN_ON", "LEFT_BLINKER", "RIGHT_BLINKER"), 10),
    "SEATBELT_STATUS": ExpectedMessage(("SEATBELT_DRIVER_LAMP", "SEATBELT_DRIVER_LATCHED"), 10, (1, 0)),
    "CRUISE": ExpectedMessage(("CRUISE_SPEED_PCM",), 10),
    "DOORS_STATUS": ExpectedMessage(
        ("DOOR_OPEN_FL", "DOOR_OPEN_FR", "DOOR_OPEN_RL", "DOOR_OPEN_RR"), 10, (1, 1, 1, 1)
    ),
}

RADAR_MESSAGES = {
    "RADAR_DIAGNOSTIC": ExpectedMessage(("RADAR_STATE",), 20),
    "TRACK_15": ExpectedMessage(("LONG_DIST", "LAT_DIST", "REL_SPEED"), 20),
}

COMMAND_MESSAGES = {
    "STEERING_CONTROL": ExpectedMessage(("STEER_TORQUE", "STEER_TORQUE_REQUEST"), 100),
    "BRAKE_COMMAND": ExpectedMessage(("COMPUTER_BRAKE",), 50),
    "GAS_COMMAND": ExpectedMessage(("GAS_COMMAND",), 50),
}
