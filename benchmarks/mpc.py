"""Measure the CPU time of both model-predictive controllers: build, iteration and the solver's share.

`python benchmarks/mpc.py [--plain] [--rounds N] [--json FILE]`. The solvers are those compiled at
installation, or CasADi's with `--plain`. Each round measures both, so that other work on the machine affects
them equally.
"""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.car.honda.interface import get_params  # noqa: E402
from selfdrive.common import compiled  # noqa: E402
from selfdrive.controls.lib.lateral_mpc import Lanes, LateralMpc  # noqa: E402
from selfdrive.controls.lib.long_mpc import LongitudinalMpc  # noqa: E402
from selfdrive.messages import LeadData  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER  # noqa: E402

UPDATES = 200  # in each round
GOALS = {  # microseconds of CPU
    "longitudinal update": 150.0,
    "lateral update": 250.0,
    "longitudinal build": 60e3,
    "lateral build": 60e3,
}


def follow(mpc: LongitudinalMpc) -> None:
    """Approach a slower lead at a distance measured in steps of 1/16 m."""
    for k in range(UPDATES):
        mpc.set_cur_state(26.0 - 0.02 * k, -0.4)
        d_rel = int(16 * (80.0 - 0.2 * k)) / 16
        mpc.update(26.0, -0.4, LeadData(status=True, d_rel=d_rel, v_lead=18.0, a_lead_k=-0.2))


def steer(mpc: LateralMpc) -> None:
    """Return to the middle of a lane that bends slowly."""
    for k in range(UPDATES):
        y, bend = 0.4 * (1 - k / UPDATES), 2e-4
        left, right, path = ((0.0, bend, 0.01, y + side) for side in (1.85, -1.85, 0.0))
        mpc.update(Lanes(left, right, path, 0.95, 0.95, 3.7), 25.0, 0.02, 0.0, 0.2)


def cpu_us(task: Callable[[], object], divisor: int = 1) -> float:
    """Return the CPU time of `task` in microseconds, divided by `divisor`."""
    start = process_time()
    task()
    return (process_time() - start) / divisor * 1e6


def measure(rounds: int) -> dict[str, list[float]]:
    """Return the microseconds of each subject in each round.

    The first build also loads the solver's plug-in.
    """
    first = cpu_us(lambda: LongitudinalMpc(1))
    long_mpc, lateral_mpc = LongitudinalMpc(1), LateralMpc(get_params())
    subjects: dict[str, Callable[[], float]] = {
        "longitudinal update": lambda: cpu_us(lambda: follow(long_mpc), UPDATES),
        "longitudinal solver": lambda: cpu_us(lambda: repeat(long_mpc._iteration._evaluate), UPDATES),
        "lateral update": lambda: cpu_us(lambda: steer(lateral_mpc), UPDATES),
        "lateral solver": lambda: cpu_us(lambda: repeat(lateral_mpc._iteration._evaluate), UPDATES),
        "longitudinal build": lambda: cpu_us(lambda: LongitudinalMpc(1)),
        "lateral build": lambda: cpu_us(lambda: LateralMpc(get_params())),
    }
    times: dict[str, list[float]] = {"first build in the process": [first]} | {name: [] for name in subjects}
    for _ in range(rounds):
        for name, subject in subjects.items():
            times[name].append(subject())
    return times


def repeat(task: Callable[[], object]) -> None:
    for _ in range(UPDATES):
        task()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plain", action="store_true", help="without compiled code")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    compiled.use_libraries_in(None if options.plain else COMPILED_FOLDER)
    times = measure(options.rounds)
    print(f"{'CPU, microseconds':28}{'median':>10}{'best':>10}{'goal':>10}{'ratio':>8}")
    missed = False
    for name, values in times.items():
        goal = GOALS.get(name)
        tail = f"{goal:10.0f}{median(values) / goal:8.2f}" if goal else ""
        print(f"{name:28}{median(values):10.1f}{min(values):10.1f}{tail}")
        missed |= goal is not None and median(values) > goal
    if options.json:
        options.json.write_text(json.dumps({"unit": "us", "times": times}, indent=1) + "\n")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
