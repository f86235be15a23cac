"""A finished exploration of the toy, and how its run folder is edited."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mutator
from mutator._common.hashing import digest
from mutator.audit.run_audit import AuditCheck
from mutator.campaigns.bench_files import EXPERIMENTS_PER_CHUNK
from mutator.campaigns.plan import load_plan
from mutator.campaigns.plan_freezing import PLAN_CSV, plan_csv_bytes
from mutator.campaigns.plan_growth import BatchChain
from mutator.campaigns.plan_tally import plan_digest
from mutator.explore.envelope_files import ENVELOPES_FILE
from mutator.model import Experiment
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD
from mutator.workspace import Workspace

Reseal = Callable[..., None]
Explored = tuple[Workspace, Path]  # a workspace, and the run folder of an exploration in it
CHECK = "proposals that follow from the records"


def explore(workspace: Workspace, out: Path, spec: str = "sensor/lane/shifted", **choices: Any) -> None:
    sizes: dict[str, Any] = {"points": 9, "longest_s": 4.0, "observe_s": 0.5, "validation": 6}
    mutator.envelope(spec, "A", 1.0, out, campaign="small", workspace=workspace, **(sizes | choices))


def check_of(run: Path, workspace: Workspace) -> AuditCheck:
    audit = mutator.verify(run, workspace=workspace)
    return next(check for check in audit.checks if check.checked_parts == CHECK)


def batches_of(run: Path) -> list[list[Experiment]]:
    experiments = iter(plan_file.load_experiments(run))
    lines = (json.loads(line) for line in (run / plan_file.BATCHES_FILE).read_text().splitlines())
    return [[next(experiments) for _ in range(line["experiments"])] for line in lines]


def reasons_of(run: Path) -> list[str]:
    lines = (run / plan_file.BATCHES_FILE).read_text().splitlines()
    return [json.loads(line)["reason"] for line in lines]


def write_batches(run: Path, batches: list[list[Experiment]], reasons: list[str] | None = None) -> None:
    """Write the plan anew, with all that follows from it."""
    chain, reasons = BatchChain(), reasons or [f"exploration, batch {n + 1}" for n in range(len(batches))]
    lines = [chain.line_of_next(len(batch), reason) for batch, reason in zip(batches, reasons, strict=True)]
    (run / plan_file.BATCHES_FILE).write_bytes(b"".join(lines))
    plan = load_plan(RunFolder.open_unverified(run))
    experiments = tuple(experiment for batch in batches for experiment in batch)
    count = len(experiments)
    sizes = [min(EXPERIMENTS_PER_CHUNK, count - n) for n in range(0, count, EXPERIMENTS_PER_CHUNK)]
    chunks = plan_file.write_plan(run, experiments, sizes)
    canary = plan.canary.id if plan.canary else ""
    edit_head(
        run,
        chunks=chunks,
        experiments=count,
        plan=plan_digest([e.id for e in experiments], (), canary, plan.campaign),
    )
    (run / PLAN_CSV).write_bytes(plan_csv_bytes(replace(plan, experiments=experiments)))


def edit_head(run: Path, **values: Any) -> None:
    head = json.loads((run / HEAD).read_text())
    (run / HEAD).write_text(json.dumps(head | values))


def edit_campaign(run: Path, pattern: str, replacement: str) -> None:
    text = (run / CAMPAIGN_FILE).read_text()
    edited = re.sub(pattern, replacement, text, count=1)
    assert edited != text
    (run / CAMPAIGN_FILE).write_text(edited)
    edit_head(run, campaign_digest=digest(edited.encode()))


def edit_record(run: Path, is_chosen: Callable[[dict[str, Any]], bool], **values: Any) -> None:
    for path in sorted((run / "records").iterdir()):
        lines = path.read_text().splitlines()
        for number, line in enumerate(lines[1:], 1):
            record = json.loads(line)
            if is_chosen(record):
                lines[number] = json.dumps(record | values)
                path.write_text("".join(f"{line}\n" for line in lines))
                return
    raise AssertionError("no such record")


def edit_envelopes(run: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    content = json.loads((run / ENVELOPES_FILE).read_text())
    before = json.dumps(content)
    edit(content["planes"][0])
    assert json.dumps(content) != before
    (run / ENVELOPES_FILE).write_text(json.dumps(content))


def replace_in_batch(run: Path, batch: int, number: int, forged: Callable[[Experiment], Experiment]) -> None:
    batches = batches_of(run)
    batches[batch][number] = forged(batches[batch][number])
    write_batches(run, batches)


def keep_records(run: Path, names: list[str]) -> None:
    for path in (run / "records").iterdir():
        head, *lines = path.read_text().splitlines()
        kept = [line for line in lines if json.loads(line)["experiment_id"] in names]
        path.write_text("".join(f"{line}\n" for line in (head, *kept)))


def check_finds(explored: Explored, run: Path, reseal: Reseal, forge: Callable[[Path], None]) -> None:
    """Edit a run and redo its digests: the check names what does not follow, it does not merely stumble."""
    forge(run)
    reseal(run)
    [difference, *_] = check_of(run, explored[0]).differences
    texts = r"follow|'exploration, batch|no further batch|no exploration"
    assert re.search(texts, str(difference)), difference
