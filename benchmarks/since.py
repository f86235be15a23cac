"""Change the shipped controller in thirty ways, and compare `--since` with a full run of each change.

`python benchmarks/since.py [--only NAME]`, in Python 3.12 or later. The base run is made first. A full
run of each change then has the golden runs and the records that are true; `--since` is asked which of the
base's records stand. An experiment is missed if its record stands but is another one in the full run. With
`--run`, `--since` also runs, and must give the seal of the full run. A verdict is the status, the outcome and
the hazards of an experiment.
"""

import argparse
import os
import shutil
import sys
import tempfile
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from controller_changes import CHANGES, Change, apply_change  # noqa: E402

import mutator  # noqa: E402
from mutator._common.cache_layout_and_pruning import finished_runs_folder  # noqa: E402
from mutator.campaigns.run_environment import versions_of_fixed_packages  # noqa: E402
from mutator.execution.code_recording import CodeRecording, RecordingAssignment  # noqa: E402
from mutator.execution.finished_run_keys import surroundings_by_name  # noqa: E402
from mutator.execution.unaffected_runs import UnaffectedRuns  # noqa: E402
from mutator.model import Record  # noqa: E402
from mutator.store.plan_file import iterate_experiments  # noqa: E402
from mutator.store.preflight_results import golden_digests  # noqa: E402
from mutator.store.run_folder import RunFolder  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

LEAST_WITH_CHANGED_VERDICT = 15
CAMPAIGN = """\
schema: campaign/1
name: since
about: Faults without pictures in two scenarios.
target: openpilot
scenarios: [S1, S3]
faults:
  - {spec: radar/chaff/*, values: 3}
  - {spec: radar/jamming/*}
  - {spec: car_sensors/speed/slower, values: 4}
  - {spec: car_sensors/steer/*, values: 3}
  - {spec: vision_output/path_model/*, values: 3}
  - {spec: vision_output/camera_unavailable/*}
reading: as_described
methods: [guided]
triggers: {table: accelerate_decelerate, armed_after_s: 1.5}
seed: 1
canary: {spec: vision_output/path_model/both, scenario: S1, hazard: H3, at_s: 5.0}
limits: {cpu_s: 60, wall_s: 300, memory_mb: 4096, steps: 6000}
chunk: 4
"""
# most of them end near the border of a hazard, so that many changes of the controller have another verdict
EXPERIMENTS = (
    'fault_type == "speed" and value > 30 and trigger in ["C2", "C4"]'
    ' or fault_type == "chaff" and value < 200 and trigger == "C2" and scenario == "S1"'
    ' or fault_type == "camera_unavailable" and trigger in ["C1", "C2"] and scenario == "S1"'
    ' or fault_type == "jamming" and trigger == "C2" and scenario == "S1"'
    ' or fault_type == "path_model" and (value > 0.66 or value < -1 and value > -1.7) and trigger == "C2"'
    ' and scenario == "S1"'
    ' or fault_type == "steer" and value > 0 and trigger == "C2" and scenario == "S1"'
)


def run(campaign: Path, out: Path, target: Path, workers: int, since: Path | None = None) -> "mutator.Run":
    workspace = Workspace.find(root=ROOT, target=target)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mutator.run(
            campaign,
            out,
            choices=mutator.Choices(only=EXPERIMENTS),
            workers=workers,
            since=since,
            workspace=workspace,
        )


def verdict_of(record: Record) -> tuple[object, ...]:
    return record.status, record.outcome, tuple(name for name, _ in record.hazards)


def result_of(record: Record) -> Record:
    """Return a record without the digests that every change of the target changes."""
    return replace(record, tree="", patch="")


@dataclass
class Figures:
    """What a change did: numbers of experiments. `is_same`: whether both runs have one seal, if asked."""

    verdicts: int
    results: int
    left_out: int
    missed: int
    is_same: bool | None


def measure(
    change: Change, base: "mutator.Run", campaign: Path, scratch: Path, options: argparse.Namespace
) -> Figures:
    target = scratch / "target"
    shutil.copytree(ROOT / "target", target, ignore=shutil.ignore_patterns("__pycache__"))
    apply_change(change, target)
    full = run(campaign, scratch / "full", target, options.workers)
    is_same = None
    if options.run:
        shutil.rmtree(finished_runs_folder(), ignore_errors=True)
        quick = run(campaign, scratch / "quick", target, options.workers, since=base.path)
        is_same = quick.seal == full.seal and quick.seal is not None
    before, after = dict(base.folder.records()), dict(full.folder.records())
    left_out = standing_records(base.folder, full.folder, target)
    return Figures(
        verdicts=sum(verdict_of(before[name]) != verdict_of(after[name]) for name in before),
        results=sum(result_of(before[name]) != result_of(after[name]) for name in before),
        left_out=len(left_out),
        missed=sum(result_of(before[name]) != result_of(after[name]) for name in left_out),
        is_same=is_same,
    )


def standing_records(base: RunFolder, full: RunFolder, target: Path) -> list[str]:
    """Return the experiments that `--since` leaves out: as in a worker, with the golden runs of `full`."""
    workspace = Workspace.find(root=ROOT, target=target)
    manifest = workspace.manifest("openpilot")
    assignment = RecordingAssignment(
        surroundings=surroundings_by_name(workspace, manifest),
        version_by_package=versions_of_fixed_packages(),
        earlier_run=base.path,
    )
    digests = golden_digests(full)
    unaffected = UnaffectedRuns(
        base.path,
        CodeRecording(assignment, full, manifest),
        manifest,
        lambda experiment: digests[full.golden_run_of(experiment).key],
    )
    return [one.id for one in iterate_experiments(full.path) if not unaffected.reason(one)]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", metavar="NAME", help="only changes of this name")
    parser.add_argument("--run", action="store_true", help="also run each change with --since")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    if sys.version_info < (3, 12):
        print("needs Python 3.12 or later, where runs note what they execute")
        return 1
    changes = [change for change in CHANGES if options.only in (None, change.name)]
    figures = []
    with tempfile.TemporaryDirectory() as place:
        os.environ["XDG_CACHE_HOME"] = f"{place}/cache"
        campaign = Path(place, "since.yaml")
        campaign.write_text(CAMPAIGN)
        base = run(campaign, Path(place, "base"), ROOT / "target", options.workers)
        count = len(base.folder.records())
        print(
            f"{'change':52} verdicts  results  left out of {count}  missed{'  same seal' * options.run}",
            flush=True,
        )
        for change in changes:
            with tempfile.TemporaryDirectory(dir=place) as scratch:
                try:
                    one = measure(change, base, campaign, Path(scratch), options)
                except mutator.MutatorError as error:
                    print(f"{change.group}: {change.name}: {error}", flush=True)
                    continue
            figures.append(one)
            print(
                f"{change.group + ': ' + change.name:52} {one.verdicts:8}  {one.results:7}  {one.left_out:14}"
                f"  {one.missed:6}{'' if one.is_same is None else f'  {one.is_same}'}",
                flush=True,
            )
    changed = sum(one.verdicts > 0 for one in figures)
    missed = sum(one.missed for one in figures)
    saved = sum(one.left_out for one in figures) / (count * len(figures))
    print(f"{changed} of {len(figures)} changed a verdict; {missed} missed; {saved:.0%} left out")
    is_enough = changed >= LEAST_WITH_CHANGED_VERDICT or options.only is not None
    return int(missed > 0 or not is_enough or any(one.is_same is False for one in figures))


if __name__ == "__main__":
    sys.exit(main())
