"""Recomputes what sentences about the shipped target say from traces alone.

It shares no code with `mutator`: the sentence is read with patterns, and each number and direction is
computed anew from the channels of the faulty and the golden run.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Channels = Mapping[str, np.ndarray]
_SLACK = 1e-6
_NUMBER = r"(-?[0-9.]+(?:e-?[0-9]+)?)"
# what the actuators do first, and the channel and the sign that this means
_DIRECTIONS = {
    "gives more gas": ("gas", 1), "gives less gas": ("gas", -1),
    "brakes harder": ("brake", 1), "brakes less": ("brake", -1), "brakes to": ("brake", 1),
    "steers further left": ("steer_torque", 1), "steers further right": ("steer_torque", -1),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The traces of an experiment, when its fault was first active (s; None: never), its alerts, its plan."""

    faulty: Channels
    golden: Channels
    activation_s: float | None
    alerts: Sequence[tuple[str, float]]
    value: float | None  # of the fault
    condition: str
    is_ok: bool = True


def wrong_claims(sentence: str, drive: Drive) -> list[str]:
    """Return what the sentence says that the traces do not show, and what it leaves out."""
    return list(_wrong_claims(sentence, drive))


def _wrong_claims(sentence: str, drive: Drive) -> Iterator[str]:
    if drive.value is not None:
        clause = re.split(" from | while | once ", sentence)[0]
        said_values = [float(text) for text in re.findall(_NUMBER, clause)]
        if not any(math.isclose(said, abs(drive.value)) for said in said_values):
            yield f"no value {drive.value}"
    if not drive.is_ok:
        return
    start = drive.activation_s
    if (start is None) != sentence.startswith("Planned:"):
        yield "active or not"
    if start is None:
        if _first_difference(drive, 0.0) is not None:
            yield "the traces differ, but nothing was active"
        return
    first_time = re.search(rf" from {_NUMBER} s", sentence)
    if not first_time or not _is_time(float(first_time[1]), start):
        yield f"active from {start}"
    if not _holds(drive, start):
        yield f"the condition {drive.condition} does not hold at {start}"
    yield from _wrong_hazards(sentence, drive, start)
    yield from _wrong_reaction(sentence, drive, start)
    yield from _wrong_alert(sentence, drive, start)


def _hazard_times(drive: Drive, start: float) -> dict[str, float]:
    """Return the hazards and their times from `start` on, earliest first."""
    run = drive.faulty
    aside, moved = np.abs(run["lateral_offset"]), np.maximum.accumulate(run["v_ego"] >= 0.3)
    holds = {
        "touches": (run["d_rel"] <= 0.0) & (aside <= 2.75),
        "stops": moved & (run["v_ego"] < 0.3) & (run["d_rel"] >= 100.0),
        "leaves": aside > 0.95,
    }
    times = {name: float(run["t"][steps.argmax()]) for name, steps in holds.items() if steps.any()}
    later = {name: time for name, time in times.items() if time >= start - _SLACK}
    return dict(sorted(later.items(), key=lambda item: item[1]))


def _wrong_hazards(sentence: str, drive: Drive, start: float) -> Iterator[str]:
    times, run = _hazard_times(drive, start), drive.faulty
    gap = rf"(?:{_NUMBER} s (?:later|after that)|at once|at the same time)"
    said = {name: re.search(rf"{name}(?: the vehicle ahead| its lane)? {gap}", sentence)
            for name in ("touches", "stops", "leaves")}  # fmt: skip
    if (spoken := [name for name, match in said.items() if match]) != [n for n in said if n in times]:
        yield f"hazards {spoken}, not {list(times)}"
        return
    if ("No hazard follows" in sentence) == bool(times):
        yield "whether a hazard follows"
    before = start
    for name, time in times.items():
        match = said[name]
        if match and not _is_time(float(match[1] or 0.0), time - before):
            yield f"{name} {time - before} later"
        before = time
    end = times.get("touches", math.inf)
    at_end = run["t"] <= end + _SLACK
    if "touches" in times:
        closing = float((run["v_ego"] - run["v_lead"])[at_end][-1])
        yield from _compare(rf"at {_NUMBER} m/s", sentence, closing)
    if "leaves" in times:
        excursion = float(np.abs(run["lateral_offset"])[at_end].max()) - 0.95
        yield from _compare(rf"by up to {_NUMBER} m", sentence, max(excursion, 0.0))


def _wrong_reaction(sentence: str, drive: Drive, start: float) -> Iterator[str]:
    times = _hazard_times(drive, start)
    first_hazard = min(times.values(), default=math.inf)
    change = _first_difference(drive, first_hazard)
    if ("changes no actuator" in sentence) != (change is None and not times):
        yield f"whether an actuator changes: {change}"
    later = change and (change[0], -change[1])
    for words, expected in _DIRECTIONS.items():
        if words == "brakes to" and change and change[0] == "steer_torque":
            continue  # its speed is checked below
        for match in re.finditer(f"(then )?{words}", sentence):
            if expected != (later if match[1] else change):
                yield f"{match[0]}, but the first difference is {change}"
    if change:
        yield from _wrong_whole(sentence, drive, change, first_hazard)
    between = (drive.faulty["t"] >= start - _SLACK) & (drive.faulty["t"] <= first_hazard + _SLACK)
    speeds = drive.faulty["v_ego"][between]
    golden_between = (drive.golden["t"] >= start - _SLACK) & (drive.golden["t"] <= first_hazard + _SLACK)
    golden_speeds = drive.golden["v_ego"][golden_between]
    faster, slower = re.search(r"accelerates to", sentence), re.search(r"(?:slows|brakes) to", sentence)
    if faster:
        yield from _compare(rf"accelerates to {_NUMBER} m/s", sentence, float(speeds.max()))
        named = later if "then accelerates" in sentence else change
        is_named = (named or ("", 0))[0] == "steer_torque" or named in (("gas", 1), ("brake", -1))
        if not is_named or speeds.max() <= max(speeds[0], golden_speeds.max()):
            yield f"accelerates, but {named}"
    if slower:
        yield from _compare(rf"(?:slows|brakes) to {_NUMBER} m/s", sentence, float(speeds.min()))
        named = later if re.search("then (?:slows|brakes) to", sentence) else change
        is_named = (named or ("", 0))[0] == "steer_torque" or named in (("gas", -1), ("brake", 1))
        if not is_named or speeds.min() >= min(speeds[0], golden_speeds.min()):
            yield f"slows, but {named}"


def _wrong_whole(sentence: str, drive: Drive, change: tuple[str, int], until: float) -> Iterator[str]:
    """Check whether the first difference of an actuator is rightly said to be only the first one."""
    run, golden = drive.faulty, drive.golden
    rows = min(len(run["t"]), len(golden["t"]), int(np.searchsorted(run["t"], until + _SLACK)))
    difference = (run[change[0]][:rows] - golden[change[0]][:rows])[:-1]  # the last one holds for no time
    size = np.abs(difference).sum()
    same = np.abs(difference[np.sign(difference) == change[1]]).sum() / size if size else 1.0
    is_named = bool(re.search(r"(?<!then )(?:gives|brakes (?:harder|less)|steers further)", sentence))
    if "at first, then" in sentence:
        if same > 0.75 + _SLACK:
            yield f"at first, but {same} of the difference is like the first"
    elif "at first" not in sentence and is_named and same < 0.75 - _SLACK:
        yield f"only {same} of the difference is like the first"
    elif "at first" in sentence and not _is_contrary(drive, change, until):
        yield "at first, but the speed is like the first difference"


def _is_contrary(drive: Drive, change: tuple[str, int], until: float) -> bool:
    """Whether the car became only slower although the first difference makes it faster, or the reverse."""
    first = int(np.argmax(drive.faulty["t"] >= (drive.activation_s or 0.0) - _SLACK))
    speeds, golden_speeds = (
        run["v_ego"][first : int(np.searchsorted(run["t"], until + _SLACK))]
        for run in (drive.faulty, drive.golden)
    )
    is_faster = change in (("gas", 1), ("brake", -1))
    if is_faster:
        return bool(speeds.min() < min(speeds[0], golden_speeds.min()))
    return bool(speeds.max() > max(speeds[0], golden_speeds.max()))


def _wrong_alert(sentence: str, drive: Drive, start: float) -> Iterator[str]:
    alerts = sorted((time, name) for name, time in drive.alerts if time >= start - _SLACK)
    if not alerts or "No alert." in sentence:
        if bool(alerts) == ("No alert." in sentence):
            yield f"alerts {alerts}"
        return
    time, name = alerts[0]
    hazard = min(_hazard_times(drive, start).values(), default=None)
    match = re.search(rf"Alert (\w+) (?:only )?(?:at )?(?:{_NUMBER} s|in the moment of)(.*)", sentence)
    if not match or match[1] != name:
        yield f"alert {name}"
        return
    expected = time if hazard is None else abs(hazard - time)
    if match[2] is not None and not _is_time(float(match[2]), expected):
        yield f"alert {expected} s"
    if hazard is not None and abs(hazard - time) > _SLACK and ("before" in match[3]) != (time < hazard):
        yield "alert before or after the hazard"


def _first_difference(drive: Drive, until: float) -> tuple[str, int] | None:
    """Return the actuator that first differs from golden up to `until`, and the sign of its difference."""
    rows = min(len(drive.faulty["t"]), len(drive.golden["t"]))
    firsts = []
    for order, name in enumerate(("gas", "brake", "steer_torque")):
        difference = drive.faulty[name][:rows] - drive.golden[name][:rows]
        if difference.any():
            first = int((difference != 0.0).argmax())
            firsts.append((float(drive.faulty["t"][first]), order, name, int(np.sign(difference[first]))))
    first_of_all = min(firsts, default=None)
    if first_of_all is None or (until > 0.0 and first_of_all[0] > until + _SLACK):
        return None
    return first_of_all[2], first_of_all[3]


def _holds(drive: Drive, time: float) -> bool:
    """Whether the trigger's condition holds at the step of the activation, or has held before it."""
    run = drive.golden
    with np.errstate(divide="ignore", invalid="ignore"):
        hwt = np.where(run["v_ego"] > 0.0, run["d_rel"] / run["v_ego"], np.inf)
    values: dict[str, Any] = {"t": run["t"], "hwt": hwt, "rs": run["v_ego"] - run["v_lead"], "True": True}
    steps = np.ones(len(run["t"]), dtype=bool)
    for part in drive.condition.split(" and "):
        if part != "True":
            name, sign, number = part.split()
            side = values[name]
            limit = float(number)
            steps &= {
                "<=": side <= limit,
                ">": side > limit,
                ">=": side >= limit - _SLACK,
                "<": side < limit,
            }[sign]
    return bool(steps[run["t"] <= time + _SLACK].any())


def _compare(pattern: str, sentence: str, expected: float) -> Iterator[str]:
    match = re.search(pattern, sentence)
    if not match or not _is_near(float(match[1]), expected):
        yield f"{pattern}: {match[1] if match else 'nothing'}, not {expected}"


def _is_time(said: float, seconds: float) -> bool:
    """Whether a spoken time is the time of the step, which is 10 ms long."""
    return abs(said - seconds) <= _SLACK


def _is_near(said: float, number: float) -> bool:
    """Whether a spoken number is the number, rounded as spoken numbers are."""
    size = abs(number)
    digits_half = 0.05 * 10.0 ** math.ceil(math.log10(size)) if size > 1e-9 else 1e-9
    half = 0.005 if size >= 0.095 else digits_half
    return abs(said - number) <= half * (1.0 + 1e-9) + 1e-9
