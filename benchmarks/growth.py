"""Measure how time and memory grow with the campaign.

`python benchmarks/growth.py [--json FILE]`. It measures plans of 1,000 to 50,000 experiments, a table of
100,000 and opening a run of the paper's 11,280. Each size runs in its own process, which plans and freezes,
or does a worker's work before and after each run (read the chunk, build the mutant, append the record). Times
are CPU times.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from time import process_time

from mutator._common.hashing import digest
from mutator.audit.run_digests_and_seal import seals_of
from mutator.campaigns.plan import Plan, build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Experiment, ObservedActivation, Outcome, Record, Status
from mutator.mutants.mutant_building import build
from mutator.results import table_building
from mutator.statistics.results_frame import load_usable_results
from mutator.store import file_digests, plan_file
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checksummed_lines import LineWriter
from mutator.store.file_digests import FileDigest
from mutator.store.packed_patches import PatchWriter
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
SIZES = (1_000, 5_000, 20_000, 50_000)
TABLE, LOAD_GOAL_S = 100_000, 2.0
PAPER, OPEN_GOAL_S = 11_280, 1.0
GOLDEN_BYTES = 650_000
PATCH_BYTES = 7200
CHUNK = 20
MORE_MEMORY_MB = 5.0  # growth of a worker from 1,000 to 50,000 experiments


def plan_of(workspace: Workspace, size: int) -> Plan:
    """Return a plan of the paper's campaign in as many scenarios as needed, cut to `size` experiments."""
    text = workspace.campaign("paper").read_text()
    names = list(workspace.scenarios)
    scenarios = names[: -(-size // 2256)]  # a scenario has 282 faults, 4 contexts and 2 methods
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "paper.yaml"
        path.write_text(text.replace("[S1, S2, S3, S4, S5]", f"[{', '.join(scenarios)}]"))
        plan = build_plan(workspace, path)
    count = min(size, len(plan.experiments))
    chunks = tuple(min(CHUNK, count - first) for first in range(0, count, CHUNK))
    return replace(plan, experiments=plan.experiments[:count], chunks=chunks)


def record(experiment: Experiment, number: int) -> Record:
    """Return a synthetic record. Every column is filled in some rows and empty in others."""
    active, hazard = number % 5 > 0, number % 10 > 6
    return Record(
        experiment_id=experiment.id,
        status=Status.OK,
        outcome=Outcome.HAZARD if hazard else Outcome.SDC if active else Outcome.NOT_ACTIVATED,
        detail="",
        tree="f" * 64,
        activation=ObservedActivation(first=2.0 + number % 997 / 100, last=30.0, count=number)
        if active
        else None,
        t_manifest=2.05 + number % 997 / 100 if active else None,
        max_dev=(("gas", number / 7), ("brake", number / 11), ("steer_torque", number / 13)),
        hazards=(("H1", 20.0 + number % 997 / 100),) if hazard else (),
        alerts=(("fcw", 19.0 + number % 997 / 100),) if hazard else (),
        trace_digest="f" * 64,
        left=_left(number) if active else (),
    )


@cache
def _channels() -> tuple[str, ...]:
    manifest = Workspace.find(root=ROOT).manifest("openpilot")
    return tuple(channel.name for channel in manifest.channels)


def _left(number: int) -> tuple[tuple[str, float, float], ...]:
    """Return divergences of almost every channel, each at a different time."""
    start = 2.05 + number % 997 / 100
    names = [name for place, name in enumerate(_channels()) if (number + place) % 7]
    return tuple((name, start + place / 100, number / (7 + place)) for place, name in enumerate(names))


def most_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def planning(size: int, out: Path) -> dict[str, float]:
    workspace = Workspace.find(root=ROOT)
    began = process_time()
    plan = plan_of(workspace, size)
    planned = process_time()
    freeze_plan(plan, out, workspace)
    frozen = process_time()
    return {"plan_s": planned - began, "freeze_s": frozen - planned, "memory_mb": most_mb()}


def working(size: int, out: Path) -> dict[str, float]:
    workspace = Workspace.find(root=ROOT)
    folder = RunFolder.open(out)
    manifest, models = workspace.manifest(folder.head.target), workspace.fault_models()
    lines = LineWriter(
        out / "records" / "0001-main.jsonl", {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
    )
    began = process_time()
    faults = plan_file.load_faults(out)
    number = 0
    for chunk in folder.head.chunks:
        for experiment in plan_file.load_chunk(out, chunk, faults):
            build(manifest, models, experiment.fault, experiment.trigger)
            lines.append(asdict(record(experiment, number)))
            number += 1
    lines.close()
    return {"work_ms": (process_time() - began) / number * 1e3, "memory_mb": most_mb()}


def written_run(size: int, out: Path, patch: bytes = b"") -> RunFolder:
    """Write a run folder with that many synthetic records and, if given a patch, as many copies of it."""
    workspace = Workspace.find(root=ROOT)
    plan = build_plan(workspace, "paper")
    more = (replace(e, seed=e.seed + k) for k in range(size) for e in plan.experiments)
    experiments = tuple(next(more) for _ in range(size))
    folder = freeze_plan(replace(plan, experiments=experiments, chunks=(size,)), out, workspace)
    lines = LineWriter(out / "records" / "0001-main.jsonl", {"schema": RECORDS_SCHEMA, "plan": plan.digest})
    patches = PatchWriter(out, "0001-main")
    for number, experiment in enumerate(experiments):
        if patch:
            patches.append(experiment.id, patch)
        named = digest(patch) if patch else ""
        lines.append(asdict(replace(record(experiment, number), patch=named)))
    lines.close()
    patches.close()
    return folder


def opening(size: int, out: Path) -> dict[str, float]:
    """Open and seal a finished run of that many experiments. Return the CPU times."""
    folder = written_run(size, out, bytes(PATCH_BYTES))
    head, data = folder.head, bytes(GOLDEN_BYTES)
    goldens = [folder.golden_folder(*golden) for golden in head.goldens]
    paths = [golden / name for golden in goldens for name in head.golden_files]
    names = [path.relative_to(folder.path).as_posix() for path in paths]
    checks = b'{"schema": "checks/1", "results": []}'
    with file_digests.announcing_rewrites(
        out, dict.fromkeys(names, FileDigest.of_bytes(data)) | {CHECKS: FileDigest.of_bytes(checks)}
    ):
        for path in paths:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        (out / CHECKS).write_bytes(checks)
    file_digests.add_segments_to_ledger(out, finished=True)
    opened, sealed = [], []
    for _ in range(3):
        start = process_time()
        found = RunFolder.open(out)
        opened.append(process_time() - start)
        start = process_time()
        seals_of(found)
        sealed.append(process_time() - start)
    return {"open_s": min(opened), "seal_s": min(sealed)}


def table(size: int, out: Path) -> dict[str, float]:
    written_run(size, out)
    began = process_time()
    path = table_building.build_tables(out)
    built = process_time()
    times = []
    for _ in range(3):
        start = process_time()
        if len(load_usable_results(path)) != size:
            raise SystemExit("the table is not complete")
        times.append(process_time() - start)
    return {"build_s": built - began, "load_s": min(times)}


def apart(work: str, size: int, out: Path) -> dict[str, float]:
    command = [sys.executable, __file__, "--work", work, str(size), str(out)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--json", type=Path, help="file for the figures")
    parser.add_argument("--work", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        name, size, out = options.work
        works = {"planning": planning, "working": working, "table": table, "opening": opening}
        print(json.dumps(works[name](int(size), Path(out))))
        return
    figures: dict[str, dict[str, float]] = {}
    print(
        f"{'experiments':>12}{'plan ms':>10}{'freeze ms':>10}{'MB':>8}{'worker ms':>11}{'MB':>8}   (ms each)"
    )
    with tempfile.TemporaryDirectory() as folder:
        for size in options.sizes:
            out = Path(folder) / str(size)
            plan, work = apart("planning", size, out), apart("working", size, out)
            each = [plan[key] / size * 1e3 for key in ("plan_s", "freeze_s")]
            print(
                f"{size:12}{each[0]:10.3f}{each[1]:10.3f}{plan['memory_mb']:8.0f}"
                f"{work['work_ms']:11.3f}{work['memory_mb']:8.0f}",
                flush=True,
            )
            figures[str(size)] = plan | {f"worker_{key}": value for key, value in work.items()}
        figures["table"] = apart("table", TABLE, Path(folder) / "table")
        figures["opening"] = apart("opening", PAPER, Path(folder) / "opening")
    print("table of {}: built in {build_s:.1f} s, read in {load_s:.2f} s".format(TABLE, **figures["table"]))
    print("run of {}: opened in {open_s:.2f} s, sealed in {seal_s:.2f} s".format(PAPER, **figures["opening"]))
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    first, last = (figures[str(size)]["worker_memory_mb"] for size in (options.sizes[0], options.sizes[-1]))
    slow = figures["table"]["load_s"] > LOAD_GOAL_S or figures["opening"]["open_s"] > OPEN_GOAL_S
    sys.exit(1 if slow or last - first > MORE_MEMORY_MB else 0)


if __name__ == "__main__":
    main()
