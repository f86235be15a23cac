"""Measure the CPU time of `mutator check --drive` beyond that of three golden runs.

`python benchmarks/check_drive.py [--rounds N]`. Each round measures the command for one scenario of the
shipped target, then three golden runs, each in its own process.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.workspace import Workspace  # noqa: E402

GOAL_S = 15.0
SCENARIO = "S1"


def cpu_s(*command: str, env: dict[str, str] | None = None) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, env=env, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    options = parser.parse_args()
    manifest = Workspace.find(root=ROOT).manifest("openpilot")
    check = (sys.executable, "-m", "mutator", "--root", str(ROOT), "check", "--drive", "--scenario", SCENARIO)
    environment = os.environ | {
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": f"{ROOT}{os.pathsep}{manifest.root}",
    }
    beside = []
    for _ in range(options.rounds):
        with tempfile.TemporaryDirectory() as out:
            scenario = Workspace.find(root=ROOT).scenario(SCENARIO)
            arguments = manifest.run_arguments(scenario=scenario, seed=0, out=Path(out))
            run = (sys.executable, "-m", manifest.entry_module, *arguments)
            whole = cpu_s(*check, env=environment)
            golden = sum(cpu_s(*run, env=environment) for _ in range(3))
        beside.append(whole - golden)
        print(f"check --drive {whole:.1f} s, three golden runs {golden:.1f} s, difference {beside[-1]:.1f} s")
    print(f"smallest {min(beside):.1f} s (at most {GOAL_S:.0f} s): {min(beside) / GOAL_S:.2f} of the goal")
    return int(min(beside) > GOAL_S)


if __name__ == "__main__":
    sys.exit(main())
