"""Audits: check that a run folder is unchanged, and that its content follows from its plan and sources."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mutator._common.argument_checks import check_type, check_whole_number
from mutator._common.folder_locks import lock_run_folder
from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.api.library_fault_audit import library_fault_check
from mutator.api.target_and_fault_selection import SelectedTarget, WorkspaceLike, open_workspace
from mutator.audit.defended_run_audit import defended_run_checks
from mutator.audit.run_audit import SOURCES_CHECK, AuditCheck, run_audit_checks
from mutator.audit.run_digests_and_seal import Seals, seals_of, unsealed_facts
from mutator.audit.run_repair import repair_run as put_aside
from mutator.audit.seal_signatures import sign_seal as write_signature
from mutator.audit.seal_signatures import verified_signer
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.spot_check import draw_experiment_ids, rerun_and_compare
from mutator.explore.envelope_files import ENVELOPES_FILE, envelope_file_problems
from mutator.explore.exploration_replay import is_exploration, replay_exploration
from mutator.report.report_audit import audit_report
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import describe_environments, version_texts_by_package
from mutator.workspace import Workspace

MOST_LISTED_DIFFERENCES = 20  # in the text of an audit, to fit on a screen; `differences` has all
LIMITS_NOTE = (
    "These checks find damage and contradictions. That nobody wrote other results with matching digests "
    "shows only an expected seal (--expect)."
)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Audit:
    """The result of an audit of a run folder."""

    run: Path  #: the run folder
    facts: Mapping[str, str]  #: facts about the run, by name
    checks: tuple[AuditCheck, ...]  #: the checks: `what`, `count` and `differences` of each
    seals: Seals  #: the digests computed from the content
    not_sealed: Mapping[str, str]  #: facts that neither the seal nor a check covers, by name
    compared: bool = False  #: whether the run was compared with an expected or signed digest
    signer: str | None = None  #: who signed the run, if this was checked
    repaired: tuple[str, ...] = ()  #: the damaged parts that were set aside

    def __repr__(self) -> str:
        return f"<Audit of {self.run.name}: {self._outcome}>"

    def __str__(self) -> str:
        width = max(map(len, (*self.facts, *self.not_sealed)))
        rows = [
            (check.checked_parts, str(check.checked_count), str(len(check.differences)))
            for check in self.checks
        ]
        table = TextTable(heads=("checked", "count", "differences"), rows=rows, right_aligned=(1, 2))
        difference_texts = [
            str(difference).replace(f"{self.run}/", "")
            for difference in self.differences[:MOST_LISTED_DIFFERENCES]
        ]
        unlisted_count = len(self.differences) - MOST_LISTED_DIFFERENCES
        listed_lines = [*difference_texts, *([f"and {unlisted_count} more"] if unlisted_count > 0 else [])]
        facts, unsealed = (
            "\n".join(f"{name.ljust(width)}  {value}" for name, value in facts.items())
            for facts in (self.facts, self.not_sealed)
        )
        parts = [
            facts,
            f"not sealed:\n{unsealed}",
            table.as_text(),
            "\n".join(f"- {text}" for text in listed_lines),
            "\n".join(f"repaired: {text}" for text in self.repaired),
            "" if self.compared else LIMITS_NOTE,
            self._outcome,
        ]
        return "\n\n".join(filter(None, parts))

    @property
    def seal(self) -> str | None:
        """The seal computed from the content; None if the run is unfinished."""
        return self.seals.seal

    @property
    def _outcome(self) -> str:
        return counted(len(self.differences), "difference") if self.differences else "no difference"

    @property
    def differences(self) -> tuple[MutatorError, ...]:
        """All differences, without duplicates."""
        differences = (difference for check in self.checks for difference in check.differences)
        return tuple({str(difference): difference for difference in differences}.values())

    @property
    def passed(self) -> bool:
        """Whether there is no difference."""
        return not self.differences


def verify(
    run: str | Path,
    *,
    rerun: int = 0,
    expect: str | None = None,
    expect_review: str | None = None,
    signed_by: str | Path | None = None,
    report: bool = False,
    repair: bool = False,
    workspace: WorkspaceLike = None,
) -> Audit:
    """Audit the run folder at `run`, finished or not, even if `load_run` can no longer open it.

    `rerun` is the number of randomly drawn experiments to rerun on the reference engine. `expect` is the
    seal, the results digest or a bench's batches digest that the run must have, `expect_review` its review
    digest. `signed_by` is a file of allowed signers (`man ssh-keygen`), one of whom must have signed the run.
    With `report`, the report is built again and compared with the stored one. With `repair`, damaged parts
    are set aside, and the next run of the campaign in this folder redoes them; otherwise nothing is written.

    MutatorError if `run` is not a run folder, if its run.json cannot be read, or if `signed_by` is missing.
    """
    check_whole_number("rerun", rerun)
    for name, value in (("expect", expect), ("expect_review", expect_review)):
        _check_digest(name, value)
    folder = RunFolder.open_unverified(Path(run))  # the checks must see what opening would refuse
    opened_workspace = _open_workspace_if_any(workspace)
    checks = run_audit_checks(folder, opened_workspace)
    facts = _run_facts(folder)
    if not any(check.differences for check in checks if check.checked_parts == SOURCES_CHECK):
        checks += _exploration_checks(folder, opened_workspace, facts)
    checks += defended_run_checks(folder, opened_workspace, facts)
    if rerun:
        checks.append(_rerun_check(folder, opened_workspace, rerun, facts))
    seals = _seals_if_undamaged(folder, checks)
    facts |= {"seal": "none"} | seals.digest_by_name()  # an unfinished run has none, and says so
    if expect is not None:
        facts["expected"] = expect
        checks.append(_expected_digest_check(folder, seals, expect))
    if expect_review is not None:
        facts["expected review"] = expect_review
        checks.append(_digest_check(folder, "review digest", seals.review_digest, expect_review))
    identity = None
    if signed_by is not None:
        check, identity = _signature_check(folder, seals, Path(signed_by))
        facts["signed by"] = identity or "nobody in the list"
        checks.append(check)
    if report:
        checks.append(
            AuditCheck.from_problems(
                "pages of the report that follow from the run", *audit_report(folder, opened_workspace)
            )
        )
    damaged = any(check.differences for check in checks)
    # `repair` writes nothing into an undamaged folder
    repaired = put_aside(folder, opened_workspace) if repair and damaged else []
    return Audit(
        run=folder.path,
        facts=facts,
        checks=tuple(checks),
        seals=seals,
        not_sealed=unsealed_facts(folder),
        compared=expect is not None or identity is not None,
        signer=identity,
        repaired=tuple(repaired),
    )


def seal(run: str | Path, *, sign: str | Path | None = None) -> Seals:
    """Compute the digests of the run folder at `run`. With `sign`, the file of an SSH key, also sign them:
    `seal.json` and `seal.json.sig` are written into the folder.

    MutatorError if `run` is not a run folder or is damaged, or if the key cannot sign; with `sign`, also if
    the run is not finished or a command is using the folder.
    """
    folder = RunFolder.open(Path(run))
    if sign is None:
        return seals_of(folder)
    # what a running command writes would outdate the signature
    with lock_run_folder(folder.path, patience_s=0.0):
        seals = seals_of(folder)
        write_signature(folder, seals, Path(sign))
    return seals


def _check_digest(argument: str, value: str | None) -> None:
    if value is not None:
        check_type(argument, value, str, "a digest")
        if not re.fullmatch(r"[0-9a-f]{64}", value):  # a mistyped digest must not cost a whole audit
            raise MutatorError(f"'{value}'", argument=argument, expected="a digest: 64 hex digits")


def _expected_digest_check(folder: RunFolder, seals: Seals, expected: str) -> AuditCheck:
    """Compare with the seal, the results digest or the batches digest, whichever it is."""
    for name, actual in (("results digest", seals.results_digest), ("batches digest", seals.batches_digest)):
        if expected == actual:
            return _digest_check(folder, name, expected, expected)
    return _digest_check(folder, "seal", seals.seal, expected)


def _digest_check(folder: RunFolder, digest_name: str, actual: str | None, expected: str) -> AuditCheck:
    wrong = MutatorError(f"{digest_name} {actual or 'none'}", where=folder.path, expected=expected)
    return AuditCheck(
        checked_parts=f"{digest_name} as expected",
        checked_count=1,
        differences=() if actual == expected else (wrong,),
    )


def _open_workspace_if_any(workspace: WorkspaceLike) -> Workspace | None:
    try:
        return open_workspace(workspace)
    except MutatorError:
        if workspace is not None:  # a library that was named must exist; one that was only sought need not
            raise
        return None


def _exploration_checks(
    folder: RunFolder, workspace: Workspace | None, facts: dict[str, str]
) -> list[AuditCheck]:
    """Replay an exploration, and build its faults again; nothing for other runs, and without the library."""
    try:
        if workspace is None or not (is_exploration(folder) or (folder.path / ENVELOPES_FILE).exists()):
            return []
        manifest = workspace.manifest_of(folder.head)
    except MutatorError:  # other checks report a damaged file and a missing target
        return []

    def problems() -> Iterator[MutatorError]:
        replay = replay_exploration(folder, manifest)
        facts["exploration"] = replay.note or "complete"
        yield from replay.differences
        if folder.is_finished:
            yield from envelope_file_problems(folder.path, replay)

    count = folder.head.experiments
    replay_check = AuditCheck.from_problems("proposals that follow from the records", count, problems())
    return [replay_check, library_fault_check(folder, SelectedTarget(workspace, manifest), facts)]


def _rerun_check(
    folder: RunFolder, workspace: Workspace | None, count: int, facts: dict[str, str]
) -> AuditCheck:
    check_name = "experiments rerun on the reference engine"
    if workspace is None:
        raise MutatorError("no library found", argument="rerun", expected="the library of the run")
    try:
        ids = draw_experiment_ids(folder, count)
    except MutatorError as err:
        return AuditCheck(checked_parts=check_name, checked_count=0, differences=(err,))
    facts["drawn at random"] = ", ".join(ids)
    return AuditCheck.from_problems(check_name, len(ids), rerun_and_compare(workspace, folder, ids))


def _signature_check(folder: RunFolder, seals: Seals, allowed_signers: Path) -> tuple[AuditCheck, str | None]:
    try:
        identity = verified_signer(folder, seals, allowed_signers)
    except CheckFailed as err:
        return AuditCheck(checked_parts="digests as signed", checked_count=1, differences=(err,)), None
    return AuditCheck(checked_parts="digests as signed", checked_count=1), identity


def _seals_if_undamaged(folder: RunFolder, checks: list[AuditCheck]) -> Seals:
    try:
        return seals_of(folder)
    except (MutatorError, OSError):
        if not any(check.differences for check in checks):
            raise
        return Seals()  # a damaged run has no digests; its differences say why


def _run_facts(folder: RunFolder) -> dict[str, str]:
    head = folder.head
    packages = version_texts_by_package(folder.session_environments)
    campaign = f"{head.campaign} of {head.target}"
    return {
        "run": folder.path.name,
        "campaign": ", ".join(filter(None, (campaign, head.reading, f"seed {head.seed}"))),
        "experiments": f"{folder.planned_experiment_count}"
        + (f" of shard {folder.shard}" if folder.shard else ""),
        "plan": head.plan,
        **{f"digest of {name}": value for name, value in head.sources.items()},
        "mutator": head.provenance.mutator,
        "python": describe_environments(folder.session_environments).get("python", "none"),
        **({"packages": f"{len(packages)}, with digest {digest(packages)}"} if packages else {}),
    }
