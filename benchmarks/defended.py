"""Measure what defences add to the CPU time of driving.

`python benchmarks/defended.py [SET ...] [--pairs N]`. A set is names of defences joined by `+`; default: each
shipped one, and all of them. The steps of a run on the defended tree and of one on the target's own tree are
timed in processes of their own, which alternate; both drive scenario S1 without faults.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.engines.pyc_files import write_files  # noqa: E402
from mutator.targets.manifest import TargetManifest  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

GOAL = 1.1
SCENARIO = "S1"
DRIVE = """\
import importlib, sys, time
tree, module, function, *arguments = sys.argv[1:]
sys.path.insert(0, tree)
run = getattr(importlib.import_module(module), function)(arguments)
run.step()
began = time.process_time()
while not run.done:
    run.step()
print(time.process_time() - began)
"""


def drive_cpu_s(manifest: TargetManifest, scenario: Path, tree: Path) -> float:
    """Return the CPU time of the steps of a run in s."""
    with tempfile.TemporaryDirectory() as out:
        arguments = manifest.run_arguments(scenario=scenario, seed=0, out=Path(out))
        command = [sys.executable, "-P", "-c", DRIVE, str(tree), manifest.entry_module]
        command += [manifest.stepwise_function or "", *arguments]
        return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", metavar="SET")
    parser.add_argument("--pairs", type=int, default=5, metavar="N")
    options = parser.parse_args()
    workspace = Workspace.find(root=ROOT)
    manifest, scenario = workspace.manifest("openpilot"), workspace.scenario(SCENARIO)
    sets = options.sets or [*workspace.defences, "+".join(workspace.defences)]
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder, "own")
        write_files(manifest.tree.files, own)
        for number, name in enumerate(sets):
            defended = Path(folder, f"defended{number}")
            write_files(workspace.defended(manifest, name.split("+")).tree.files, defended)
            ratios = []
            for _ in range(options.pairs):
                undefended_s = drive_cpu_s(manifest, scenario, own)
                ratios.append(drive_cpu_s(manifest, scenario, defended) / undefended_s)
            worst = max(worst, median(ratios))
            print(f"{name}: {median(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f})", flush=True)
    print(f"largest median {worst:.3f}, goal {GOAL}")
    return int(worst > GOAL)


if __name__ == "__main__":
    sys.exit(main())
