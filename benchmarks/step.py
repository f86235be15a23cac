"""Measure the CPU time of one simulated run, without imports, and of the loop's parts.

`python benchmarks/step.py [scenario.yaml] [--plain] [--repeat N]`. The parts are measured in a separate run,
because measuring slows it down. Times are CPU times of this process. It uses the code compiled at
installation unless given `--plain`.

With `--against CLONE` it instead compares the times of imports, building and loop with those of an older
checkout. The versions alternate, each time in a fresh interpreter with bytecode and compiled code ready.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.can.packer import MessagePacker  # noqa: E402
from selfdrive.can.parser import CanParser  # noqa: E402
from selfdrive.car.honda.interface import CarInterface  # noqa: E402
from selfdrive.car.honda.radar_interface import RadarInterface  # noqa: E402
from selfdrive.common import compiled  # noqa: E402
from selfdrive.controls.controlsd import Controlsd  # noqa: E402
from selfdrive.controls.lib.latcontrol import LatControl  # noqa: E402
from selfdrive.controls.lib.long_mpc import LongitudinalMpc  # noqa: E402
from selfdrive.controls.lib.longcontrol import LongControl  # noqa: E402
from selfdrive.controls.plannerd import Planner  # noqa: E402
from selfdrive.controls.radard import Radard  # noqa: E402
from selfdrive.sim.actuators import ActuatorReceiver  # noqa: E402
from selfdrive.sim.camera import GeometryCamera  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER  # noqa: E402
from selfdrive.sim.hazards import HazardMonitor  # noqa: E402
from selfdrive.sim.plant import Plant  # noqa: E402
from selfdrive.sim.radar import RadarSensor  # noqa: E402
from selfdrive.sim.recorder import TraceRecorder  # noqa: E402
from selfdrive.sim.scenario import Scenario, load_scenario  # noqa: E402
from selfdrive.sim.sensors import CarSensors  # noqa: E402
from selfdrive.sim.simulator import Simulator  # noqa: E402
from selfdrive.visiond.visiond import Visiond  # noqa: E402

GROUPS: dict[str, tuple[tuple[type, str], ...]] = {
    "plant and ground truth": ((Plant, "step"), (Simulator, "_observe"), (HazardMonitor, "update")),
    "sensors and CAN out": (
        *((CarSensors, "measure"), (RadarSensor, "measure"), (GeometryCamera, "look")),
        *((CarInterface, "apply"), (MessagePacker, "pack")),
    ),
    "CAN in": (
        *((CanParser, "update"), (CarInterface, "update")),
        *((RadarInterface, "update"), (ActuatorReceiver, "update")),
    ),
    "visiond": ((Visiond, "update"),),
    "radard": ((Radard, "update"),),
    "planner": ((Planner, "take_model"), (Planner, "update")),
    "longitudinal MPC": ((LongitudinalMpc, "update"),),
    "longitudinal control": ((LongControl, "update"),),
    "lateral MPC": ((LatControl, "plan"),),
    "lateral control": ((LatControl, "update"),),
    "controlsd, the rest": ((Controlsd, "update"),),
    "recorder": ((TraceRecorder, "append"),),
    "the loop itself": ((Simulator, "step"),),
}
PARTS = tuple(part for parts in GROUPS.values() for part in parts)
GOAL = 0.7  # s of CPU for 30 s of simulation, after the loop is built
STEPS_OF_GOAL = 3000
GOALS = {"start": 0.8, "loop": 0.75}  # relative to the older version
HELPERS = ("-m", "selfdrive.sim.compile_helpers")
# Runs in a fresh interpreter of either version, with the folder of compiled code and a scenario.
RUN = """
import json, sys
from pathlib import Path
from time import process_time
begun = process_time()
from selfdrive.sim.run import Scenario, Simulator, load_scenario
from selfdrive.common import compiled
imported = process_time()
folder, scenario = Path(sys.argv[1]), load_scenario(Path(sys.argv[2]))
use = getattr(compiled, "use_libraries_in", None) or compiled.use  # older versions have the latter
use(folder)
def run():
    began = process_time()
    simulator = Simulator()
    simulator.reset(scenario, 0)
    built = process_time()
    for _ in range(scenario.steps):
        simulator.step()
    simulator.result()
    return built - began, process_time() - built
first, times = run(), [run() for _ in range(3)]
loop = min(loop for _, loop in times)
imports = imported - begun
print(json.dumps({"imports": imports, "build": first[0], "start": imports + first[0], "loop": loop}))
"""


class Stopwatch:
    """Measures nested parts. Each part's time excludes the parts that it calls."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self._inner = [0.0]

    def wrap(self, owner: type, name: str) -> Callable[[], None]:
        """Time a method from now on. Return a function that restores it."""
        original, key = getattr(owner, name), part_name(owner, name)
        self.seconds[key], self.calls[key] = 0.0, 0

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._inner.append(0.0)
            start = process_time()
            result = original(*args, **kwargs)
            spent = process_time() - start
            self.seconds[key] += spent - self._inner.pop()
            self.calls[key] += 1
            self._inner[-1] += spent
            return result

        setattr(owner, name, timed)
        return lambda: setattr(owner, name, original)


def part_name(owner: type, name: str) -> str:
    return f"{owner.__name__}.{name}"


def run(scenario: Scenario) -> tuple[float, float]:
    """Return the CPU seconds for building the loop and for running it."""
    start = process_time()
    simulator = Simulator()
    simulator.reset(scenario, 0)
    built = process_time()
    while not simulator.is_finished:
        simulator.step()
    simulator.result()
    return built - start, process_time() - built


def run_in_parts(scenario: Scenario) -> tuple[Stopwatch, float]:
    """Run once with every part timed. Return the stopwatch and the total CPU seconds."""
    watch = Stopwatch()
    restore = [watch.wrap(owner, name) for owner, name in PARTS]
    start = process_time()
    run(scenario)
    total = process_time() - start
    for put_back in restore:
        put_back()
    return watch, total


def against(clone: Path, scenario: Path, rounds: int) -> bool:
    """Print the times of start and loop in both versions. Return whether the goals are met."""
    with tempfile.TemporaryDirectory() as place:
        versions = {"older": clone.resolve(), "this": ROOT}
        times: dict[str, list[dict[str, float]]] = {name: [] for name in versions}
        for name, root in versions.items():
            _fresh(root, place, *HELPERS, _folder_option(root, place), f"{place}/{name}")
            _fresh(root, place, "-c", RUN, f"{place}/{name}", str(scenario))  # writes the bytecode
        for number in range(rounds):
            for name in versions if number % 2 == 0 else reversed(versions):
                said = _fresh(versions[name], place, "-c", RUN, f"{place}/{name}", str(scenario))
                times[name].append(json.loads(said))
    reached = True
    for key in ("imports", "build", "start", "loop"):
        older, this = (median(run[key] for run in times[name]) for name in versions)
        goal = GOALS.get(key)
        print(
            f"{key:8} older {older:.4f} s, this {this:.4f} s: ratio {this / older:.2f}"
            + f" (goal {goal})" * bool(goal)
        )
        reached &= goal is None or this / older <= goal
    return reached


def _folder_option(root: Path, place: str) -> str:
    return "--cache" if "--cache" in _fresh(root, place, *HELPERS, "--help") else "--out"


def _fresh(root: Path, place: str, *words: str) -> str:
    """Return the output of a fresh interpreter with the target of the clone `root` and its bytecode in
    `place`.
    """
    environment = os.environ | {
        "PYTHONPATH": str(root / "target"),
        "PYTHONPYCACHEPREFIX": f"{place}/bytecode",
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return subprocess.run(
        [sys.executable, *words], env=environment, check=True, stdout=subprocess.PIPE, text=True
    ).stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", nargs="?", type=Path, default=ROOT / "fault_library/scenarios/S1.yaml")
    parser.add_argument("--repeat", type=int, default=3, help="runs, of which the fastest is reported")
    parser.add_argument("--plain", action="store_true", help="without compiled code")
    parser.add_argument("--against", type=Path, metavar="CLONE", help="checkout of an older commit")
    parser.add_argument("--rounds", type=int, default=7, help="fresh interpreters of each version")
    options = parser.parse_args()
    if options.against:
        sys.exit(0 if against(options.against, options.scenario, options.rounds) else 1)
    compiled.use_libraries_in(None if options.plain else COMPILED_FOLDER)
    scenario = load_scenario(options.scenario)
    times = [run(scenario) for _ in range(options.repeat)]
    first_build = times[0][0]
    build, loop = min(times, key=sum)
    print(f"{scenario.name}, {scenario.steps} steps, CPU time beyond imports, best of {options.repeat}:")
    print(f"  build {first_build:.3f} s in a fresh process, {build:.3f} s again")
    print(f"  run   {loop:.3f} s, {1000 * loop / scenario.steps:.4f} ms a step")
    goal = GOAL * scenario.steps / STEPS_OF_GOAL
    print(f"  {loop / goal:.2f} of the run's goal of {goal:.2f} s; {first_build + loop:.3f} s with the build")
    print_parts(scenario)
    sys.exit(1 if loop > goal else 0)


def print_parts(scenario: Scenario) -> None:
    watch, total = run_in_parts(scenario)

    def line(name: str, seconds: float, calls: int) -> str:
        per_step = 1000 * seconds / scenario.steps
        return f"  {name:26} {per_step:.4f} ms a step  {seconds / total:6.1%}  {calls} calls"

    print(f"\nCPU time of each part without those it calls ({total:.3f} s, with the cost of measuring):")
    for name, parts in GROUPS.items():
        keys = [part_name(*part) for part in parts]
        print(line(name, sum(watch.seconds[key] for key in keys), sum(watch.calls[key] for key in keys)))
    print("\nThe same by method:")
    for key, seconds in sorted(watch.seconds.items(), key=lambda item: -item[1]):
        print(line(key, seconds, watch.calls[key]))


if __name__ == "__main__":
    main()
