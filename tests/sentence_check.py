"""Recomputes from traces alone what sentences say.

It shares no code with `mutator`: the sentence is read with patterns, and each number and direction is
computed anew from the channels of the faulty and the golden run.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Channels = Mapping[str, np.ndarray]
_SLACK = 1e-6
_NUMBER = r"(-?[0-9.]+(?:e-?[0-9]+)?)"
_LEAST_SPEED_CHANGE = 0.5  # m/s


@dataclass(frozen=True, kw_only=True)
class Loop:
    """The words of a library, and what they mean in the channels of its loop."""

    directions: Mapping[str, tuple[str, int]]  # what the car or controller does, by actuator and sign
    actuators: Sequence[str]  # in the manifest's order
    faster: Sequence[tuple[str, int]] = ()  # the differences that make the car faster
    slower: Sequence[tuple[str, int]] = ()
    speed: str = ""  # the channel
    hazards: Mapping[str, Callable[[Channels], np.ndarray]]  # in which steps they hold, by the words
    terminal: Sequence[str]  # the hazards that end the drive
    # the number in a hazard's words, from the run up to the end of the drive; the time since its begin
    numbers: Mapping[str, tuple[str, Callable[[Channels], float]]]
    situation: Callable[[Channels], Mapping[str, np.ndarray]]  # what conditions name
    has_alerts: bool = False
    clauses: Mapping[str, Callable[[float], str]] = field(default_factory=dict)  # by variant, of its value


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The traces of an experiment, when its fault was first active (s; None: never), its alerts, its plan."""

    loop: Loop
    faulty: Channels
    golden: Channels
    activation_s: float | None
    alerts: Sequence[tuple[str, float]]
    value: float | None  # of the fault
    variant: str
    condition: str
    is_ok: bool = True


def wrong_claims(sentence: str, drive: Drive) -> list[str]:
    """Return what the sentence says that the traces do not show, and what it leaves out."""
    return list(_wrong_claims(sentence, drive))


def _wrong_claims(sentence: str, drive: Drive) -> Iterator[str]:
    written = drive.loop.clauses.get(drive.variant)
    if written and drive.value is not None and not sentence.startswith(f"{written(drive.value)} from "):
        yield f"not {written(drive.value)}"
    elif not written and drive.value is not None:
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
    holds = {words: held(run) for words, held in drive.loop.hazards.items()}
    times = {name: float(run["t"][steps.argmax()]) for name, steps in holds.items() if steps.any()}
    later = {name: time for name, time in times.items() if time >= start - _SLACK}
    return dict(sorted(later.items(), key=lambda item: item[1]))


def _wrong_hazards(sentence: str, drive: Drive, start: float) -> Iterator[str]:
    times, run = _hazard_times(drive, start), drive.faulty
    gap = rf"(?:{_NUMBER} s (?:later|after that)|at once|at the same time)"
    said = {words: re.search(f"{words} {gap}", sentence) for words in drive.loop.hazards}
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
    end = min((times[words] for words in drive.loop.terminal if words in times), default=math.inf)
    for words, (pattern, number) in drive.loop.numbers.items():
        if words in times and not (words in drive.loop.terminal and times[words] > end):
            yield from _compare(pattern, sentence, number(_between(run, -math.inf, end)))


def _wrong_reaction(sentence: str, drive: Drive, start: float) -> Iterator[str]:
    times = _hazard_times(drive, start)
    first_hazard = min(times.values(), default=math.inf)
    change = _first_difference(drive, first_hazard)
    if ("changes no actuator" in sentence) != (change is None and not times):
        yield f"whether an actuator changes: {change}"
    for words, expected in drive.loop.directions.items():
        if words.endswith(" to") and not _drives_speed(drive.loop, change):
            continue  # only `_wrong_speeds` can tell
        for match in re.finditer(f"(then )?{words}", sentence):
            if expected != (_reverse(change) if match[1] else change):
                yield f"{match[0]}, but the first difference is {change}"
    if change:
        yield from _wrong_whole(sentence, drive, change, first_hazard)
    if drive.loop.speed:
        yield from _wrong_speeds(sentence, drive, change, (start, first_hazard))


def _wrong_speeds(
    sentence: str, drive: Drive, change: tuple[str, int] | None, times: tuple[float, float]
) -> Iterator[str]:
    """Check the speeds in a sentence between two times (s), and that none is missing that follows from the
    first difference.
    """
    loop = drive.loop
    speeds, golden = (_between(run, *times)[loop.speed] for run in (drive.faulty, drive.golden))
    highest, lowest = float(speeds.max()), float(speeds.min())
    rise = highest - max(speeds[0], golden.max())
    fall = min(speeds[0], golden.min()) - lowest
    is_standing = times[1] < math.inf and lowest < _LEAST_SPEED_CHANGE
    is_rise_larger = rise >= fall or is_standing
    for words, speed, gain, causes, is_due in (
        ("accelerates to", highest, rise, loop.faster, is_rise_larger),
        ("(?:slows|brakes) to", lowest, fall, loop.slower, not is_rise_larger),
    ):
        is_cause = _drives_speed(loop, change)  # or the speed follows another actuator's difference
        if match := re.search(f"(then )?{words}", sentence):
            named = _reverse(change) if match[1] else change
            if not change or gain < _LEAST_SPEED_CHANGE or (is_cause and named not in causes):
                yield f"{words}, but {named}, and a change by {gain} m/s"
            yield from _compare(f"{words} {_NUMBER} m/s", sentence, speed)
        elif gain < _LEAST_SPEED_CHANGE or (is_standing and speed == lowest):
            continue
        elif change and (change in causes if is_cause else is_due):
            yield f"not {words} {speed}"


def _drives_speed(loop: Loop, change: tuple[str, int] | None) -> bool:
    return change in loop.faster or change in loop.slower


def _reverse(change: tuple[str, int] | None) -> tuple[str, int] | None:
    return change and (change[0], -change[1])


def _wrong_whole(sentence: str, drive: Drive, change: tuple[str, int], until: float) -> Iterator[str]:
    """Check whether the first difference of an actuator is rightly said to be only the first one."""
    run, golden = drive.faulty, drive.golden
    rows = min(len(run["t"]), len(golden["t"]), int(np.searchsorted(run["t"], until + _SLACK)))
    difference = (run[change[0]][:rows] - golden[change[0]][:rows])[:-1]  # the last one holds for no time
    size = np.abs(difference).sum()
    same = np.abs(difference[np.sign(difference) == change[1]]).sum() / size if size else 1.0
    words = "|".join(words for words in drive.loop.directions if not words.endswith(" to"))
    is_named = bool(re.search(f"(?<!then )(?:{words})", sentence))
    if "at first, then" in sentence:
        if same > 0.75 + _SLACK:
            yield f"at first, but {same} of the difference is like the first"
    elif "at first" not in sentence and is_named and same < 0.75 - _SLACK:
        yield f"only {same} of the difference is like the first"
    elif "at first" in sentence and not _is_contrary(drive, change, until):
        yield "at first, but the speed is like the first difference"


def _is_contrary(drive: Drive, change: tuple[str, int], until: float) -> bool:
    """Whether the car became only slower although the first difference makes it faster, or the reverse."""
    start = drive.activation_s or 0.0
    speeds, golden = (_between(run, start, until)[drive.loop.speed] for run in (drive.faulty, drive.golden))
    if change in drive.loop.faster:
        return bool(speeds.min() < min(speeds[0], golden.min()))
    return bool(speeds.max() > max(speeds[0], golden.max()))


def _between(run: Channels, start: float, end: float) -> Channels:
    steps = (run["t"] >= start - _SLACK) & (run["t"] <= end + _SLACK)
    return {name: values[steps] for name, values in run.items()}


def _wrong_alert(sentence: str, drive: Drive, start: float) -> Iterator[str]:
    if not drive.loop.has_alerts:
        if "lert" in sentence:
            yield "alerts, which the loop does not have"
        return
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
    for order, name in enumerate(drive.loop.actuators):
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
    values = {"t": run["t"], **drive.loop.situation(run)}
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
