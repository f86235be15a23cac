"""Measure the cost of finding which channels diverged from the golden run.

`python benchmarks/propagation.py [--repeat N]`. It compares the CPU time of a verdict on all channels with
that of a verdict on the needed ones, as a share of the CPU time of the run: one experiment of the shipped
target on the reference engine. The goal is at most 1 %.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import process_time

import mutator
from mutator.outcomes.channel_departures import departures_from_golden
from mutator.outcomes.golden_trace_comparison import compare_traces
from mutator.outcomes.hazard_and_metric_judgement import load_manifest_channels
from mutator.outcomes.trace_and_record_loading import load_trace
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
GOAL = 0.01  # of the CPU of a run


def cpu_ms(todo: Callable[[], object], repeat: int) -> float:
    todo()
    began = process_time()
    for _ in range(repeat):
        todo()
    return 1000 * (process_time() - began) / repeat


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeat", type=int, default=200)
    repeat = parser.parse_args().repeat
    workspace = Workspace.find(root=ROOT)
    before = getrusage(RUSAGE_CHILDREN)
    trial = mutator.try_fault("radar/chaff", "S1", "C2", workspace=workspace)
    after = getrusage(RUSAGE_CHILDREN)
    run_ms = 1000 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / 2  # two runs
    manifest, out = workspace.manifest("openpilot"), trial.folder / "faulty"
    golden, faulty = (
        load_manifest_channels(manifest, trial.single.golden),
        load_manifest_channels(manifest, out),
    )
    needed = [*dict.fromkeys((*manifest.compared_channels, *manifest.criteria_channels))]
    time = manifest.time_channel
    parts = {
        "load what a verdict needs": cpu_ms(lambda: load_trace(manifest, out, needed), repeat),
        "load all channels": cpu_ms(lambda: load_manifest_channels(manifest, out), repeat),
        "compare actuators": cpu_ms(
            lambda: compare_traces(golden, faulty, manifest.compared_channels, time), repeat
        ),
        "compare all channels": cpu_ms(
            lambda: departures_from_golden(golden, faulty, manifest.channels, time, None), repeat
        ),
    }
    for name, ms in parts.items():
        print(f"{name:26} {ms:8.2f} ms")
    more = parts["load all channels"] - parts["load what a verdict needs"] + parts["compare all channels"]
    print(f"{'the run':26} {run_ms:8.0f} ms\ncost of {len(manifest.channels)} channels: {more / run_ms:.2%}")
    return 1 if more > GOAL * run_ms else 0


if __name__ == "__main__":
    raise SystemExit(main())
