"""A campaign by this version and by an older one: `python benchmarks/against.py CLONE [--campaign NAME]`.

CLONE is a checkout of the older commit; both run in this environment, in turn, each time with an empty cache.
What an old version compiles by a command of its own is compiled before its clock starts. CPU time is that of
all processes. Wall time needs cores that nobody else uses. Exit code 1 when a run fails.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
HELPERS = ("-m", "selfdrive.sim.compile_helpers")


def run(clone: Path, campaign: str, workers: int, more: list[str]) -> dict[str, float]:
    """Run a campaign with the sources of `clone` and nothing kept; wall and CPU seconds."""
    with tempfile.TemporaryDirectory() as place:
        paths = os.pathsep.join([str(clone), str(clone / "target")])
        env = os.environ | {"PYTHONPATH": paths, "XDG_CACHE_HOME": f"{place}/cache"}
        if clone != ROOT:
            cache = f"{place}/cache/mutator/targets/openpilot"
            said = subprocess.run(
                [sys.executable, *HELPERS, "--help"], env=env, capture_output=True, text=True
            )
            if "--cache" in said.stdout:
                subprocess.run(
                    [sys.executable, *HELPERS, "--cache", cache], env=env, check=True, stdout=sys.stderr
                )
        command = [
            sys.executable,
            "-m",
            "mutator",
            "run",
            campaign,
            "--out",
            f"{place}/run",
            "-n",
            str(workers),
        ]
        before, began = _cpu(), time.monotonic()
        subprocess.run([*command, *more], cwd=clone, env=env, check=True, stdout=subprocess.DEVNULL)
        return {"wall_s": time.monotonic() - began, "cpu_s": _cpu() - before}


def _cpu() -> float:
    """CPU time (s) of all that this process waited for, and of all that those waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clone", type=Path, help="checkout of the older commit")
    parser.add_argument("--campaign", default="paper_sample")
    parser.add_argument("--limit", metavar="N", help="so many of its experiments")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    more = ["--limit", options.limit] if options.limit else []
    clones = {"older": options.clone.resolve(), "this": ROOT}
    figures: dict[str, list[dict[str, float]]] = {name: [] for name in clones}
    for number in range(options.rounds):
        for name in clones if number % 2 == 0 else reversed(clones):
            took = run(clones[name], options.campaign, options.workers, more)
            figures[name].append(took)
            print(f"{name:8}{took['wall_s']:9.1f} s wall {took['cpu_s']:9.1f} s CPU", flush=True)
    for key, words in (("cpu_s", "CPU"), ("wall_s", "wall time")):
        older, this = (median(one[key] for one in figures[name]) for name in clones)
        print(f"{words}: {older:.1f} s, now {this:.1f} s: ratio {this / older:.2f}")
    if options.json:
        options.json.write_text(json.dumps({"campaign": options.campaign, "runs": figures}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
