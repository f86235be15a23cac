"""Where the faults of UVA-DSA/OpenpilotWithVision (openpilot v0.4.2) belong in the shipped target: the map
from hooks to places.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

PLANT, MANEUVER = "selfdrive/test/plant/plant.py", "selfdrive/test/plant/maneuver.py"
_REFERENCE = ("reference_plant",)
_CODED_CAMERA = ("pictures", "reference_plant", "coded_detector", "coded_translation")
EFFECT, LEVEL = "self.effect", "self.thickness"


def unchanged(number: float) -> float:
    return number


def _contrast_gain(level: float) -> float:
    return round(1.0 + 0.2 * level, 1)


def _brightness_bias(level: float) -> float:
    return 10 * level


@dataclass(frozen=True, slots=True, kw_only=True)
class HookPlace:
    """What lines at one hook become, if they change these variables and have these limits.

    `variant` is a variant of the library that ships with mutator, whose injections the faults have; else
    `body` has them, and `variant` names the new variant. `draws` are the keys of the values, one for each
    change; `value_of` converts a number of the file. A `refusal` says why the lines are not imported. `note`
    says what differs.
    """

    source: str
    hook: str
    changes: tuple[str, ...]  # variable and operator: `v_rel+=`
    limits: tuple[str, ...] = ()
    effect: int | None = None  # the number assigned to the first variable, which then is no value
    variant: str = ""
    draws: tuple[str, ...] = ()
    body: Mapping[str, Any] = field(default_factory=dict)
    setting: tuple[str, ...] = _REFERENCE
    value_of: Callable[[float], float] = unchanged
    refusal: str = ""
    note: str = ""

    @property
    def is_in_shipped_library(self) -> bool:
        return not self.body and not self.refusal


def _drift(name: str, draw: str) -> dict[str, Any]:
    at = {"file": "selfdrive/visiond/visiond.py", "function": "Visiond.update", "after_assign": name}
    params = {"per_step_m": draw, "stays": True, "after_first": True}
    return {"at": at, "model": "drift", "unit": "m", "params": params}


def limit_below_zero(variable: str) -> tuple[str, str]:
    return f"if {variable}<0:", f"{variable}= 0"


FASTEST_SPEED = ("if speed2send>=85.0:", "speed2send= 85.0")
_LANE_NOTE = "the value is added again in every step and stays, from the step after the trigger"


def _picture(
    effect: int, variant: str, draw: str, value_of: Callable[[float], float] = unchanged
) -> HookPlace:
    return HookPlace(
        source=MANEUVER,
        hook="visionFault",
        changes=(f"{EFFECT}=", f"{LEVEL}="),
        effect=effect,
        variant=variant,
        draws=(draw,),
        setting=_CODED_CAMERA,
        value_of=value_of,
        note="latches: once set, the effect stays to the end",
    )


def _input(hook: str, change: str, variant: str, draw: str, limits: tuple[str, ...] = ()) -> HookPlace:
    return HookPlace(
        source=PLANT, hook=hook, changes=(change,), limits=limits, variant=variant, draws=(draw,)
    )


VISION_PLACES = (
    _input("radar_dRel", "radar_dRel+=", "radar/chaff/distance", "distance_m"),
    _input("radar_dRel", "v_rel+=", "radar/invisible_vehicle/speed", "speed_mps"),
    _input(
        "radar_dRel",
        "radar_dRel-=",
        "radar/ghost_vehicle/distance",
        "distance_m",
        limit_below_zero("radar_dRel"),
    ),
    _input("radar_dRel", "v_rel-=", "radar/ghost_vehicle/speed", "speed_mps"),
    HookPlace(
        source=PLANT,
        hook="radar_none",
        changes=(),
        variant="radar/jamming/no_data",
        note="all CAN data are missing, not only the radar's",
    ),
    _input("speed", "speed2send-=", "car_sensors/speed/slower", "speed_mps", limit_below_zero("speed2send")),
    _input("speed", "speed2send+=", "car_sensors/speed/faster", "speed_mps", FASTEST_SPEED),
    _input("angle_steer", "angle_steer2send+=", "car_sensors/steer/angle", "angle_rad"),
    HookPlace(
        source=MANEUVER,
        hook="md",
        changes=("self.lLane+=",),
        variant="vision_output/path_model/left",
        draws=("offset_m",),
        note=_LANE_NOTE,
    ),
    HookPlace(
        source=MANEUVER,
        hook="md",
        changes=("self.rLane+=",),
        variant="vision_output/path_model/right",
        draws=("offset_m",),
        note=_LANE_NOTE,
    ),
    HookPlace(
        source=MANEUVER,
        hook="md",
        changes=("self.lLane+=", "self.rLane+="),
        variant="vision_output/path_model/pair",
        draws=("left_m", "right_m"),
        body={
            "about": "Each lane line is displaced by a value of its own.",
            "injections": [_drift("left_lane_y", "left"), _drift("right_lane_y", "right")],
        },
        note=f"two values; {_LANE_NOTE}",
    ),
    HookPlace(source=PLANT, hook="md_none", changes=(), variant="vision_output/camera_unavailable/no_data"),
    _picture(1, "vision_input/rain/thickness", "thickness"),
    _picture(2, "vision_input/fog/thickness", "thickness"),
    _picture(3, "vision_input/snow/thickness", "thickness"),
    _picture(4, "vision_input/occlusion/blobs", "blobs"),
    _picture(5, "vision_input/contrast/gain", "gain", _contrast_gain),
    _picture(6, "vision_input/brightness/bias", "bias", _brightness_bias),
    _picture(7, "vision_input/blur/averaging", "kernel_px"),
    _picture(8, "vision_input/blur/gaussian", "kernel_px"),
    _picture(9, "vision_input/blur/median", "kernel_px"),
    _input("vision_dRel", "vision_dRel+=", "vision_output/relative_distance/longer", "distance_m"),
    _input(
        "vision_dRel",
        "vision_dRel-=",
        "vision_output/relative_distance/shorter",
        "distance_m",
        limit_below_zero("vision_dRel"),
    ),
    _input("RadVis_dRel", "d_rel+=", "radar_vision/relative_distance/longer", "distance_m"),
    _input(
        "RadVis_dRel",
        "d_rel-=",
        "radar_vision/relative_distance/shorter",
        "distance_m",
        limit_below_zero("d_rel"),
    ),
)
