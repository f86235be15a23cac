"""Where the faults of UVA-DSA/openpilot (0.3.8.2, another controller) belong in the shipped target."""

from typing import Any

from mutator.paper.uva_places import FASTEST_SPEED, MANEUVER, PLANT, HookPlace, limit_below_zero

_CONTROLS, _LIB = "selfdrive/controls", "selfdrive/controls/lib"
_CARCONTROLLER = "selfdrive/car/honda/carcontroller.py"
_LANE_FACTOR = 5.5  # the mean of one to ten times the value
_PEDAL_REST_COUNTS = 328
_SET_SPEED_KPH = 97  # in the scenario of the files
_TARGET_SPEED_CAP = "v_target = min(v_target, v_cruise * CV.KPH_TO_MS)"
_ACCELERATION_CAP = "a_target = np.clip(a_target, a_lim[0], a_lim[1])"
_STANDARD_PLANT: tuple[str, ...] = ()


def _lane_error(number: float) -> float:
    return round(number * _LANE_FACTOR, 9)


def _gas_counts(number: float) -> float:
    return number + _PEDAL_REST_COUNTS if number > 0 else 0


def _offset(at: tuple[str, str, str, str], key: str, draw: str, unit: str, **more: Any) -> dict[str, Any]:
    """Return an injection that adds a drawn value; `at` is file, function, kind of anchor and anchor."""
    file, function, kind, name = at
    injection: dict[str, Any] = {"at": {"file": file, "function": function, kind: name}}
    target = more.pop("target", None)
    params = ({"target": target} if target else {}) | {key: draw} | more
    return injection | {"model": "offset", "unit": unit, "params": params}


def _stuck(function: str, name: str) -> dict[str, Any]:
    at = {"file": "selfdrive/car/honda/carcontroller.py", "function": function, "after_assign": name}
    return {"at": at, "model": "stuck", "unit": "counts", "params": {"value_counts": "value"}}


def _vision(name: str, draw: str) -> dict[str, Any]:
    return _offset(
        ("selfdrive/visiond/visiond.py", "Visiond.update", "after_assign", name), "by_m", draw, "m"
    )


def _track(target: str, key: str, draw: str, unit: str, **more: Any) -> dict[str, Any]:
    at = ("selfdrive/controls/radard.py", "Radard._track", "after_assign", "tracks[point.track_id]")
    return _offset(at, key, draw, unit, target=target, **more)


def _radar(name: str, key: str, draw: str, unit: str, **more: Any) -> dict[str, Any]:
    at = ("selfdrive/sim/radar.py", "RadarSensor.measure", "after_assign", name)
    return _offset(at, key, draw, unit, **more)


def _longitudinal(
    function: str, kind: str, name: str, key: str, draw: str, unit: str, **more: Any
) -> dict[str, Any]:
    return _offset((f"{_LIB}/longcontrol.py", f"LongControl.{function}", kind, name), key, draw, unit, **more)


def _limit_at_range(variable: str) -> tuple[str, str]:
    return f"if {variable}>=255:", f"{variable}= 254"


def _place(
    source: str, hook: str, change: str, variant: str, draw: str, *injections: Any, **more: Any
) -> HookPlace:
    about = more.pop("about")
    return HookPlace(
        source=source,
        hook=hook,
        changes=(change,),
        variant=variant,
        draws=(draw,),
        body={"about": about, "injections": list(injections)},
        setting=_STANDARD_PLANT,
        **more,
    )


def _shipped(hook: str, change: str, variant: str, draw: str, limits: tuple[str, ...] = ()) -> HookPlace:
    return HookPlace(
        source=PLANT,
        hook=hook,
        changes=(change,) if change else (),
        limits=limits,
        variant=variant,
        draws=(draw,) if draw else (),
        setting=_STANDARD_PLANT,
    )


def _refused(
    source: str, hook: str, changes: tuple[str, ...], reason: str, limits: tuple[str, ...] = ()
) -> HookPlace:
    return HookPlace(source=source, hook=hook, changes=changes, limits=limits, refusal=reason)


_TRACK = "tracks[ids]"
_LANE_NOTE = (
    "every tenth step starts anew, so the error is one to ten times the value: 5.5 times, the mean, is added"
)
_TRACK_NOTE = "the condition on the track's distance is one on the true distance"
_PLANNED_NOTE = "whether the target is below the set speed is whether a lead limits the plan"
_POLYNOMIAL_NOTE = "the constant of a fitted line moves with all its points"
_NO_A_TARGET = (
    "the place is missing: v0.4.2 plans with an MPC, which has no limits of acceleration behind a lead"
)

EARLIER_PLACES = (
    _place(
        PLANT,
        "d_rel",
        "d_rel+=",
        "radar/chaff",
        "distance_m",
        _radar("d_rel", "by_m", "distance", "m", high_m=254),
        about="The radar measures too long a distance, at most 254 m.",
        limits=_limit_at_range("d_rel"),
    ),
    _shipped("d_rel", "v_rel+=", "radar/invisible_vehicle/speed", "speed_mps"),
    _shipped("d_rel", "d_rel-=", "radar/ghost_vehicle/distance", "distance_m", limit_below_zero("d_rel")),
    _shipped("d_rel", "v_rel-=", "radar/ghost_vehicle/speed", "speed_mps"),
    _shipped("radar_none", "", "radar/jamming/no_data", ""),
    _place(
        f"{_CONTROLS}/radard.py",
        "d_rel",
        f"{_TRACK}.dRel+=",
        "radard/longer",
        "distance_m",
        _track("track.d_rel", "by_m", "distance", "m", high_m=254),
        about="radard takes a track to be too far away, at most 254 m.",
        limits=_limit_at_range(f"{_TRACK}.dRel"),
        note=_TRACK_NOTE,
    ),
    _place(
        f"{_CONTROLS}/radard.py",
        "d_rel",
        f"{_TRACK}.dRel-=",
        "radard/shorter",
        "distance_m",
        _track("track.d_rel", "by_m", "-distance", "m", low_m=0),
        about="radard takes a track to be too near, at least at 0 m.",
        limits=limit_below_zero(f"{_TRACK}.dRel"),
        note=_TRACK_NOTE,
    ),
    _place(
        f"{_CONTROLS}/radard.py",
        "d_rel",
        f"{_TRACK}.vRel+=",
        "radard/faster",
        "speed_mps",
        _track("track.v_rel", "by_mps", "speed", "mps"),
        about="radard takes a track to move away too fast.",
        note=_TRACK_NOTE,
    ),
    _place(
        f"{_CONTROLS}/radard.py",
        "d_rel",
        f"{_TRACK}.vRel-=",
        "radard/slower",
        "speed_mps",
        _track("track.v_rel", "by_mps", "-speed", "mps"),
        about="radard takes a track to approach too fast.",
        note=_TRACK_NOTE,
    ),
    _shipped(
        "speed", "speed2send-=", "car_sensors/speed/slower", "speed_mps", limit_below_zero("speed2send")
    ),
    _shipped("speed", "speed2send+=", "car_sensors/speed/faster", "speed_mps", FASTEST_SPEED),
    _refused(
        PLANT,
        "angle_steer",
        ("self.angle_steer+=",),
        "it turns the simulated wheels themselves, in every step; faults are injected into sensors and "
        "controller, never into the car",
    ),
    _place(
        MANEUVER,
        "md",
        "self.lLane+=",
        "vision_output/left",
        "offset_m",
        _vision("left_lane_y", "offset"),
        about="The left lane line is displaced.",
        value_of=_lane_error,
        note=_LANE_NOTE,
    ),
    _place(
        MANEUVER,
        "md",
        "self.rLane+=",
        "vision_output/right",
        "offset_m",
        _vision("right_lane_y", "offset"),
        about="The right lane line is displaced.",
        value_of=_lane_error,
        note=_LANE_NOTE,
    ),
    HookPlace(
        source=MANEUVER,
        hook="md",
        changes=("self.lLane+=", "self.rLane+="),
        variant="vision_output/pair",
        draws=("left_m", "right_m"),
        body={
            "about": "Each lane line is displaced by a value of its own.",
            "injections": [_vision("left_lane_y", "left"), _vision("right_lane_y", "right")],
        },
        setting=_STANDARD_PLANT,
        value_of=_lane_error,
        note=f"two values; {_LANE_NOTE}",
    ),
    _place(
        _CARCONTROLLER,
        "apply_brake",
        "apply_brake=",
        "car_controller/brake",
        "value_counts",
        _stuck("CarController._pedals", "brake_counts"),
        about="The brake command is stuck.",
    ),
    _place(
        _CARCONTROLLER,
        "apply_gas",
        "apply_gas=",
        "car_controller/gas",
        "value_counts",
        _stuck("CarController._pedals", "gas_counts"),
        about="The gas command is stuck.",
        value_of=_gas_counts,
        note="with the 328 counts of the released pedal, which the original adds afterwards",
    ),
    _place(
        _CARCONTROLLER,
        "apply_steer",
        "apply_steer=",
        "car_controller/steer",
        "value_counts",
        _stuck("CarController.update", "torque"),
        about="The steering command is stuck.",
    ),
    _refused(f"{_LIB}/adaptivecruise.py", "a_target", ("a_target+=",), _NO_A_TARGET, (_ACCELERATION_CAP,)),
    _refused(f"{_LIB}/adaptivecruise.py", "a_targetH2", ("a_target-=",), _NO_A_TARGET, (_ACCELERATION_CAP,)),
    _place(
        f"{_LIB}/longcontrol.py",
        "v_target",
        "v_target+=",
        "long_control/target_higher",
        "speed_mps",
        _longitudinal(
            "_follow", "after_assign", "self.v_pid", "by_mps", "speed", "mps", high_kph=_SET_SPEED_KPH
        ),
        about="The target speed is too high, up to the set speed.",
        limits=(_TARGET_SPEED_CAP,),
        note=f"{_PLANNED_NOTE}; the set speed is 97 km/h",
    ),
    _place(
        f"{_LIB}/longcontrol.py",
        "v_target",
        "v_target-=",
        "long_control/target_lower",
        "speed_mps",
        _longitudinal("_follow", "after_assign", "self.v_pid", "by_mps", "-speed", "mps", low_mps=0),
        about="The target speed is too low.",
        limits=limit_below_zero("v_target"),
        note=_PLANNED_NOTE,
    ),
    _place(
        f"{_LIB}/longcontrol.py",
        "output_gb",
        "output_gb+=",
        "long_control/output_higher",
        "output",
        _longitudinal("update", "before_return", "", "by", "output", "1", target="self.output"),
        about="The output of gas and brake is too high.",
        note=_PLANNED_NOTE,
    ),
    _place(
        f"{_LIB}/longcontrol.py",
        "output_gb",
        "output_gb-=",
        "long_control/output_lower",
        "output",
        _longitudinal("update", "before_return", "", "by", "-output", "1", target="self.output"),
        about="The output of gas and brake is too low.",
        note=_PLANNED_NOTE,
    ),
    _place(
        f"{_LIB}/pathplanner.py",
        "plr_poly",
        "p_poly[3]+=",
        "path_planner/path",
        "offset_m",
        _vision("path_y", "offset"),
        about="The model's path is displaced.",
        note=_POLYNOMIAL_NOTE,
    ),
    _place(
        f"{_LIB}/pathplanner.py",
        "plr_poly",
        "l_poly[3]+=",
        "path_planner/left",
        "offset_m",
        _vision("left_lane_y", "offset"),
        about="The left lane line is displaced.",
        note=_POLYNOMIAL_NOTE,
    ),
    _place(
        f"{_LIB}/pathplanner.py",
        "plr_poly",
        "r_poly[3]+=",
        "path_planner/right",
        "offset_m",
        _vision("right_lane_y", "offset"),
        about="The right lane line is displaced.",
        note=_POLYNOMIAL_NOTE,
    ),
    _place(
        f"{_LIB}/pathplanner.py",
        "d_poly",
        "self.d_poly[3]+=",
        "path_planner/followed_path",
        "offset_m",
        _offset(
            (f"{_LIB}/predicted_path.py", "model_curve", "value", "value(poly, x)"), "by_m", "offset", "m"
        ),
        _offset(
            (f"{_LIB}/vision_point.py", "VisionPoint.best_match", "after_assign", "y_rel"),
            "by_m",
            "offset",
            "m",
        ),
        about="The path by which radard selects leads is displaced.",
        note="where the path is used: for tracks and for the camera's lead",
    ),
    _place(
        f"{_LIB}/latcontrol.py",
        "angle_steers_des",
        "self.angle_steers_des+=",
        "lat_control/angle",
        "angle_deg",
        _offset(
            (f"{_LIB}/latcontrol.py", "LatControl.plan", "after_assign", "self.angle_desired"),
            "by_deg",
            "angle",
            "rad",
        ),
        about="The desired steering angle is wrong.",
    ),
    _place(
        f"{_LIB}/latcontrol.py",
        "output_steer",
        "output_steer+=",
        "lat_control/output",
        "output",
        _offset(
            (f"{_LIB}/latcontrol.py", "LatControl.update", "result", "self._pid.update"), "by", "output", "1"
        ),
        about="The steering output is wrong.",
    ),
    _shipped("md_none", "", "vision_output/camera_unavailable/no_data", ""),
    _refused(
        MANEUVER,
        "visionFault",
        (),  # values of another file instead of numbers
        "the lane positions are in a file of the authors' lane detector that is not published",
    ),
)
