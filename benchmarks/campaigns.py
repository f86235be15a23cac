"""Measure whole campaigns with one worker and with two.

`python benchmarks/campaigns.py [--campaign paper_smoke]`. A first run fills the caches (frames, detections,
passed checks) and is not compared. Then runs with one worker and with two alternate. CPU time covers all
processes. Wall times are meaningful only on otherwise idle cores.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
WORKERS = (1, 2)


def run(campaign: str, workers: int, out: Path, more: Sequence[str]) -> dict[str, float]:
    command = [sys.executable, "-m", "mutator", "run", campaign, "--out", str(out), "-n", str(workers)]
    command.append("--no-reuse")
    before, began = _cpu(), time.monotonic()
    subprocess.run([*command, *more], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    return {"wall_s": time.monotonic() - began, "cpu_s": _cpu() - before}


def _cpu() -> float:
    """Return the CPU time (s) of this process's finished children and their descendants."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def summary_of(name: str, took: dict[str, float], count: int) -> None:
    print(
        f"{name:24}{took['wall_s']:9.1f} s wall {took['cpu_s']:9.1f} s CPU  {count / took['wall_s']:7.2f} "
        f"experiments a second, {1e3 * took['cpu_s'] / count:8.1f} ms of CPU each",
        flush=True,
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--campaign", default="paper_smoke")
    parser.add_argument("--limit", metavar="N", help="run only N experiments of the campaign")
    parser.add_argument("--engine", help="reference or fork, if not the one that mutator chooses")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    chosen = {"--limit": options.limit, "--engine": options.engine}
    more = [word for name, value in chosen.items() if value for word in (name, value)]
    figures: dict[str, list[dict[str, float]]] = {str(workers): [] for workers in WORKERS}
    with tempfile.TemporaryDirectory() as place:
        first = run(options.campaign, max(WORKERS), Path(place) / "first", more)
        results = (Path(place) / "first" / "results.csv").read_bytes()
        count = results.count(b"\n") - 1
        summary_of(f"first, {max(WORKERS)} workers", first, count)
        same = True
        for number in range(options.rounds):
            for workers in WORKERS if number % 2 == 0 else reversed(WORKERS):
                out = Path(place) / f"{number}-{workers}"
                figures[str(workers)].append(run(options.campaign, workers, out, more))
                summary_of(f"{workers} worker{'s' * (workers > 1)}", figures[str(workers)][-1], count)
                same &= (out / "results.csv").read_bytes() == results
    ratios = {
        key: median(one[key] / two[key] for one, two in zip(figures["1"], figures["2"], strict=True))
        for key in ("wall_s", "cpu_s")
    }
    print(f"two workers: {ratios['wall_s']:.2f} times as fast, for {1 / ratios['cpu_s']:.2f} times the CPU")
    print(f"results are the same: {same}")
    if options.json:
        facts = {"campaign": options.campaign, "experiments": count, "first": first, "same": same}
        options.json.write_text(json.dumps(facts | {"workers": figures}, indent=1) + "\n")
    return int(not same)


if __name__ == "__main__":
    sys.exit(main())
