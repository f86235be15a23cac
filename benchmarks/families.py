"""Measure scenarios of families: planning them, driving them without faults, and with three faults each.

`python benchmarks/families.py [--planned N] [--drives N] [--faulty N]`. CPU covers the whole process tree. A
bare loop of 30 s, without frames, is measured beside each part and is the unit of CPU.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time, time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common import compiled  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER  # noqa: E402
from selfdrive.sim.scenario import load_scenario  # noqa: E402
from selfdrive.sim.simulator import Simulator  # noqa: E402

FAMILY = "acc_settings"  # none of its drives ends in a hazard, so that faults are driven in all of them
GOALS = {
    "s to plan": 10.0,
    "MB to plan": 300.0,
    "loops a drive": 2.5,
    "KB a drive": 100.0,
    "loops an experiment": 3.7,
}
CAMPAIGN = """\
schema: campaign/1
name: {name}
about: A benchmark.
target: openpilot
scenarios:
  - {{family: {family}, sample: {count}, sampling: sobol}}
faults: {faults}
{triggers}
seed: 0
canary: {{spec: radar/chaff/distance, scenario: S1, hazard: H1, at_s: 8.0}}
limits: {{cpu_s: 60, wall_s: 300, memory_mb: 4096, steps: 20000}}
"""


def bare_loop_s() -> float:
    """Return the CPU time (s) of 30 s of simulation in one interpreter, the smaller of two."""
    compiled.use_libraries_in(COMPILED_FOLDER)
    scenario, times = load_scenario(ROOT / "fault_library" / "scenarios" / "S1.yaml"), []
    for _ in range(2):
        simulator = Simulator()
        simulator.reset(scenario, 0)
        began = process_time()
        for _ in range(scenario.steps):
            simulator.step()
        times.append(process_time() - began)
    return min(times)


def write_campaign(folder: Path, name: str, count: int, *, with_faults: bool) -> Path:
    path = folder / f"{name}.yaml"
    # three faults: one value of one variant at three times
    faults = "[{spec: radar/chaff/distance, values: 1}]" if with_faults else "[]"
    triggers = "triggers: [{at_s: 5}, {at_s: 10}, {at_s: 20}]" if with_faults else ""
    text = CAMPAIGN.format(name=name, family=FAMILY, count=count, faults=faults, triggers=triggers)
    path.write_text(text)
    return path


def run_command(*words: object) -> tuple[float, float, float]:
    """Run `mutator` with these words; return wall and CPU time of the process tree (s), and memory (MB)."""
    began = time()
    command = [sys.executable, "-m", "mutator", *map(str, words)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return time() - began, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def folder_kb(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1024


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--planned", type=int, default=10_000)
    parser.add_argument("--drives", type=int, default=1000)
    parser.add_argument("--faulty", type=int, default=200, help="Scenarios with three faults each.")
    options = parser.parse_args()
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        file = write_campaign(folder, "planned", options.planned, with_faults=True)
        _, figures["s to plan"], figures["MB to plan"] = run_command(
            "plan", file, "--out", folder / "planned"
        )
        file = write_campaign(folder, "drives", options.drives, with_faults=False)
        loop_s = bare_loop_s()
        _, cpu_s, _ = run_command("run", file, "--out", folder / "drives", "-n", 2, "--no-reuse")
        figures["loops a drive"] = cpu_s / options.drives / ((loop_s + bare_loop_s()) / 2)
        figures["KB a drive"] = folder_kb(folder / "drives") / options.drives
        shutil.rmtree(folder / "drives")
        file = write_campaign(folder, "faulty", options.faulty, with_faults=True)
        loop_s = bare_loop_s()
        _, cpu_s, _ = run_command("run", file, "--out", folder / "faulty", "-n", 2, "--no-reuse")
        figures["loops an experiment"] = cpu_s / (3 * options.faulty) / ((loop_s + bare_loop_s()) / 2)
    print(
        f"{options.planned} scenarios with three faults each planned, {options.drives} driven without "
        f"faults, {options.faulty} with three faults each; the bare loop took {loop_s:.2f} s"
    )
    for name, value in figures.items():
        print(f"{name}: {value:.2f}, goal {GOALS[name]:g}: {value / GOALS[name]:.2f}")
    return int(any(value > GOALS[name] for name, value in figures.items()))


if __name__ == "__main__":
    sys.exit(main())
