"""Judge the mutants of a small PID controller with this project, mutmut and cosmic-ray.

`python benchmarks/peers.py ENV [--rounds 5] [--cosmic-ray]`. ENV is a Python environment with the peers and
what they drive: `python3 -m venv ENV && ENV/bin/pip install mutmut cosmic-ray pytest gymnasium simple-pid`.
Both environments need the same simple-pid. All tools judge `simple_pid/pid.py` in the loop of the CartPole
example:

* this project drives each operator mutant for 10 s, compares its trace with the golden run, looks for
  hazards and for what did not execute, proves a sample on the reference engine, and writes tables and report;
* mutmut and cosmic-ray run one test, which drives the same loop and compares the trace's hash, so that a
  mutant is killed or survives. mutmut does not judge mutants in functions that the test does not call;
  cosmic-ray judges every mutant.

Each makes mutants of its own operators, so the figure is judged mutants a second of CPU, of all processes.
The tools run alternately. cosmic-ray starts an interpreter for each mutant, so it runs once, on request.
"""

import argparse
import csv
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

from mutator._common.extension_doors import OPERATOR_DOOR

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "examples" / "cartpole" / "fault_library"
GOAL = 1.2  # times mutmut's mutants a second of CPU
CAMPAIGN = f"""\
schema: campaign/1
name: operators
about: Every mutant of the controller, active during the whole drive.
target: simple_pid
scenarios: [first]
faults:
  - operators: [{", ".join(sorted(OPERATOR_DOOR.shipped_names()))}]
    in: [simple_pid/pid.py]
    when: [permanent]
triggers: [always]
seed: 1
"""
TEST = """\
import hashlib

import gymnasium
from simple_pid.pid import PID


def drive():
    time = [0.0]
    env = gymnasium.make("CartPole-v1").unwrapped
    env.reset(seed=1)
    controller = PID(-10, 0, -2, sample_time=None, time_fn=lambda: time[0])
    rows = []
    while time[0] < 10.0 and env.steps_beyond_terminated is None:
        place, speed, angle, _ = map(float, env.state)
        lean = 0.05 * (0.5 - place) - 0.1 * speed
        controller.setpoint = min(max(lean, -0.1), 0.1)
        command = controller(angle, dt=0.02)
        env.step(int(command > 0))
        rows.append((place, angle, command))
        time[0] += 0.02
    return hashlib.sha256(repr(rows).encode()).hexdigest()


def test_drive():
    with open("golden.txt") as golden:
        assert drive() == golden.read()
"""
MUTMUT_SETTINGS = """\
[mutmut]
source_paths=simple_pid/pid.py
pytest_add_cli_args_test_selection=tests
also_copy=
    simple_pid
    golden.txt
"""
COSMIC_RAY_SETTINGS = """\
[cosmic-ray]
module-path = "simple_pid/pid.py"
timeout = 20.0
excluded-modules = []
test-command = "{python} -m pytest -x -q tests"
[cosmic-ray.distributor]
name = "local"
"""


class Judged(NamedTuple):
    """What a tool judged, and its CPU time in s."""

    mutants: int
    cpu_s: float


def run_measured(command: Sequence[str | Path], folder: Path, env: Mapping[str, str]) -> tuple[str, float]:
    """Run a command; return its output, and the CPU time (s) of it and its descendants."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}: {(done.stderr or done.stdout).strip()[-2000:]}")
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def judge_with_this(place: Path, env: Mapping[str, str]) -> Judged:
    shutil.copytree(EXAMPLE, place / "fault_library")
    (place / "fault_library" / "campaigns" / "operators.yaml").write_text(CAMPAIGN)
    command: list[str | Path] = [sys.executable, "-m", "mutator", "run", "operators"]
    command += ["--library", place / "fault_library", "--out", place / "run", "-n", "2", "--no-reuse"]
    _, cpu_s = run_measured(command, place, {**env, "XDG_CACHE_HOME": str(place / "cache")})
    with (place / "run" / "results.csv").open() as table:
        return Judged(sum(1 for _ in csv.DictReader(table)), cpu_s)


def make_project(place: Path, peers: Path, env: Mapping[str, str]) -> Path:
    """Write the controller and its test into a folder of its own; return the peers' Python."""
    python = peers / "bin" / "python"
    find = "import simple_pid, os; print(os.path.dirname(simple_pid.__file__))"
    package = Path(run_measured([python, "-c", find], place, env)[0].strip())
    shutil.copytree(package, place / "simple_pid", ignore=shutil.ignore_patterns("__pycache__"))
    (place / "tests").mkdir()
    (place / "tests" / "test_drive.py").write_text(TEST)
    code = "import sys; sys.path[:0] = ['.', 'tests']; import test_drive; print(test_drive.drive(), end='')"
    (place / "golden.txt").write_text(run_measured([python, "-c", code], place, env)[0])
    return python


def judge_with_mutmut(place: Path, env: Mapping[str, str], peers: Path) -> Judged:
    make_project(place, peers, env)
    (place / "setup.cfg").write_text(MUTMUT_SETTINGS)
    output, cpu_s = run_measured([peers / "bin" / "mutmut", "run", "--max-children", "2"], place, env)
    # the last line of progress: mutants, then how many have no test
    found = re.findall(r"(\d+)/(\d+)\s+\S+ \d+ \S+ (\d+)", output)
    if not found:
        raise SystemExit(f"no mutants in mutmut's output: {output[-500:]}")
    _, mutants, untested = map(int, found[-1])
    return Judged(mutants - untested, cpu_s)


def judge_with_cosmic_ray(place: Path, env: Mapping[str, str], peers: Path) -> Judged:
    python = make_project(place, peers, env)
    (place / "settings.toml").write_text(COSMIC_RAY_SETTINGS.format(python=python))
    tool = peers / "bin" / "cosmic-ray"
    _, init_s = run_measured([tool, "init", "settings.toml", "session.sqlite"], place, env)
    _, exec_s = run_measured([tool, "exec", "settings.toml", "session.sqlite"], place, env)
    dump, _ = run_measured([tool, "dump", "session.sqlite"], place, env)
    return Judged(len(dump.splitlines()), init_s + exec_s)


def measure(name: str, judge: Callable[[Path, Mapping[str, str]], Judged]) -> Judged:
    with tempfile.TemporaryDirectory() as place:
        judged = judge(Path(place), os.environ)
    rate = judged.mutants / judged.cpu_s
    print(f"{name:12} {judged.mutants:4} mutants {judged.cpu_s:7.1f} s {rate:6.1f} a second", flush=True)
    return judged


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("peers", type=Path, metavar="ENV", help="environment with mutmut and cosmic-ray")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cosmic-ray", action="store_true", help="run cosmic-ray, too (minutes)")
    options = parser.parse_args()
    peers = options.peers.resolve()
    judges: dict[str, Callable[[Path, Mapping[str, str]], Judged]] = {
        "this": judge_with_this,
        "mutmut": lambda place, env: judge_with_mutmut(place, env, peers),
    }
    rates: dict[str, list[float]] = {name: [] for name in judges}
    for number in range(options.rounds):
        for name in judges if number % 2 == 0 else reversed(judges):
            judged = measure(name, judges[name])
            rates[name].append(judged.mutants / judged.cpu_s)
    if options.cosmic_ray:
        measure("cosmic-ray", lambda place, env: judge_with_cosmic_ray(place, env, peers))
    ratio = median(rates["this"]) / median(rates["mutmut"])
    print(f"mutants a second of CPU, this / mutmut: {ratio:.2f} (goal {GOAL})")
    return int(ratio < GOAL)


if __name__ == "__main__":
    sys.exit(main())
