"""Audit a run folder: check, without running anything, that its files are unchanged and consistent."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import read_json
from mutator._common.hashing import digest
from mutator.audit.golden_hazard_audit import golden_verdict_problems, left_out_problems
from mutator.audit.head_and_checks_audit import check_result_problems as checks_of
from mutator.audit.head_and_checks_audit import (
    not_activated_run_problems,
    recomputed_chunks,
    seed_and_session_problems,
    shortened_text,
    target_fact_problems,
    unknown_engine_problem,
)
from mutator.audit.record_audit import load_stored_records, mutant_problems, proof_problems, verdict_problems
from mutator.audit.run_digests_and_seal import golden_digests
from mutator.audit.scenario_audit import family_problems, planned_scenario_problems
from mutator.audit.series_audit import audit_series
from mutator.audit.strata_audit import drawn_strata_problems, planned_strata_problems
from mutator.audit.table_audit import audit_tables
from mutator.campaigns.plan import load_plan
from mutator.campaigns.plan_freezing import PLAN_CSV, plan_csv_bytes
from mutator.campaigns.plan_tally import plan_digest
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.model import GoldenClass
from mutator.store import file_digests, plan_file
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checks_file import CHECKS_SCHEMA
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.file_digests import FileDigest
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD
from mutator.workspace import Workspace

Problems = Iterator[MutatorError]
SOURCES_CHECK = "sources that match those of the run"  # what reads the library needs it


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditCheck:
    """One step of an audit. `checked_parts` describes what was checked, and `checked_count` counts it."""

    checked_parts: str
    checked_count: int
    differences: tuple[MutatorError, ...] = ()

    @classmethod
    def from_problems(cls, what: str, count: int, problems: Problems) -> "AuditCheck":
        """Collect all problems in a check. An error that `problems` raises becomes the last problem."""
        problems_so_far = []
        try:
            for problem in problems:
                problems_so_far.append(problem)
        except MutatorError as err:
            problems_so_far.append(err)
        except (
            OSError,
            LookupError,
            TypeError,
            ValueError,
            AttributeError,
        ) as err:  # damaged data
            problems_so_far.append(MutatorError(f"the check '{what}' failed ({type(err).__name__}: {err})"))
        return cls(checked_parts=what, checked_count=count, differences=tuple(problems_so_far))


def run_audit_checks(folder: RunFolder, workspace: Workspace | None) -> list[AuditCheck]:
    """Run all checks of an audit.

    Trees and patches are compared only if `workspace` has the run's sources; otherwise, a difference is
    reported.
    """
    head = folder.head
    source_check = AuditCheck.from_problems(
        SOURCES_CHECK, len(head.sources), _source_problems(folder, workspace)
    )
    manifest = workspace.manifest_of(head) if workspace and not source_check.differences else None
    records, proven = load_stored_records(folder, "records"), load_stored_records(folder, "proof")
    golden_hazards = golden_verdict_problems(folder, manifest) if manifest else ()
    idle = not_activated_run_problems(folder, manifest, records) if manifest else ()
    checks = [
        AuditCheck.from_problems(
            "files, lines and ids that are unchanged", _digested_file_count(folder), _content_problems(folder)
        ),
        AuditCheck.from_problems(
            "ids, plan digest and run.json that follow from the plan",
            head.experiments,
            chain(_plan_problems(folder), seed_and_session_problems(folder)),
        ),
        AuditCheck.from_problems(
            "golden runs that match the checks",
            _golden_run_count(folder),
            chain(checks_of(folder), _golden_problems(folder), golden_hazards, idle),
        ),
        source_check,
    ]
    if workspace and manifest:
        fact_problems = chain(
            target_fact_problems(folder, workspace, manifest),
            family_problems(folder, workspace),
            drawn_strata_problems(folder, workspace),
        )
        checks.append(
            AuditCheck.from_problems("facts about the target that follow from the library", 1, fact_problems)
        )
        mutant_differences = mutant_problems(folder, records, manifest, workspace.fault_models())
        checks.append(
            AuditCheck.from_problems(
                "trees and patches that follow from plan and sources", len(records), mutant_differences
            )
        )
    checks += [
        AuditCheck.from_problems(
            "verdicts that follow from what was recorded",
            len(records),
            chain(verdict_problems(head, records, manifest), left_out_problems(folder, records)),
        ),
        AuditCheck.from_problems(
            "records of the proof that match those of the run",
            len(proven),
            chain(proof_problems(folder, records, proven), unknown_engine_problem(folder, records)),
        ),
        AuditCheck.from_problems("series that are unchanged", *audit_series(folder, manifest)),
        AuditCheck.from_problems("tables that follow from the records", *audit_tables(folder)),
    ]
    return checks


def _digested_file_count(folder: RunFolder) -> int:
    """Return the number of files with digests."""
    try:
        return len(file_digests.load_ledger(folder.path).names)
    except MutatorError:
        return 0


def _content_problems(folder: RunFolder) -> Problems:
    yield from folder.problems(ignore_cache=True)
    for path in filter(Path.is_file, folder.patches.block_files()):
        if read_blocks(path).is_damaged:
            yield MutatorError(
                "damaged blocks",
                where=path,
                expected="patches as a worker appended them",
                remedy=f"`mutator verify {folder.path} --repair` sets them aside",
            )


def _golden_run_count(folder: RunFolder) -> int:
    try:
        return len(folder.goldens_with_files)  # of the others, only verdicts are there
    except MutatorError:  # a damaged file, which another check reports
        return len(folder.head.goldens)


def _plan_problems(folder: RunFolder) -> Problems:
    """Check that ids follow from the plan's lines, the digest from the ids, and run.json and plan.csv from
    both.
    """
    run, head = folder.path, folder.head
    yield from plan_file.plan_problems(run)
    plan = load_plan(folder)
    if folder.is_bench:
        yield from plan_file.batch_problems(run, len(plan.experiments))
    campaign = plan.campaign
    expected_head = replace(
        head,
        plan=plan_digest(
            [e.id for e in plan.experiments],
            plan.chunks,
            plan.canary.id if plan.canary else "",
            campaign,
            plan.drives,
        ),
        experiments=len(plan.experiments),
        campaign=campaign.name,
        campaign_digest=digest(campaign.file_bytes),
        study=campaign.study,
        target=campaign.target,
        chunks=recomputed_chunks(folder),
        limits=campaign.limits,
        include=GoldenClass.HAZARD_WITHOUT_FAULT if head.defences else campaign.include,
        goldens=tuple(golden_run.to_stored() for golden_run in plan.tally.listed_goldens),
        canary_hazard=campaign.canary.hazard if campaign.canary else None,
    )
    for key, stored, value in head.differences(expected_head):
        expected = (
            f"{shortened_text(value)}, which follows from {plan_file.EXPERIMENTS_FILE} and {CAMPAIGN_FILE}"
        )
        yield MutatorError(f"{key} {shortened_text(stored)}", where=run / HEAD, expected=expected)
    yield from planned_scenario_problems(folder, plan)
    yield from planned_strata_problems(folder, plan)
    if FileDigest.of_file(run / PLAN_CSV) != FileDigest.of_bytes(plan_csv_bytes(plan)):
        yield MutatorError(
            "differs from the plan",
            where=run / PLAN_CSV,
            expected=f"the rows of {plan_file.EXPERIMENTS_FILE}",
        )


def _golden_problems(folder: RunFolder) -> Problems:
    """Check that every check passed, and that the golden runs are the ones checked."""
    path = folder.path / CHECKS
    if not path.exists():  # no experiment has run yet
        return
    checks = read_json(path, CHECKS_SCHEMA)
    for result in checks["results"]:
        if not result["passed"]:
            yield MutatorError(f"check `{result['name']}` failed: {result['detail']}", where=path)
    for name, current in golden_digests(folder, folder.head.golden_files).items():
        if checks["goldens"].get(name) != current:
            checked = str(checks["goldens"].get(name))
            got = f"golden run {name} with digest {current[:16]}"
            yield MutatorError(got, where=path_below(folder.path / "golden", name), expected=checked[:16])


def _source_problems(folder: RunFolder, workspace: Workspace | None) -> Problems:
    where, head = folder.path / HEAD, folder.head
    if workspace is None:
        yield MutatorError(
            "no library found",
            where=where,
            expected="the run's sources (trees and patches were not compared)",
        )
        return
    manifest = workspace.manifest_of(head)
    current_digests = RunInputs.of_run(workspace, folder).digest_by_source()
    for name, recorded in head.sources.items():
        if current_digests.get(name) != recorded:
            yield MutatorError(
                f"{name} {recorded[:16]}",
                where=where,
                expected=f"{str(current_digests.get(name))[:16]}, the digest here",
                remedy="verify with the run's sources (trees and patches were not compared)",
            )
    for path, recorded in head.target_files.items():
        if (current := manifest.tree.digest_by_path.get(path)) != recorded:
            yield MutatorError(
                f"{path} {recorded[:16]}", where=where, expected=f"{str(current)[:16]}, the digest here"
            )
