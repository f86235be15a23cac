"""Scenarios: host, lead, driver and road. Read from YAML; SI units inside."""

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from selfdrive.car.honda.values import CruiseButton
from selfdrive.common.conversions import KPH_TO_MS, MPH_TO_MS
from selfdrive.common.errors import ConfigError
from selfdrive.common.realtime import DT_CTRL
from selfdrive.sim.road import Table
from selfdrive.sim.yaml_section import Section, read_yaml

SCHEMA = "scenario/1"
PLANTS = STANDARD, REFERENCE = "standard", "reference"
BUTTONS = {
    "cancel": CruiseButton.CANCEL,
    "decel_set": CruiseButton.DECEL_SET,
    "res_accel": CruiseButton.RES_ACCEL,
}
SPEED_UNITS = {"mps": 1.0, "kph": KPH_TO_MS, "mph": MPH_TO_MS}

_ONLY_STRAIGHT = (
    "a straight road and a start in mid-lane for the reference plant",
    "use the standard plant",
)

FASTEST = 400.0  # in any speed unit
LONGEST = 600.0  # s
FARTHEST = 1e5  # m

_SPEED_KEYS = {f"speed_{unit}": f"a speed in {unit}" for unit in SPEED_UNITS}
KEYS = {
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
    "button": f"one of {', '.join(BUTTONS)}",
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
class Lead:
    """The lead's initial gap (m), and its speeds (m/s) at times (s), interpolated linearly."""

    gap: float
    times: tuple[float, ...]
    speeds: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ButtonPress:
    """A cruise button held from step `press` until step `release`."""

    code: int
    press: int
    release: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A scenario in SI units. `lead` is None on a free road; `digest` is the file's SHA-256."""

    name: str
    title: str
    digest: str
    steps: int
    speed: float  # m/s
    lateral_offset: float  # m
    lead: Lead | None
    buttons: tuple[ButtonPress, ...]
    grade: Table | None
    curvature: Table | None
    plant: str = STANDARD

    def button(self, frame: int) -> int:
        for press in self.buttons:
            if press.press <= frame < press.release:
                return press.code
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
    root = read_yaml(text, where, KEYS)
    root.text("schema", (SCHEMA,))
    host = root.section("host", HOST_KEYS)
    grade, curvature = _road(root)
    scenario = Scenario(
        name=root.text("name"),
        title=root.text("title"),
        digest=digest,
        steps=_step(root, "duration_s", DT_CTRL),
        speed=_host_speed(host),
        lateral_offset=host.number("lateral_offset_m", -10.0, 10.0, default=0.0),
        lead=_lead(root.section("lead", LEAD_KEYS)) if "lead" in root else None,
        buttons=_buttons(root) if "buttons" in root else (),
        grade=grade,
        curvature=curvature,
    )
    if "plant" not in root:
        return scenario
    plant = root.text("plant", PLANTS)
    root.check("plant", _possible(scenario, plant), *_ONLY_STRAIGHT)
    return replace(scenario, plant=plant)


def on_plant(scenario: Scenario, plant: str) -> Scenario:
    """Return the scenario on the named plant. Raises ConfigError if the plant does not support its road."""
    if not _possible(scenario, plant):
        expected, remedy = _ONLY_STRAIGHT
        raise ConfigError(f"{scenario.name} on the plant {plant!r}", expected=expected, remedy=remedy)
    return replace(scenario, plant=plant)


def _possible(scenario: Scenario, plant: str) -> bool:
    return plant != REFERENCE or not (scenario.curvature or scenario.lateral_offset)


def _host_speed(section: Section) -> float:
    key = section.quantity("speed", tuple(SPEED_UNITS))
    return section.number(key, 0.0, FASTEST) * SPEED_UNITS[key.removeprefix("speed_")]


def _lead(section: Section) -> Lead:
    key = section.quantity("speed", tuple(SPEED_UNITS))
    factor = SPEED_UNITS[key.removeprefix("speed_")]
    if section.is_list(key):
        speeds = section.numbers(key, 0.0, FASTEST)
        times = section.ascending("at_s", 0.0, LONGEST)
        section.check("at_s", len(times) == len(speeds), f"{len(speeds)} times", "give one for each speed")
    else:
        speeds, times = (section.number(key, 0.0, FASTEST),), (0.0,)
        if "at_s" in section:
            section.check("at_s", False, "no times for a single speed", "remove it, or give a list of speeds")
    gap = section.number("gap_m", 0.0, FARTHEST)
    return Lead(gap=gap, times=times, speeds=tuple(speed * factor for speed in speeds))


def _buttons(root: Section) -> tuple[ButtonPress, ...]:
    presses: list[ButtonPress] = []
    for section in root.sections("buttons", BUTTON_KEYS):
        press, release = _step(section, "press_s"), _step(section, "release_s")
        section.check("release_s", release > press, "a time after press_s", "release it later")
        if presses:
            ready = press >= presses[-1].release
            section.check("press_s", ready, "a time after the last release", "list presses in order")
        presses.append(
            ButtonPress(code=BUTTONS[section.text("button", tuple(BUTTONS))], press=press, release=release)
        )
    return tuple(presses)


def _road(root: Section) -> tuple[Table | None, Table | None]:
    if "road" not in root:
        return None, None
    road = root.section("road", ROAD_KEYS)
    grade = curvature = None
    if "grade" in road:
        section = road.section("grade", GRADE_KEYS)
        grade = _table(
            section, "at_s", section.ascending("at_s", 0.0, LONGEST), section.numbers("mps2", -5.0, 5.0)
        )
    if "curvature" in road:
        section = road.section("curvature", CURVATURE_KEYS)
        places = section.ascending("at_m", 0.0, FARTHEST)
        curvature = _table(section, "at_m", places, section.numbers("per_m", -0.05, 0.05))
    return grade, curvature


def _table(section: Section, key: str, at: tuple[float, ...], values: tuple[float, ...]) -> Table:
    section.check(key, len(at) == len(values), f"{len(values)} numbers", "give one for each value")
    return at, values


def _step(section: Section, key: str, earliest: float = 0.0) -> int:
    steps = section.number(key, earliest, LONGEST) / DT_CTRL
    section.check(key, abs(steps - round(steps)) < 1e-6, "a multiple of 0.01", "a step is 10 ms")
    return round(steps)
