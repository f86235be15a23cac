"""Measure what it costs that runs note which functions they execute, for `mutator run --since`.

`python benchmarks/recording.py [--pairs 10] [--experiments 4]`, in Python 3.12 or later. Two copies of the
harness run the same experiments alternately, each with an empty store of finished runs; in one of them,
nothing is noted. The CPU time is that of all processes. It prints the ratio of each pair, and their mean with
a 95 % interval.
"""

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import fmean, stdev

from scipy.stats import t as student  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[1]
GOAL = 1.03
RECORDER = "mutator/engines/in_target/function_recorder.py"
SESSION = "mutator/execution/session.py"
# old and new text of the copy that notes nothing
EDITS = (
    (RECORDER, '_monitoring: Any = getattr(sys, "monitoring", None)', "_monitoring: Any = None"),
    (SESSION, "            recording=self.recording,\n", "            recording=None,\n"),
)
CAMPAIGN = """\
schema: campaign/1
name: recording
about: Faults without pictures in two scenarios.
target: openpilot
scenarios: [S1, S3]
faults:
  - {spec: radar/chaff/*}
  - {spec: car_sensors/speed/slower}
  - {spec: vision_output/path_model/*}
methods: [guided]
triggers: {table: accelerate_decelerate, armed_after_s: 1.5}
seed: 1
canary: {spec: vision_output/path_model/both, scenario: S1, hazard: H3, at_s: 5.0}
"""


def copy_harness(folder: Path, *, records: bool) -> Path:
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("mutator", "target", "fault_library", "templates"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    (folder / "recording.yaml").write_text(CAMPAIGN)
    for path, old, new in () if records else EDITS:
        text = (folder / path).read_text()
        assert text.count(old) == 1, (path, old)
        (folder / path).write_text(text.replace(old, new))
    return folder


def cpu_of_campaign(copy: Path, experiments: int, place: Path, *, records: bool) -> float:
    """Run the campaign; return the CPU time (s) of all its processes."""
    out = place / "run"
    command = [sys.executable, "-m", "mutator", "run", "recording.yaml", "--out", str(out), "-n", "0"]
    command += ["--limit", str(experiments)]
    shutil.rmtree(place / "cache" / "mutator" / "finished", ignore_errors=True)
    environment = os.environ | {"PYTHONPATH": str(copy), "XDG_CACHE_HOME": str(place / "cache")}
    with subprocess.Popen(
        command, cwd=copy, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        assert process.stderr is not None
        errors = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(errors.decode())
    assert any((out / "executed").glob("*")) == records
    shutil.rmtree(out)
    return usage.ru_utime + usage.ru_stime


def interval(ratios: list[float]) -> tuple[float, float, float]:
    """Return the geometric mean of ratios, and its 95 % interval."""
    logs = [math.log(ratio) for ratio in ratios]
    half = float(student.ppf(0.975, len(logs) - 1)) * stdev(logs) / math.sqrt(len(logs))
    return math.exp(fmean(logs)), math.exp(fmean(logs) - half), math.exp(fmean(logs) + half)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--experiments", type=int, default=4)
    options = parser.parse_args()
    if sys.version_info < (3, 12):
        print("needs Python 3.12 or later, where runs note what they execute")
        return 1
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        copies = {
            records: copy_harness(place / f"records-{records}", records=records) for records in (True, False)
        }
        for records, copy in copies.items():  # fills the caches
            cpu_of_campaign(copy, options.experiments, place, records=records)
        ratios = []
        for number in range(options.pairs):
            cpu_s = {}
            for records in (True, False) if number % 2 == 0 else (False, True):
                cpu_s[records] = cpu_of_campaign(copies[records], options.experiments, place, records=records)
            ratios.append(cpu_s[True] / cpu_s[False])
            print(f"{cpu_s[True]:6.2f} s with, {cpu_s[False]:6.2f} s without: {ratios[-1]:.3f}", flush=True)
    mean, low, high = interval(ratios)
    print(
        f"recording costs {mean - 1:+.1%} ({low - 1:+.1%} to {high - 1:+.1%}); goal: at most {GOAL - 1:.0%}"
    )
    return int(mean > GOAL)


if __name__ == "__main__":
    sys.exit(main())
