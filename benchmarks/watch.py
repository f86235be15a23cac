"""Measure `mutator watch`: CPU from an edit to the verdict of a single fault, and while nothing is edited.

`python benchmarks/watch.py [--pairs N]` watches a copy of the shipped library and target, with a campaign of
one fault in one scenario. Edits of the spec and of the target alternate. CPU is user and system time of the
whole process tree, from the edit to the line with the verdict. An edit of the spec is to cost at most 2 s
beside the run; one of the target also the checks of the scenario, which are measured apart: golden run,
null mutant and canary. The unit is 30 s of driving without frames, which take 0.19 s on a quiet machine.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from step import RUN as LOOP_OF_STEP  # noqa: E402

from mutator.campaigns.plan import build_plan  # noqa: E402
from mutator.preflight.bench_checks import BenchChecks  # noqa: E402
from mutator.store.golden_runs import GoldenRun  # noqa: E402
from mutator.store.run_folder import RunFolder  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

MOST_OVERHEAD_S = 2.0
QUIET_LOOP_S = 0.19
CAMPAIGN = """\
schema: campaign/1
name: desk
about: One fault.
target: openpilot
scenarios: [S1]
faults:
  - {spec: radar_vision/relative_distance/longer, values: 1}
reading: as_described
methods: [guided]
triggers: {list: [{at_s: 10.0}]}
seed: 1
canary: {spec: vision_output/path_model/both, scenario: S1, hazard: H3, at_s: 5.0}
limits: {cpu_s: 60, wall_s: 300, memory_mb: 4096, steps: 6000}
"""
SPEC = "fault_library/faults/radar_vision/relative_distance.yaml"
TARGET_FILE = "target/selfdrive/controls/lib/longcontrol.py"
VERDICT_MARKS = (" [", "no change in")
IDLE_S = 20.0


def loop_s() -> float:
    """Return the CPU time of 30 s of driving without frames, the unit of absolute figures."""
    scenario, folder = ROOT / "fault_library" / "scenarios" / "S1.yaml", str(ROOT / "target" / "compiled")
    command = [sys.executable, "-c", LOOP_OF_STEP, folder, str(scenario)]
    answer = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(ROOT / "target")}, check=True, capture_output=True
    )
    return float(json.loads(answer.stdout)["loop"])


def tree_cpu_s(pid: int) -> float:
    """Return the CPU time of a process, its living descendants, and those that have been waited for."""
    ticks, children = 0, [pid]
    while children:
        child = children.pop()
        try:
            fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
            tasks = Path(f"/proc/{child}/task").iterdir()
            for task in tasks:
                children += map(int, (task / "children").read_text().split())
        except OSError:
            continue
        ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


@dataclass
class Watch:
    process: "subprocess.Popen[str]"
    place: Path

    def read_until(self, *texts: str) -> str:
        """Return the first line that has one of the texts."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if "error: " in line:
                raise SystemExit(line)
            if any(text in line for text in texts):
                return line
        raise SystemExit(f"`mutator watch` ended before {texts[0]!r}")

    def run_cpu_s(self) -> float:
        [line] = RunFolder.open_unverified(self.place / "watch" / "now").timings().values()
        return float(line["cpu_s"])


@contextmanager
def watching(place: Path) -> Iterator[Watch]:
    for name in ("fault_library", "templates", "target"):
        ignored = shutil.ignore_patterns("__pycache__", "reviews")
        shutil.copytree(ROOT / name, place / name, ignore=ignored)
    (place / "desk.yaml").write_text(CAMPAIGN)
    command = [sys.executable, "-m", "mutator", "watch", "desk.yaml", "--out", "watch", "-n", "1"]
    environment = os.environ | {"XDG_CACHE_HOME": str(place / "cache"), "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command, cwd=place, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            watch = Watch(process, place)
            watch.read_until("all: ")
            yield watch
        finally:
            process.send_signal(signal.SIGINT)


def edit(watch: Watch, path: str, number: int) -> None:
    """Give a file of the copy what it never had: another value of the fault, or of a constant."""
    old, new = {
        SPEC: (
            "{first: [15, 24], step: 10, last: [245, 254]}\n        key: distance_longer",
            f"{{first: [{40 + number}, {40 + number}], step: 10, last: [{50 + number}, {50 + number}]}}",
        ),
        TARGET_FILE: ("STARTED_BRAKE = 0.2 ", f"STARTED_BRAKE = 0.2{number:03} "),
    }[path]
    text = (ROOT / path).read_text()
    assert text.count(old) == 1
    (watch.place / path).write_text(text.replace(old, new))


def measure(watch: Watch, path: str, number: int) -> float:
    """Edit a file; return the CPU time up to the verdict, without that of the run."""
    before = tree_cpu_s(watch.process.pid)
    edit(watch, path, number)
    line = watch.read_until(*VERDICT_MARKS)
    after = tree_cpu_s(watch.process.pid)
    watch.read_until("all: ")
    print(
        f"  {path}: {line.strip()}: {after - before:.2f} s, of which run {watch.run_cpu_s():.2f} s",
        flush=True,
    )
    return after - before - watch.run_cpu_s()


def checks_cpu_s(place: Path) -> float:
    """Return the CPU time of the checks of the scenario in a process that has loaded everything else."""
    workspace = Workspace.find(root=place)
    plan = build_plan(workspace, place / "desk.yaml")
    manifest = workspace.manifest(plan.campaign.target)
    scratch = place / "scratch"
    checks = BenchChecks(workspace, manifest, plan.campaign, plan.canary, scratch)
    goldens = [GoldenRun.for_experiment(experiment, several_seeds=True) for experiment in plan.experiments]
    manifest.tree  # noqa: B018
    start = os.times()
    checks.check_goldens(goldens)
    end = os.times()
    shutil.rmtree(scratch)
    return sum(end[:4]) - sum(start[:4])


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pairs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        os.environ["XDG_CACHE_HOME"] = str(place / "cache_of_checks")
        with watching(place) as watch:
            checks = [checks_cpu_s(place)]
            idle_start, clock = tree_cpu_s(watch.process.pid), time.monotonic()
            time.sleep(IDLE_S)
            idle = (tree_cpu_s(watch.process.pid) - idle_start) / (time.monotonic() - clock)
            figures: dict[str, list[float]] = {SPEC: [], TARGET_FILE: []}
            loops = [loop_s()]
            for number in range(1, options.pairs + 1):
                for path, values in figures.items():
                    values.append(measure(watch, path, number))
                shutil.rmtree(place / "cache_of_checks", ignore_errors=True)
                checks.append(checks_cpu_s(place))
                loops.append(loop_s())
    scale = QUIET_LOOP_S / median(loops)
    of_spec, of_target = (median(values) * scale for values in figures.values())
    of_checks = median(checks) * scale
    print(f"loop {median(loops):.2f} s; the rest as on a machine where it takes {QUIET_LOOP_S} s")
    print(f"idle: {100 * idle:.2f} % of a core")
    print(f"edit of the spec: {of_spec:.2f} s beside the run (at most {MOST_OVERHEAD_S})")
    print(f"edit of the target: {of_target:.2f} s beside the run, {of_target - of_checks:.2f} s beside the")
    print(f"checks of its scenario, too, which take {of_checks:.2f} s (at most {MOST_OVERHEAD_S})")
    return int(max(of_spec, of_target - of_checks) > MOST_OVERHEAD_S)


if __name__ == "__main__":
    sys.exit(main())
