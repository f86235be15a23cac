"""Scenarios: host, lead, driver and road. Read from YAML; SI units inside."""

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from selfdrive.car.honda.values import CruiseButton
from selfdrive.common.conversions import KPH_TO_MS, MPH_TO_MS
from selfdrive.common.errors import ConfigError
from selfdrive.common.realtime import DT_CTRL
from selfdrive.sim.road import PiecewiseTable
from selfdrive.sim.yaml_section import YamlSection, read_yaml

SCHEMA = "scenario/1"
PLANTS = STANDARD_PLANT, REFERENCE_PLANT = "standard", "reference"
BUTTON_CODES = {
    "cancel": CruiseButton.CANCEL,
    "decel_set": CruiseButton.DECEL_SET,
    "res_accel": CruiseButton.RES_ACCEL,
}
SPEED_UNITS = {"mps": 1.0, "kph": KPH_TO_MS, "mph": MPH_TO_MS}

_EXPECTED_AND_REMEDY_OF_PLANT = (
    "a straight road and a start in mid-lane for the reference plant",
    "use the standard plant",
)

MOST_SPEED = 400.0  # in any speed unit
MOST_SECONDS = 600.0  # s
MOST_DISTANCE = 1e5  # m

_SPEED_KEYS = {f"speed_{unit}": f"a speed in {unit}" for unit in SPEED_UNITS}
SCENARIO_KEYS = {
    "schema": f"the format of this file, {SCHEMA}",
    "name": "the scenario's short name",
    "title": "what happens, in one line",
    "duration_s": "the length of the run in seconds, a whole number of 10 ms steps",
    "host": "the controlled car at the start",
    "lead": "the vehicle ahead; without it, the road is free",
    "buttons": "cruise buttons the driver presses",
    "plant": "standard (the default), or reference: the original's simulator with its errors",
    "road": "grade and curvature; by default, the road is flat and straight",
}
HOST_KEYS = {**_SPEED_KEYS, "lateral_offset_m": "the distance from the lane's middle in m, left positive"}
LEAD_KEYS = {
    "gap_m": "the distance to the lead's rear in m at the start",
    **_SPEED_KEYS,
    "at_s": "the times of the speeds in seconds",
}
BUTTON_KEYS = {
    "button": f"one of {', '.join(BUTTON_CODES)}",
    "press_s": "the time of pressing in seconds",
    "release_s": "the time of release in seconds",
}
ROAD_KEYS = {"grade": "slope over time", "curvature": "bends over distance"}
GRADE_KEYS = {
    "at_s": "times in seconds",
    "mps2": "deceleration due to the slope, uphill positive",
}
CURVATURE_KEYS = {"at_m": "distances along the road in m", "per_m": "curvature in 1/m, left positive"}


@dataclass(frozen=True, slots=True, kw_only=True)
class LeadMotion:
    """The lead's initial gap (m), and its speeds (m/s) at times (s), interpolated linearly."""

    gap: float
    times: tuple[float, ...]
    speeds: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ButtonPress:
    """A cruise button held from step `press` until step `release`."""

    button_code: int
    press_step: int
    release_step: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A scenario in SI units. `lead` is None on a free road; `digest` is the file's SHA-256."""

    name: str
    title: str
    digest: str
    steps: int
    speed: float  # m/s
    lateral_offset: float  # m
    lead: LeadMotion | None
    buttons: tuple[ButtonPress, ...]
    grade: PiecewiseTable | None
    curvature: PiecewiseTable | None
    plant: str = STANDARD_PLANT

    def button(self, frame: int) -> int:
        for press in self.buttons:
            if press.press_step <= frame < press.release_step:
                return press.button_code
        return CruiseButton.NONE


def load_scenario(path: Path) -> Scenario:
    """Read a scenario file. Raises ConfigError if it is invalid."""
    try:
        data = path.read_bytes()
        text = data.decode()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ConfigError(
            f"{reason}", where=str(path), expected="a readable scenario file", remedy="check the path"
        ) from None
    return parse_scenario(text, str(path), sha256(data).hexdigest())


def parse_scenario(text: str, where: str, digest: str) -> Scenario:
    root = read_yaml(text, where, SCENARIO_KEYS)
    root.text("schema", (SCHEMA,))
    host = root.section("host", HOST_KEYS)
    grade, curvature = _parse_road(root)
    scenario = Scenario(
        name=root.text("name"),
        title=root.text("title"),
        digest=digest,
        steps=_parse_step(root, "duration_s", DT_CTRL),
        speed=_parse_host_speed(host),
        lateral_offset=host.number("lateral_offset_m", -10.0, 10.0, default=0.0),
        lead=_parse_lead(root.section("lead", LEAD_KEYS)) if "lead" in root else None,
        buttons=_parse_buttons(root) if "buttons" in root else (),
        grade=grade,
        curvature=curvature,
    )
    if "plant" not in root:
        return scenario
    plant = root.text("plant", PLANTS)
    root.check("plant", _is_possible_on(scenario, plant), *_EXPECTED_AND_REMEDY_OF_PLANT)
    return replace(scenario, plant=plant)


def with_plant(scenario: Scenario, plant: str) -> Scenario:
    """Return the scenario on the named plant. Raises ConfigError if the plant does not support its road."""
    if not _is_possible_on(scenario, plant):
        expected, remedy = _EXPECTED_AND_REMEDY_OF_PLANT
        raise ConfigError(f"{scenario.name} on the plant {plant!r}", expected=expected, remedy=remedy)
    return replace(scenario, plant=plant)


def _is_possible_on(scenario: Scenario, plant: str) -> bool:
    return plant != REFERENCE_PLANT or not (scenario.curvature or scenario.lateral_offset)


def _parse_host_speed(section: YamlSection) -> float:
    key = section.key_with_unit("speed", tuple(SPEED_UNITS))
    return section.number(key, 0.0, MOST_SPEED) * SPEED_UNITS[key.removeprefix("speed_")]


def _parse_lead(section: YamlSection) -> LeadMotion:
    key = section.key_with_unit("speed", tuple(SPEED_UNITS))
    factor = SPEED_UNITS[key.removeprefix("speed_")]
    if section.is_list(key):
        speeds = section.numbers(key, 0.0, MOST_SPEED)
        times = section.ascending_numbers("at_s", 0.0, MOST_SECONDS)
        section.check("at_s", len(times) == len(speeds), f"{len(speeds)} times", "give one for each speed")
    else:
        speeds, times = (section.number(key, 0.0, MOST_SPEED),), (0.0,)
        if "at_s" in section:
            section.check("at_s", False, "no times for a single speed", "remove it, or give a list of speeds")
    gap = section.number("gap_m", 0.0, MOST_DISTANCE)
    return LeadMotion(gap=gap, times=times, speeds=tuple(speed * factor for speed in speeds))


def _parse_buttons(root: YamlSection) -> tuple[ButtonPress, ...]:
    presses: list[ButtonPress] = []
    for section in root.sections("buttons", BUTTON_KEYS):
        press, release = _parse_step(section, "press_s"), _parse_step(section, "release_s")
        section.check("release_s", release > press, "a time after press_s", "release it later")
        if presses:
            is_after_release = press >= presses[-1].release_step
            section.check(
                "press_s", is_after_release, "a time after the last release", "list presses in order"
            )
        presses.append(
            ButtonPress(
                button_code=BUTTON_CODES[section.text("button", tuple(BUTTON_CODES))],
                press_step=press,
                release_step=release,
            )
        )
    return tuple(presses)


def _parse_road(root: YamlSection) -> tuple[PiecewiseTable | None, PiecewiseTable | None]:
    if "road" not in root:
        return None, None
    road = root.section("road", ROAD_KEYS)
    grade = curvature = None
    if "grade" in road:
        section = road.section("grade", GRADE_KEYS)
        grade = _parse_table(
            section,
            "at_s",
            section.ascending_numbers("at_s", 0.0, MOST_SECONDS),
            section.numbers("mps2", -5.0, 5.0),
        )
    if "curvature" in road:
        section = road.section("curvature", CURVATURE_KEYS)
        places = section.ascending_numbers("at_m", 0.0, MOST_DISTANCE)
        curvature = _parse_table(section, "at_m", places, section.numbers("per_m", -0.05, 0.05))
    return grade, curvature


def _parse_table(
    section: YamlSection, key: str, at: tuple[float, ...], values: tuple[float, ...]
) -> PiecewiseTable:
    section.check(key, len(at) == len(values), f"{len(values)} numbers", "give one for each value")
    return at, values


def _parse_step(section: YamlSection, key: str, earliest: float = 0.0) -> int:
    steps = section.number(key, earliest, MOST_SECONDS) / DT_CTRL
    section.check(key, abs(steps - round(steps)) < 1e-6, "a multiple of 0.01", "a step is 10 ms")
    return round(steps)
