"""Audit a run folder: check, without running anything, that its files are unchanged and consistent."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import read_json
from mutator._common.hashing import digest
from mutator.audit.head_audit import checks as checks_of
from mutator.audit.head_audit import (
    chunks_of,
    engines,
    facts_of_target,
    idle_runs,
    seeds_and_sessions,
    short,
)
from mutator.audit.record_audit import mutants, proof, recorded, verdicts
from mutator.audit.seal import golden_digests
from mutator.audit.series_audit import series
from mutator.audit.table_audit import tables
from mutator.campaigns.freezing import CSV, plan_csv
from mutator.campaigns.plan import load_plan
from mutator.campaigns.plan_parts import plan_digest
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.store import file_digests, plan_file
from mutator.store.check_results import FILE as CHECKS
from mutator.store.check_results import SCHEMA as CHECKS_SCHEMA
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.file_digests import FileDigest
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN, HEAD
from mutator.workspace import Workspace

Problems = Iterator[MutatorError]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One step of an audit. `what` describes the `count` parts of the run that were checked."""

    what: str
    count: int
    differences: tuple[MutatorError, ...] = ()

    @classmethod
    def of(cls, what: str, count: int, problems: Problems) -> "Check":
        """Collect all problems in a check. An error that `problems` raises becomes the last problem."""
        found = []
        try:
            for problem in problems:
                found.append(problem)
        except MutatorError as err:
            found.append(err)
        except (
            OSError,
            LookupError,
            TypeError,
            ValueError,
            AttributeError,
        ) as err:  # damaged data
            found.append(MutatorError(f"the check '{what}' failed ({type(err).__name__}: {err})"))
        return cls(what=what, count=count, differences=tuple(found))


def audit_checks(folder: RunFolder, workspace: Workspace | None) -> list[Check]:
    """Run all checks of an audit.

    Trees and patches are compared only if `workspace` has the run's sources; otherwise, a difference is
    reported.
    """
    head = folder.head
    here = Check.of("sources that match those of the run", len(head.sources), _sources(folder, workspace))
    manifest = workspace.manifest(head.target) if workspace and not here.differences else None
    records, proven = recorded(folder, "records"), recorded(folder, "proof")
    idle = idle_runs(folder, manifest, records) if manifest else ()
    checks = [
        Check.of("files, lines and ids that are unchanged", _files(folder), _content(folder)),
        Check.of(
            "ids, plan digest and run.json that follow from the plan",
            head.experiments,
            chain(_plan(folder), seeds_and_sessions(folder)),
        ),
        Check.of(
            "golden runs that match the checks",
            len(head.goldens),
            chain(checks_of(folder), _goldens(folder), idle),
        ),
        here,
    ]
    if workspace and manifest:
        told = facts_of_target(folder, workspace, manifest)
        checks.append(Check.of("facts about the target that follow from the library", 1, told))
        compared = mutants(folder, records, manifest, workspace.fault_models())
        checks.append(Check.of("trees and patches that follow from plan and sources", len(records), compared))
    checks += [
        Check.of(
            "verdicts that follow from what was recorded", len(records), verdicts(head, records, manifest)
        ),
        Check.of(
            "records of the proof that match those of the run",
            len(proven),
            chain(proof(folder, records, proven), engines(folder, records)),
        ),
        Check.of("series that are unchanged", *series(folder, manifest)),
        Check.of("tables that follow from the records", *tables(folder)),
    ]
    return checks


def _files(folder: RunFolder) -> int:
    """Return the number of files with digests."""
    try:
        return len(file_digests.load_ledger(folder.path).names)
    except MutatorError:
        return 0


def _content(folder: RunFolder) -> Problems:
    yield from folder.problems(ignore_cache=True)
    for path in filter(Path.is_file, folder.patches.block_files()):
        if read_blocks(path).is_damaged:
            yield MutatorError(
                "damaged blocks",
                where=path,
                expected="patches as a worker appended them",
                remedy=f"`mutator verify {folder.path} --repair` sets them aside",
            )


def _plan(folder: RunFolder) -> Problems:
    """Check that ids follow from the plan's lines, the digest from the ids, and run.json and plan.csv from
    both.
    """
    run, head = folder.path, folder.head
    yield from plan_file.plan_problems(run)
    plan = load_plan(folder)
    campaign = plan.campaign
    follows = replace(
        head,
        plan=plan_digest([e.id for e in plan.experiments], plan.chunks, plan.canary.id, campaign),
        experiments=len(plan.experiments),
        campaign=campaign.name,
        campaign_digest=digest(campaign.source),
        study=campaign.study,
        target=campaign.target,
        chunks=chunks_of(folder),
        limits=campaign.limits,
        goldens=tuple(one.to_stored() for one in plan.goldens()),
        canary_hazard=campaign.canary.hazard,
    )
    for key, found, value in head.differences(follows):
        expected = f"{short(value)}, which follows from {plan_file.EXPERIMENTS} and {CAMPAIGN}"
        yield MutatorError(f"{key} {short(found)}", where=run / HEAD, expected=expected)
    if FileDigest.of_file(run / CSV) != FileDigest.of_bytes(plan_csv(plan)):
        yield MutatorError(
            "differs from the plan", where=run / CSV, expected=f"the rows of {plan_file.EXPERIMENTS}"
        )


def _goldens(folder: RunFolder) -> Problems:
    """Check that every check passed, and that the golden runs are the ones checked."""
    path = folder.path / CHECKS
    if not path.exists():  # no experiment has run yet
        return
    checks = read_json(path, CHECKS_SCHEMA)
    for result in checks["results"]:
        if not result["passed"]:
            yield MutatorError(f"check `{result['name']}` failed: {result['detail']}", where=path)
    for name, found in golden_digests(folder, folder.head.golden_files).items():
        if checks["goldens"].get(name) != found:
            known = str(checks["goldens"].get(name))
            got = f"golden run {name} with digest {found[:16]}"
            yield MutatorError(got, where=path_below(folder.path / "golden", name), expected=known[:16])


def _sources(folder: RunFolder, workspace: Workspace | None) -> Problems:
    where, head = folder.path / HEAD, folder.head
    if workspace is None:
        yield MutatorError(
            "no library found",
            where=where,
            expected="the run's sources (trees and patches were not compared)",
        )
        return
    manifest = workspace.manifest(head.target)
    now = RunInputs.of(workspace, manifest, folder.scenarios).digests()
    for name, known in head.sources.items():
        if now.get(name) != known:
            yield MutatorError(
                f"{name} {known[:16]}",
                where=where,
                expected=f"{str(now.get(name))[:16]}, the digest here",
                remedy="verify with the run's sources (trees and patches were not compared)",
            )
    for path, known in head.target_files.items():
        if (found := manifest.tree.digests.get(path)) != known:
            yield MutatorError(
                f"{path} {known[:16]}", where=where, expected=f"{str(found)[:16]}, the digest here"
            )
