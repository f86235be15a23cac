"""Measure the CPU time of the work around the paper's 11,280 experiments.

`python benchmarks/planning.py`. It measures planning, freezing, reaching the first run, making the
tables and resuming a complete run. The complete run, in which every fault is masked, and the cached checks
are synthetic. The start uses no workers and ends where the first golden run is repeated.
"""

import argparse
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import Any

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.reference_engine import ReferenceEngine
from mutator.execution.campaign_running import run_campaign
from mutator.model import Experiment, Outcome, Record, Status
from mutator.preflight import check_run_problems, preflight_cache, preflight_checks
from mutator.store.checks_file import CHECKS_FILE, CHECKS_SCHEMA
from mutator.store.checksummed_lines import LineWriter
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]


class Table:
    """Prints times as they are measured, with ratios to the first one."""

    def __init__(self) -> None:
        self.count = 0  # experiments
        self._first = 0.0

    def add(self, name: str, seconds: float) -> None:
        self._first = self._first or seconds
        each, ratio = 1e3 * seconds / self.count, seconds / self._first
        print(f"{name:18}{seconds:8.2f} s{each:9.3f} ms an experiment{ratio:8.2f} times planning")

    def timed(self, name: str, work: Callable[[], Any]) -> Any:
        began = process_time()
        done = work()
        self.add(name, process_time() - began)
        return done


def masked(experiment: Experiment) -> Record:
    return Record(
        experiment_id=experiment.id,
        status=Status.OK,
        outcome=Outcome.MASKED,
        detail="",
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(("gas", 0.0), ("brake", 0.0), ("steer_torque", 0.0)),
        hazards=(),
        alerts=(),
        trace_digest="",
    )


def make_up_checks(workspace: Workspace, folder: RunFolder) -> None:
    looked_at = preflight_checks.PreflightChecks(workspace, folder, b"")
    goldens = {}
    for one in looked_at.golden_runs:
        key = one.key
        out = looked_at.pending_folder / "golden" / key
        out.mkdir(parents=True)
        for name in looked_at.manifest.output_files:
            (out / name).write_bytes(bytes(500_000))
        goldens[key] = check_run_problems.output_digest_of(looked_at.manifest, out)
    said = {"schema": CHECKS_SCHEMA, "digest": looked_at.digest, "results": [], "goldens": goldens}
    looked_at._store_in_run_folder(said | {"run_cpu_s": 1.0})
    preflight_cache.store_passed_checks(
        preflight_cache.cached_checks_path(looked_at.digest),
        folder.path,
        CHECKS_FILE,
        looked_at.pending_folder,
    )


def until_the_first_run(workspace: Workspace, out: Path) -> float:
    """Return the CPU seconds until the first run, which repeats a golden run of the cached checks."""
    reached = []

    def stop(self: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        reached.append(process_time())
        raise KeyboardInterrupt

    run, ReferenceEngine.execute = ReferenceEngine.execute, stop  # type: ignore[method-assign]
    began = process_time()
    with suppress(KeyboardInterrupt):
        run_campaign(workspace, "paper", out, engine="reference")
    ReferenceEngine.execute = run  # type: ignore[method-assign]
    return float(reached[0] - began)


def main() -> None:
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    workspace, table = Workspace.find(root=ROOT), Table()
    with tempfile.TemporaryDirectory() as place:
        os.environ["XDG_CACHE_HOME"] = place
        out = Path(place) / "run"
        began = process_time()
        plan = build_plan(workspace, "paper")
        table.count = len(plan.experiments)
        table.add("plan", process_time() - began)
        folder = table.timed("freeze", lambda: freeze_plan(plan, out, workspace))
        make_up_checks(workspace, folder)
        new = out.with_name("new")
        table.add("new, first run", until_the_first_run(workspace, new))
        table.add("frozen, first run", until_the_first_run(workspace, new))
        lines = LineWriter(
            out / "records" / "0001-main.jsonl", {"schema": RECORDS_SCHEMA, "plan": plan.digest}
        )
        for experiment in plan.experiments:
            lines.append(asdict(masked(experiment)))
        lines.close()
        table.timed("tables", lambda: run_campaign(workspace, "paper", out))
        table.timed("resume, complete", lambda: run_campaign(workspace, "paper", out))


if __name__ == "__main__":
    main()
