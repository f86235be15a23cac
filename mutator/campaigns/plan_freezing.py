"""Freezes a plan into a run folder, together with the digests of its sources."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from mutator._common.files import (
    is_half_written,
    make_folder,
    remove_folder,
    write_atomic,
    writing_atomic,
)
from mutator._common.folder_locks import OWNER_LOCK_FILE, lock_run_folder
from mutator._common.hashing import as_json_types, digest
from mutator._common.library_and_run_folder_search import SCRATCH_FOLDER
from mutator._common.version import VERSION
from mutator.campaigns.campaign_files import load_campaign_study
from mutator.campaigns.phrase_collection import UsedPhraseSources, phrases_of_campaign
from mutator.campaigns.plan import Plan, SeedBySeedPlan
from mutator.campaigns.plan_tally import PlanDigestBuilder, PlanPart, PlanTally
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources, check_version
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.results.csv_and_parquet_writers import csv_lines
from mutator.results.plan_columns import PlanColumn, columns_of_plan
from mutator.store import file_digests, plan_file
from mutator.store.file_digests import DigestingFile, DigestLedger, FileDigest
from mutator.store.plain_contents_check import check_plain_contents
from mutator.store.plan_strata import STRATA_FILE
from mutator.store.planned_scenarios import SCENARIOS_FILE, scenario_lines
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD, RUN_SCHEMA, Provenance, RunHead
from mutator.store.session_progress import PROGRESS_FILE
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_target_facts import TargetFacts, channel_facts, hazard_facts, metric_facts
from mutator.workspace import Workspace

PLAN_CSV = "plan.csv"
_FILES_OF_KILLED_FREEZE = (
    OWNER_LOCK_FILE,
    "workers",
    "plan",
    PLAN_CSV,
    CAMPAIGN_FILE,
    file_digests.DIGESTS_FILE,
)  # files that a killed freeze can leave


def freeze_plan(plan: Plan | SeedBySeedPlan, out: Path, workspace: Workspace) -> RunFolder:
    """Write the plan and plan.csv into the run folder `out`, which is created if missing.

    A folder with the same plan is left unchanged. MutatorError if the folder has another plan, changed
    sources or other content, or is in use.
    """
    return freeze_plan_with_tally(plan, out, workspace)[0]


def freeze_plan_with_tally(
    plan: Plan | SeedBySeedPlan, out: Path, workspace: Workspace
) -> tuple[RunFolder, PlanTally]:
    """Like `freeze_plan`, but also return the plan's totals."""
    is_new = not out.exists()
    make_run_folder(out)
    try:
        with lock_run_folder(out):
            return freeze_plan_in_owned_folder(plan, out, workspace)
    except BaseException:  # also an interruption: a new folder without a whole plan does not stay
        if is_new and not RunFolder.exists(out):
            remove_folder(out)
        raise


def make_run_folder(out: Path) -> None:
    """Create `out` unless it is a run folder; MutatorError if it contains anything else, such as links."""
    if out.is_dir():
        check_plain_contents(out.resolve())
    if out.exists() and not RunFolder.exists(out):
        names = {path.name for path in out.iterdir()} if out.is_dir() else {out.name}
        foreign_names = [
            name for name in names if name not in _FILES_OF_KILLED_FREEZE and not is_half_written(name)
        ]
        if OWNER_LOCK_FILE in names:  # of a killed bench, which tells its progress before it plans
            foreign_names = [name for name in foreign_names if name != PROGRESS_FILE]
        if names >= {OWNER_LOCK_FILE, CAMPAIGN_FILE}:  # of a killed bench, which checks before it plans
            foreign_names = [name for name in foreign_names if name != SCRATCH_FOLDER]
        if foreign_names:
            raise MutatorError(
                f"this folder has no {HEAD} and is not empty ({', '.join(sorted(foreign_names)[:3])})",
                where=out,
                argument="out",
                expected="a run folder, or a new or empty folder",
                remedy="choose another `out`",
            )
    make_folder(out)


def freeze_plan_in_owned_folder(
    plan: Plan | SeedBySeedPlan, out: Path, workspace: Workspace
) -> tuple[RunFolder, PlanTally]:
    """Like `freeze_plan_with_tally`, for a caller that owns the folder."""
    load_campaign_study(plan.campaign)  # a plan that is not run does without: a study imports much
    if RunFolder.exists(out):
        folder = RunFolder.open(out)
        tally, plan_digest = _tally_and_digest(plan)
        if folder.head.plan != plan_digest:
            raise MutatorError(
                "this folder holds another plan",
                where=out,
                expected=f"plan {plan_digest[:16]}",
                remedy="use another folder, or the campaign and options with which this folder was planned",
            )
        check_version(folder)
        check_sources(out, folder.head.sources, _source_digests(tally, plan, workspace))
        return folder, tally
    used = UsedPhraseSources()
    tally, plan_digest, places, files = _write_plan_files(plan, out, used)
    scenarios = files.get(SCENARIOS_FILE)
    head = _build_head(plan, tally, plan_digest, workspace, places, used, scenarios).file_bytes()
    file_digests.save_ledger(out, DigestLedger(files=files | {HEAD: FileDigest.of_bytes(head)}))
    write_atomic(out / HEAD, head)  # last, because this file makes the folder a run folder
    return RunFolder.open(out), tally


def _tally_and_digest(
    plan: Plan | SeedBySeedPlan, on_part: Callable[[PlanPart], None] = lambda part: None
) -> tuple[PlanTally, str]:
    tally, digest_builder = plan.empty_tally(), PlanDigestBuilder()
    for part in plan.parts():
        tally.add(part)
        digest_builder.add([experiment.id for experiment in part.experiments])
        on_part(part)
    plan_digest = (
        plan.digest
        if isinstance(plan, Plan)
        else digest_builder.finish(
            tally.chunk_lengths, plan.canary.id if plan.canary else "", plan.campaign, plan.drives
        )
    )
    return tally, plan_digest


def _write_plan_files(
    plan: Plan | SeedBySeedPlan, out: Path, used: UsedPhraseSources
) -> tuple[PlanTally, str, list[plan_file.Chunk], dict[str, FileDigest]]:
    """Write the plan's files part by part; return totals, digest, chunk positions and file digests."""
    plan_file.create_plan_folder(out)
    write_atomic(out / CAMPAIGN_FILE, plan.campaign.file_bytes)
    with ExitStack() as stack:
        rows, lines, faults = (
            DigestingFile(stack.enter_context(writing_atomic(path)))
            for path in (out / PLAN_CSV, out / plan_file.EXPERIMENTS_FILE, out / plan_file.FAULTS_FILE)
        )
        writer = plan_file.PlanWriter(lines, faults)
        columns = columns_of_plan(plan.families)
        rows.write(plan_csv_head(columns))

        def write(part: PlanPart) -> None:
            rows.write(plan_csv_lines(part.experiments, columns))
            writer.append(part.experiments, part.chunk_lengths)
            used.add(experiment.fault for experiment in part.experiments)

        tally, plan_digest = _tally_and_digest(plan, write)
    files = {
        CAMPAIGN_FILE: FileDigest.of_bytes(plan.campaign.file_bytes),
        PLAN_CSV: rows.digest,
        plan_file.EXPERIMENTS_FILE: lines.digest,
        plan_file.FAULTS_FILE: faults.digest,
    }
    if scenarios := tally.planned_scenarios():
        content = scenario_lines(scenarios)
        write_atomic(out / SCENARIOS_FILE, content)
        files[SCENARIOS_FILE] = FileDigest.of_bytes(content)
    if tally.strata:
        content = tally.strata.file_bytes()
        write_atomic(out / STRATA_FILE, content)
        files[STRATA_FILE] = FileDigest.of_bytes(content)
    return tally, plan_digest, writer.chunks, files


def _source_digests(tally: PlanTally, plan: Plan | SeedBySeedPlan, workspace: Workspace) -> dict[str, str]:
    manifest = workspace.manifest(plan.campaign.target)
    return RunInputs.of_plan(workspace, manifest, tally).digest_by_source()


def _build_head(
    plan: Plan | SeedBySeedPlan,
    tally: PlanTally,
    plan_digest: str,
    workspace: Workspace,
    chunks: list[plan_file.Chunk],
    used: UsedPhraseSources,
    scenarios: FileDigest | None,
) -> RunHead:
    manifest = workspace.manifest(plan.campaign.target)
    canary: dict[str, Any] | None = None
    if plan.canary:
        canary = plan_file.experiment_as_json(plan.canary) | {"fault": as_json_types(plan.canary.fault)}
    return RunHead(
        schema=RUN_SCHEMA,
        plan=plan_digest,
        campaign=plan.campaign.name,
        campaign_digest=digest(plan.campaign.file_bytes),
        study=plan.campaign.study,
        target=plan.campaign.target,
        seed=plan.seed,
        seeds=(plan.seeds[0], plan.seeds[-1]) if len(plan.seeds) > 1 else None,
        reading=plan.reading,
        operators=plan.operator_notes,
        choices=plan.choices,
        experiments=tally.experiment_count,
        runs=tally.run_count,
        limits=plan.campaign.limits,
        include=plan.campaign.include,
        **vars(collect_target_facts(workspace, manifest)),
        phrases=phrases_of_campaign(workspace, plan.campaign, manifest, plan.reading, used),
        goldens=tuple(golden.to_stored() for golden in tally.listed_goldens),
        scenarios=scenarios.sha256 if scenarios else None,
        families=plan.families,
        canary=canary,
        canary_hazard=plan.campaign.canary.hazard if plan.campaign.canary else None,
        sources=_source_digests(tally, plan, workspace),
        provenance=Provenance(mutator=VERSION),
        stretches=(),
        chunks=tuple(chunks),
    )


def collect_target_facts(workspace: Workspace, manifest: TargetManifest) -> TargetFacts:
    structure = workspace.structure(manifest)
    return TargetFacts(
        hazards=manifest.hazard_names,
        alerts=manifest.alerts,
        compared=tuple(channel.name for channel in manifest.compared_channels),
        metrics=metric_facts(manifest),
        about_hazards=hazard_facts(manifest),
        severity=workspace.scale_of(manifest),
        channels=channel_facts(manifest),
        structure=structure.model_dump(mode="json", by_alias=True) if structure else None,
        golden_files=tuple(manifest.output_files),
        target_files=manifest.tree.digest_by_path,
        speed=manifest.speed,
    )


def plan_csv_head(columns: Sequence[PlanColumn]) -> bytes:
    return csv_lines([[column.name for column in columns]])


def plan_csv_lines(experiments: Iterable[Experiment], columns: Sequence[PlanColumn]) -> bytes:
    return csv_lines([column.cell_of(experiment) for column in columns] for experiment in experiments)


def plan_csv_bytes(plan: Plan) -> bytes:
    columns = columns_of_plan(plan.families)
    return plan_csv_head(columns) + plan_csv_lines(plan.experiments, columns)
