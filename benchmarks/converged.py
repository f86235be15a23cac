"""Estimate what a campaign could save by ending runs that have become equal to the golden run.

`python benchmarks/converged.py RUN [--json FILE]`. Once the fault is over and a fork's state equals the
golden run's, the fork could end and copy the rest from the golden run. This prints an upper bound on the
saving, as a share of the CPU of all runs. If a trace has the golden run's bytes, everything after the last
activation counts as saved; otherwise, everything after the last difference from the golden run in any channel
of the series (six digits, 20 values a second). Equal channels are necessary for equal
states, but not sufficient.
"""

import argparse
import json
import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.model import Record, Status  # noqa: E402
from mutator.outcomes.trace_and_record_loading import trace_digest  # noqa: E402
from mutator.store import plan_file  # noqa: E402
from mutator.store.run_folder import RunFolder  # noqa: E402
from mutator.store.series_format import Series  # noqa: E402
from mutator.store.time_series_folder import TimeSeriesFolder  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

WORTH_IT = 0.02  # of the CPU
_LAST_S = 0.06  # a fault that acts in every fifth step can be last active this long before the end of the run


@dataclass
class Saved:
    runs: Counter[str] = field(default_factory=Counter)
    cpu_s: Counter[str] = field(default_factory=Counter)


def last_difference(golden: Series, faulty: Series) -> float:
    """Return the last time (s) at which a channel differs from the golden run, or -inf."""
    last = -math.inf
    for number, (one, other) in enumerate(zip(golden.channel_values, faulty.channel_values, strict=True)):
        times, known = faulty.times_of(number), golden.times_of(number)
        rows = min(len(one), len(other))
        if len(one) != len(other) or not np.array_equal(times[:rows], known[:rows]):
            return math.inf  # a run of another length
        differs = np.flatnonzero(one.view("<u4") != other.view("<u4"))
        if differs.size:
            last = max(last, float(times[differs[-1]]))
    points = faulty.extra_points
    differs = np.flatnonzero(points.golden_values.view("<u4") != points.faulty_values.view("<u4"))
    return max(last, float(points.t[differs].max(initial=-math.inf)))


def bound(folder: RunFolder, workspace: Workspace) -> tuple[Saved, float]:
    """Return an upper bound on the saving, and the CPU time (s) of all runs."""
    manifest, series = workspace.manifest(folder.head.target), TimeSeriesFolder(folder.path)
    timings, records = folder.timings(), folder.records()
    digests: dict[Path, str] = {}
    saved, total = Saved(), 0.0
    for experiment in plan_file.load_experiments(folder.path):
        record = records[experiment.id]
        cpu_s = timings[experiment.id]["cpu_s"]
        total += cpu_s
        golden = folder.golden_folder(experiment.scenario, experiment.changes)
        digests[golden] = digests.get(golden) or trace_digest(manifest, golden)
        if cpu_s and record.status is Status.OK and record.activation:
            kind, share = _saved(record, digests[golden], series)
            saved.runs[kind] += 1
            saved.cpu_s[kind] += share * cpu_s
    return saved, total


def _saved(record: Record, golden: str, series: TimeSeriesFolder) -> tuple[str, float]:
    found, active = series.load_series(record.experiment_id, record), record.activation
    if found is None or active is None:
        return "without a series", 0.0
    end = float(found[0].facts["end"])
    same = record.trace_digest == golden
    over = max(active.last, -math.inf if same else last_difference(*found))
    kind = "equal to the golden run throughout" if same else "equal to the golden run again"
    if over >= end - _LAST_S:
        return f"{kind}, fault active to the end" if same else "different or fault active to the end", 0.0
    return f"{kind}, fault over before the end", (end - over) / (end - active.first)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("run", type=Path, help="folder of a finished campaign")
    parser.add_argument(
        "--library", type=Path, metavar="DIR", help="the campaign's fault library, if not the default one"
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(arguments)
    saved, total = bound(RunFolder.open(options.run), Workspace.find(root=ROOT, library=options.library))
    for kind, count in saved.runs.most_common():
        print(f"{count:6} runs {kind}: at most {saved.cpu_s[kind] / total:6.2%} of the CPU of all runs")
    share = sum(saved.cpu_s.values()) / total
    print(f"all together at most {share:.2%} of {total:.1f} s (worthwhile at {WORTH_IT:.0%} or more)")
    if options.json:
        facts = {"runs": saved.runs, "cpu_s": saved.cpu_s, "total_cpu_s": total, "share": share}
        options.json.write_text(json.dumps(facts, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
