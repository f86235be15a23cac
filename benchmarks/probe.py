"""What a probe costs that never acts: the null mutant against the pristine tree, in 30 s of driving.

`python benchmarks/probe.py [--pairs N]`. Each run has a fresh interpreter; the two trees take turns, and the
least CPU time of each counts. Exit code 1 where the null mutant is slower by more than its goal.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator import bytecode, mutant  # noqa: E402
from mutator.trigger import always  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

GOAL = 1.02
DRIVE = """\
import sys
from time import process_time
from selfdrive.sim.run import open_run
times = []
for _ in range(2):
    run = open_run(["--scenario", sys.argv[1], "--out", "."])
    began = process_time()
    while not run.done:
        run.step()
    times.append(process_time() - began)
print(min(times))
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=5, metavar="N")
    options = parser.parse_args()
    workspace = Workspace.find(root=ROOT)
    manifest = workspace.manifest("openpilot")
    null = mutant.build(manifest, workspace.fault_models(), None, always()).files
    seconds: dict[str, list[float]] = {"pristine": [], "null mutant": []}
    with tempfile.TemporaryDirectory() as folder:
        for name, files in (("pristine", {}), ("null mutant", null)):
            bytecode.write_compiled({**manifest.tree.files, **files}, Path(folder, name))
        for _ in range(options.pairs):
            for name, times in seconds.items():
                times.append(_drive(Path(folder, name), workspace.scenario("S1")))
    least = {name: min(times) for name, times in seconds.items()}
    for name, time in least.items():
        print(f"{name:12} {time:.4f} s of CPU")
    ratio = least["null mutant"] / least["pristine"]
    print(f"ratio        {ratio:.4f} (at most {GOAL})")
    return int(ratio > GOAL)


def _drive(tree: Path, scenario: Path) -> float:
    command = [sys.executable, "-c", DRIVE, str(scenario)]
    environment = os.environ | {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


if __name__ == "__main__":
    sys.exit(main())
