"""Measure the cost of a probe that never acts: the null mutant against the pristine program.

`python benchmarks/probe.py [--rounds N]`. Both simulate the same scenario for 30 s in one interpreter,
alternating every 20 steps, so that other work on the machine affects both. The result is the median ratio
of all pairs of 20-step stretches.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.engines.job_tree_pool import JobTreePool  # noqa: E402
from mutator.mutants.mutant_building import build  # noqa: E402
from mutator.mutants.probe_contract import probe_path  # noqa: E402
from mutator.triggers.trigger_kinds import always_trigger  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

GOAL = 1.02
DRIVE = """\
import sys
import types
from time import process_time
from selfdrive.sim import run as entry

def begun(file):  # starts the simulator defined in that file; everything else is the same for both
    module = types.ModuleType("selfdrive.sim.simulator")
    with open(file) as source:
        exec(compile(source.read(), file, "exec"), vars(module))
    entry.Simulator = module.Simulator
    return entry.open_run(["--scenario", sys.argv[1], "--out", "."])

for number in range(int(sys.argv[2])):
    runs = [begun(file) for file in sys.argv[3:]]
    stretch = 0
    while not all(run.done for run in runs):
        took = [0.0, 0.0]
        for which in (0, 1) if (number + stretch) % 2 else (1, 0):
            run, began = runs[which], process_time()
            for _ in range(20):
                if not run.done:
                    run.step()
            took[which] = process_time() - began
        print(*took)
        stretch += 1
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=8, metavar="N")
    options = parser.parse_args()
    workspace = Workspace.find(root=ROOT)
    manifest = workspace.manifest("openpilot")
    null = build(manifest, workspace.fault_models(), None, always_trigger()).files
    (changed,) = null.keys() - {probe_path(manifest.probe_package)}
    with tempfile.TemporaryDirectory() as folder:
        base = JobTreePool(manifest.tree, Path(folder), manifest.entry_module)
        trees = {"pristine": Path(folder, "pristine"), "null mutant": Path(folder, "null")}
        base.lay_out_tree(trees["pristine"], {})
        base.lay_out_tree(trees["null mutant"], null)
        files = [str(tree / changed) for tree in trees.values()]
        command = [sys.executable, "-c", DRIVE, str(workspace.scenario("S1")), str(options.rounds), *files]
        environment = os.environ | {"PYTHONPATH": str(trees["null mutant"]), "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    pairs = [tuple(map(float, line.split())) for line in done.stdout.splitlines()]
    for name, times in zip(trees, zip(*pairs, strict=True), strict=True):
        print(f"{name:12} {sum(times) / options.rounds:.4f} s of CPU")
    ratio = median(with_probe / without for without, with_probe in pairs)
    print(f"ratio        {ratio:.4f} (at most {GOAL}), the median of {len(pairs)} pairs")
    return int(ratio > GOAL)


if __name__ == "__main__":
    sys.exit(main())
