"""Measure the cost of series and patches: bytes per experiment and their share of its CPU.

`python benchmarks/series.py [--campaign paper_sample] [--experiments 60] [--json FILE]`. It runs that many
experiments of a campaign in this process and prints the time for building and appending the series and the
patch, relative to the CPU time of the same experiments. Bytes are those of the finished run folder. The
parts that grow with the experiments are scaled to 11,280.
"""

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.execution import experiment_runner  # noqa: E402
from mutator.execution.campaign_running import run_campaign  # noqa: E402
from mutator.store.packed_patches import PatchWriter  # noqa: E402
from mutator.store.plan_choices import Choices  # noqa: E402
from mutator.store.run_folder import RunFolder  # noqa: E402
from mutator.store.series_packing import SeriesWriter  # noqa: E402
from mutator.store.time_series_folder import TimeSeriesFolder  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

PAPER, GOAL_BYTES, GOAL_SHARE, GOAL_MB = 11_280, 6_000, 0.01, 150
GROWING = ("patches", "series", "records", "timings", "plan", "plan.csv", "report")


class Clock:
    def __init__(self) -> None:
        self.times: list[float] = []

    def on(self, owner: Any, name: str) -> None:
        function: Callable[..., Any] = getattr(owner, name)

        def timed(*words: Any, **keywords: Any) -> Any:
            began = process_time()
            try:
                return function(*words, **keywords)
            finally:
                self.times.append(process_time() - began)

        setattr(owner, name, timed)


def measured(campaign: str, count: int, out: Path) -> dict[str, float]:
    made, series, patches = Clock(), Clock(), Clock()
    made.on(experiment_runner.ExperimentRunner, "_encode_series")
    series.on(SeriesWriter, "append")
    patches.on(PatchWriter, "append")
    workspace = Workspace.find(root=ROOT)
    summary = run_campaign(workspace, campaign, out, choices=Choices(limit=count), reuse=False)
    folder = RunFolder.open(out)
    cpu = [float(line["cpu_s"]) for line in folder.timings().values()]
    index = TimeSeriesFolder(out).index
    assert index is not None
    sizes = {name: size_of(out / name) for name in GROWING}
    results = sum(size_of(path) for path in out.glob("*.parquet")) + size_of(out / "results.csv")
    goldens = sum(index.entry_sizes[number] for number in {*index.entry_number_by_golden.values()})
    each = {**sizes, "series": sizes["series"] - goldens, "results": results}
    del each["report"]  # its page is measured by report_page.py
    rest = size_of(out) - sum(each.values())
    return {
        "experiments": summary.done,
        "series_bytes": each["series"] / summary.done,
        "patch_bytes": each["patches"] / summary.done,
        "series_share": (sum(made.times) + sum(series.times)) / sum(cpu),
        "series_ms": 1e3 * (statistics.median(made.times) + statistics.median(series.times)),
        "patch_share": sum(patches.times) / sum(cpu),
        "patch_ms": 1e3 * statistics.median(patches.times),
        "experiment_ms": 1e3 * statistics.median(cpu),
        "paper_mb": (sum(each.values()) / summary.done * PAPER + rest) / 1e6,
    }


def size_of(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--campaign", default="paper_sample")
    parser.add_argument("--experiments", type=int, default=60)
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measured(options.campaign, options.experiments, Path(folder) / "run")
    print("{experiments:.0f} experiments, median CPU of each {experiment_ms:.0f} ms".format(**found))
    print(
        "series: {series_bytes:.0f} bytes, {series_ms:.2f} ms, {series_share:.2%} of the CPU".format(**found)
    )
    print("patches: {patch_bytes:.0f} bytes, {patch_ms:.2f} ms, {patch_share:.2%} of the CPU".format(**found))
    print(f"the folder of {PAPER:,} experiments: {found['paper_mb']:.0f} MB")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")
    share = found["series_share"] + found["patch_share"]
    missed = found["series_bytes"] > GOAL_BYTES or share > GOAL_SHARE or found["paper_mb"] > GOAL_MB
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
