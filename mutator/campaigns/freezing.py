"""Freezes a plan into a run folder, together with the digests of its sources."""

import csv
import io
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path

from mutator._common.files import (
    is_half_written,
    make_folder,
    remove_folder,
    write_atomic,
    writing_atomic,
)
from mutator._common.folder_locks import owning_run_folder
from mutator._common.hashing import as_json_types, digest
from mutator._common.version import VERSION
from mutator.campaigns.plan import Plan, Planning
from mutator.campaigns.plan_parts import Part, PlanDigest, Tally
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources, check_version
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.results.plan_columns import PLAN_COLUMN_NAMES, plan_row
from mutator.store import file_digests, plan_file
from mutator.store.allowed_contents import check_contents
from mutator.store.file_digests import DigestingFile, DigestLedger, FileDigest
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN, HEAD, SCHEMA, Provenance, RunHead
from mutator.targets.manifest import TargetManifest
from mutator.targets.target_facts import TargetFacts, channel_facts, hazard_facts, metric_facts
from mutator.workspace import Workspace

CSV = "plan.csv"
_OURS = (
    "owner.lock",
    "workers",
    "plan",
    CSV,
    CAMPAIGN,
    file_digests.FILE,
)  # files that a killed freeze can leave


def freeze(plan: Plan | Planning, out: Path, workspace: Workspace) -> RunFolder:
    """Write the plan and plan.csv into the run folder `out`, which is created if missing.

    A folder with the same plan is left unchanged. MutatorError if the folder has another plan, changed
    sources or other content, or is in use.
    """
    return freeze_and_tell(plan, out, workspace)[0]


def freeze_and_tell(plan: Plan | Planning, out: Path, workspace: Workspace) -> tuple[RunFolder, Tally]:
    """Like `freeze`, but also return the plan's totals."""
    is_new = not out.exists()
    make_run_folder(out)
    try:
        with owning_run_folder(out):
            return freeze_owned(plan, out, workspace)
    except BaseException:
        if is_new and not RunFolder.exists(out):
            remove_folder(out)
        raise


def make_run_folder(out: Path) -> None:
    """Create `out` unless it is a run folder; MutatorError if it contains anything else, such as links."""
    if out.is_dir():
        check_contents(out.resolve())
    if out.exists() and not RunFolder.exists(out):
        names = [path.name for path in out.iterdir()] if out.is_dir() else [out.name]
        strangers = [name for name in names if name not in _OURS and not is_half_written(name)]
        if strangers:
            raise MutatorError(
                f"this folder has no {HEAD} and is not empty ({', '.join(sorted(strangers)[:3])})",
                where=out,
                argument="out",
                expected="a run folder, or a new or empty folder",
                remedy="choose another `out`",
            )
    make_folder(out)


def freeze_owned(plan: Plan | Planning, out: Path, workspace: Workspace) -> tuple[RunFolder, Tally]:
    """Like `freeze_and_tell`, for a caller that owns the folder."""
    if RunFolder.exists(out):
        folder = RunFolder.open(out)
        tally, found = _counted(plan)
        if folder.head.plan != found:
            raise MutatorError(
                "this folder holds another plan",
                where=out,
                expected=f"plan {found[:16]}",
                remedy="use another folder, or the campaign and options with which this folder was planned",
            )
        check_version(folder)
        check_sources(out, folder.head.sources, _sources(tally, plan, workspace))
        return folder, tally
    tally, found, places, files = _written(plan, out)
    head = _head(plan, tally, found, workspace, places).file_bytes()
    file_digests.save_ledger(out, DigestLedger(files=files | {HEAD: FileDigest.of_bytes(head)}))
    write_atomic(out / HEAD, head)  # last, because this file makes the folder a run folder
    return RunFolder.open(out), tally


def _counted(plan: Plan | Planning, each: Callable[[Part], None] = lambda part: None) -> tuple[Tally, str]:
    tally, made = plan.empty_tally(), PlanDigest()
    for part in plan.parts():
        tally.add(part)
        made.add([experiment.id for experiment in part.experiments])
        each(part)
    known = plan.digest if isinstance(plan, Plan) else made.end(tally.chunks, plan.canary.id, plan.campaign)
    return tally, known


def _written(
    plan: Plan | Planning, out: Path
) -> tuple[Tally, str, list[plan_file.Chunk], dict[str, FileDigest]]:
    """Write the plan's files part by part; return totals, digest, chunk positions and file digests."""
    plan_file.create_plan_folder(out)
    write_atomic(out / CAMPAIGN, plan.campaign.source)
    with ExitStack() as stack:
        rows, lines, faults = (
            DigestingFile(stack.enter_context(writing_atomic(path)))
            for path in (out / CSV, out / plan_file.EXPERIMENTS, out / plan_file.FAULTS)
        )
        writer = plan_file.PlanWriter(lines, faults)
        rows.write(csv_bytes([], head=True))

        def write(part: Part) -> None:
            rows.write(csv_bytes(part.experiments))
            writer.append(part.experiments, part.chunks)

        tally, found = _counted(plan, write)
    files = {
        CAMPAIGN: FileDigest.of_bytes(plan.campaign.source),
        CSV: rows.digest,
        plan_file.EXPERIMENTS: lines.digest,
        plan_file.FAULTS: faults.digest,
    }
    return tally, found, writer.chunks, files


def _sources(tally: Tally, plan: Plan | Planning, workspace: Workspace) -> dict[str, str]:
    scenarios = {one.scenario for one in tally.needed()}
    return RunInputs.of(workspace, workspace.manifest(plan.campaign.target), scenarios).digests()


def _head(
    plan: Plan | Planning, tally: Tally, found: str, workspace: Workspace, chunks: list[plan_file.Chunk]
) -> RunHead:
    manifest = workspace.manifest(plan.campaign.target)
    canary = plan_file.experiment_as_json(plan.canary) | {"fault": as_json_types(plan.canary.fault)}
    return RunHead(
        schema=SCHEMA,
        plan=found,
        campaign=plan.campaign.name,
        campaign_digest=digest(plan.campaign.source),
        study=plan.campaign.study,
        target=plan.campaign.target,
        seed=plan.seed,
        seeds=(plan.seeds[0], plan.seeds[-1]) if len(plan.seeds) > 1 else None,
        reading=plan.reading,
        operators=plan.told,
        choices=plan.choices,
        experiments=tally.experiments,
        runs=tally.runs,
        limits=plan.campaign.limits,
        **vars(target_facts(workspace, manifest)),
        goldens=tuple(one.to_stored() for one in tally.needed()),
        canary=canary,
        canary_hazard=plan.campaign.canary.hazard,
        sources=_sources(tally, plan, workspace),
        provenance=Provenance(mutator=VERSION),
        stretches=(),
        chunks=tuple(chunks),
    )


def target_facts(workspace: Workspace, manifest: TargetManifest) -> TargetFacts:
    structure = workspace.structure(manifest)
    return TargetFacts(
        hazards=manifest.hazards,
        alerts=manifest.alerts,
        compared=tuple(channel.name for channel in manifest.compared),
        metrics=metric_facts(manifest),
        about_hazards=hazard_facts(manifest),
        severity=workspace.scale_of(manifest),
        channels=channel_facts(manifest),
        structure=structure.model_dump(mode="json", by_alias=True) if structure else None,
        golden_files=tuple(manifest.outputs),
        target_files=manifest.tree.digests,
    )


def csv_bytes(experiments: Iterable[Experiment], *, head: bool = False) -> bytes:
    writer = csv.writer(text := io.StringIO(), lineterminator="\n")
    if head:
        writer.writerow(PLAN_COLUMN_NAMES)
    cells = itemgetter(*PLAN_COLUMN_NAMES)
    writer.writerows(cells(plan_row(experiment)) for experiment in experiments)
    return text.getvalue().encode()


def plan_csv(plan: Plan) -> bytes:
    return csv_bytes(plan.experiments, head=True)
