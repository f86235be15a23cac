"""Connect a controller to the harness: run its loop step by step and write the results.

A target's entry module contains a class that builds the loop and simulates one step, and two lines that
start the run:

    from mutator.glue import Run

    class Drive(Run):
        def __init__(self, scenario, seed):
            super().__init__(step_s=0.02, duration_s=scenario["duration_s"])
            self.cart, self.controller = Cart(scenario["speed_mps"]), Controller()

        def step(self):
            distance = self.cart.distance()
            force = self.controller.update(distance)
            self.cart.advance(force)
            self.record(distance=distance, force=force)

    if __name__ == "__main__":
        Drive.main()

The manifest says `entry: {module: drive, stepwise: Drive.open}`. This module runs in the target's process, so
it imports only the standard library and numpy.
"""

import json
import math
import random
import reprlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

TRACE = "trace.npz"
RECORD = "record.json"
TIME = "t"  # every trace has this channel, in s
_REQUIRED_OPTIONS = ("scenario", "seed", "out")


class GlueError(Exception):
    """A mistake in the code that starts or records a run. The message is for the author of that code."""


class Scenario(dict[str, Any]):
    """The values of a scenario file by key. A missing key raises GlueError."""

    def __init__(self, values: dict[str, Any], path: Path) -> None:
        super().__init__(values)
        self.path = path

    def __missing__(self, key: str) -> Any:
        raise GlueError(f"{self.path}: no key '{key}'; the file has {', '.join(self) or 'no keys'}")


class Run:
    """One run of a closed loop.

    A subclass defines `__init__(self, scenario, seed)`, which builds the loop, and `step(self)`, which
    advances it by `step_s` and ends with `self.record(...)`. `scenario` is a `Scenario`, `seed` an int.
    Global random generators are not seeded; see `seed_globals`. A subclass can use any name except `step_s`,
    `t`, `done`, `end`, `record`, `recorded`, `hazard`, `alert`, `write`, `open` and `main`.
    """

    # two underscores keep this class's attributes apart from a subclass's
    def __init__(self, *, step_s: float, duration_s: float) -> None:
        self.__channels: tuple[str, ...] = ()
        self.__rows: list[tuple[float, ...]] = []
        self.__duration_s = _checked_duration_s("duration_s", duration_s)
        self.__since, self.__passed = 0.0, 0  # time and steps when the step length last changed
        self.__step_s = 0.0
        self.step_s = step_s
        if self.__steps < 1:
            raise GlueError(f"a run of {duration_s} s in steps of {step_s} s: expected at least one step")
        self.__ended = False
        self.__hazards: dict[str, float | None] = {}
        self.__alerts: list[dict[str, Any]] = []
        self.__alerting: set[str] = set()

    def step(self) -> None:
        """Advance the loop by one step and record it."""
        raise NotImplementedError(f"{type(self).__name__} has no step()")

    @property
    def step_s(self) -> float:
        """Length of a step in s. If it varies, set it in each step before you call `record`."""
        return self.__step_s

    @step_s.setter
    def step_s(self, step_s: float) -> None:
        step_s = _checked_duration_s("step_s", step_s)
        if self.__rows and step_s != self.__step_s:  # a sum of equal steps would add up errors
            self.__since, self.__passed = self.t, len(self.__rows)
        self.__step_s = step_s
        self.__steps = self.__passed + round((self.__duration_s - self.__since) / step_s)

    @property
    def t(self) -> float:
        """Time in s since the start. Until you call `record`, it is the time of the current step."""
        return self.__since + (len(self.__rows) - self.__passed) * self.__step_s

    @property
    def done(self) -> bool:
        """Whether the run has ended."""
        return self.__ended or len(self.__rows) >= self.__steps

    def end(self) -> None:
        """Make this step the last one, e.g. after the pole has fallen or the cars have collided."""
        self.__ended = True

    def record(self, **channels: float) -> None:
        """Record the current step: a number for each channel, with the same channels in each step.

        Call it once, at the end of each step.
        """
        if not self.__rows:
            self.__channels = tuple(channels)
        if channels.keys() != set(self.__channels) or TIME in channels:
            odd = sorted(channels.keys() ^ set(self.__channels)) or [TIME]
            raise GlueError(
                f"at {self.t:g} s: missing or unexpected channels: {', '.join(odd)}; "
                f"expected the same channels in each step, without {TIME}"
            )
        at = f"at {self.t:g} s: "
        self.__rows.append(
            (self.t, *(_checked_number(at + name, channels[name]) for name in self.__channels))
        )

    def recorded(self) -> dict[str, float]:
        """Return the channels of the last recorded step and its time."""
        return dict(zip((TIME, *self.__channels), self.__rows[-1], strict=True))

    def hazard(self, name: str, now: bool) -> None:
        """Report whether a hazard is present. Call it in each step, before `record`.

        Use it for hazards that the manifest names without a condition.
        """
        if self.__hazards.setdefault(name, None) is None and now:
            self.__hazards[name] = self.t

    def alert(self, name: str, now: bool) -> None:
        """Report whether the controller alerts its driver. Call it in each step, before `record`."""
        if not now:
            self.__alerting.discard(name)
        elif name not in self.__alerting:
            self.__alerting.add(name)
            self.__alerts.append({"name": name, "t": self.t})

    def write(self, out: Path) -> None:
        """Write the trace, then the record, to the folder `out`. Equal runs write equal bytes."""
        if not self.__rows:
            raise GlueError("nothing is recorded; expected at least one step: call `end` only from `step`")
        out.mkdir(parents=True, exist_ok=True)
        columns = np.array(self.__rows, dtype=np.float64).T
        np.savez(out / TRACE, **dict(zip((TIME, *self.__channels), columns, strict=True)))
        unfinished = out / f".{RECORD}"  # renamed when complete: a killed run leaves no record
        record = {"hazards": self.__hazards, "alerts": self.__alerts}
        unfinished.write_text(json.dumps(record) + "\n", encoding="utf-8")
        unfinished.replace(out / RECORD)

    @classmethod
    def open(cls, arguments: Sequence[str]) -> Self:
        """Build the run from the arguments `--scenario FILE --seed N --out DIR`, without running a step.

        The manifest names this method in `stepwise`. Any other `--key value` replaces the scenario's value of
        that key, and `--key` alone sets it to true, so changes of a scenario need no code.
        """
        options = _parse_options(arguments)
        subclass: Any = cls
        run: Self = subclass(_load_scenario(options), _parse_seed(options))
        if not hasattr(run, "_Run__rows"):
            raise GlueError(
                f"{cls.__name__}.__init__ does not call super().__init__; "
                "add super().__init__(step_s=..., duration_s=...)"
            )
        return run

    @classmethod
    def main(cls, arguments: Sequence[str] | None = None) -> None:
        """Run all steps and write the results. `arguments` defaults to those of the process."""
        arguments = sys.argv[1:] if arguments is None else arguments
        run = cls.open(arguments)
        while not run.done:
            steps = len(run.__rows)
            run.step()
            if len(run.__rows) != steps + 1:
                raise GlueError(
                    f"step() recorded {len(run.__rows) - steps} rows at {run.t:g} s; expected one"
                )
        run.write(Path(_required_option(_parse_options(arguments), "out")))


def seed_globals(seed: int) -> None:
    """Seed the global generators `random` and `numpy.random`, for code that draws from them."""
    random.seed(seed)
    np.random.seed(seed)


def read_scenario(path: Path) -> Scenario:
    """Read a scenario file: `key: value` in each line, `#` before a comment.

    This is a subset of YAML. A value that is not valid JSON is text. A line of another form raises GlueError.
    """
    values: dict[str, Any] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        text = line.partition(" #")[0].rstrip()
        if not text or text.startswith("#"):
            continue
        key, colon, value = text.partition(":")
        if not (colon and key.isidentifier() and value.strip()) or key in values:
            raise GlueError(f"{path}:{number}: '{text}'; expected `key: value`, each key once")
        values[key] = _parse_value(value.strip())
    return Scenario(values, path)


def _checked_number(what: str, value: Any) -> float:
    try:
        if not isinstance(value, str | bytes) and np.ndim(value) == 0:
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise GlueError(f"{what} is {reprlib.repr(value)}; expected a number")


def _checked_duration_s(what: str, value: Any) -> float:
    number = _checked_number(what, value)
    if not 0 < number < math.inf:
        raise GlueError(f"{what} is {number:g}; expected a finite time above 0 s")
    return number


def _parse_value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def _parse_options(arguments: Sequence[str]) -> dict[str, str | None]:
    """Return the options `--key value`, `--key=value` and `--key` (None) by key, with `_` for `-`."""
    options: dict[str, str | None] = {}
    pending_key = ""
    for argument in arguments:
        if argument.startswith("--"):
            name, equals, value = argument[2:].partition("=")
            pending_key = name.replace("-", "_")
            options[pending_key] = value if equals else None
        elif pending_key and options[pending_key] is None:
            options[pending_key] = argument
        else:
            raise GlueError(f"argument '{argument}'; expected --scenario FILE --seed N --out DIR")
    return options


def _required_option(options: dict[str, str | None], name: str) -> str:
    value = options.get(name)
    if value is None:
        raise GlueError(f"no --{name}; expected --scenario FILE --seed N --out DIR")
    return value


def _parse_seed(options: dict[str, str | None]) -> int:
    text = _required_option(options, "seed")
    if not text.isdecimal():
        raise GlueError(f"--seed {text}; expected a whole number, 0 or more")
    return int(text)


def _load_scenario(options: dict[str, str | None]) -> Scenario:
    scenario = read_scenario(Path(_required_option(options, "scenario")))
    for key, value in options.items():
        if key in _REQUIRED_OPTIONS:
            continue
        scenario[key]  # raises GlueError for an unknown key
        scenario[key] = True if value is None else _parse_value(value)
    return scenario
