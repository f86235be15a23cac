"""Audits: check that a run folder is unchanged, and that its content follows from its plan and sources."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.arguments import check_type, check_whole
from mutator._common.hashing import digest
from mutator._common.tables import Table
from mutator._common.text import counted
from mutator.api.selection import WorkspaceLike, open_workspace
from mutator.errors import MutatorError
from mutator.execution.spot_check import drawn, driven_again
from mutator.store.run_folder import RunFolder
from mutator.store.stretches import package_versions, told
from mutator.verification.audit import Check, audit_checks
from mutator.verification.repairing import repair as put_aside
from mutator.verification.seal import seal_of
from mutator.workspace import Workspace

SHOWN = 20  # differences listed in the text of an audit


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Audit:
    """The result of an audit of a run folder."""

    run: Path  #: the run folder
    facts: Mapping[str, str]  #: facts about the run, by name
    checks: tuple[Check, ...]  #: the checks: `what`, `count` and `differences` of each
    seal: str | None  #: the seal computed from the content; None if the run is unfinished or not verifiable
    repaired: tuple[str, ...] = ()  #: the damaged parts that were set aside

    def __repr__(self) -> str:
        return f"<Audit of {self.run.name}: {self._outcome}>"

    def __str__(self) -> str:
        width = max(map(len, self.facts))
        rows = [(check.what, str(check.count), str(len(check.differences))) for check in self.checks]
        table = Table(heads=("checked", "count", "differences"), rows=rows, right=(1, 2))
        found = [str(one).replace(f"{self.run}/", "") for one in self.differences[:SHOWN]]
        more = len(self.differences) - SHOWN
        listed = [*found, *([f"and {more} more"] if more > 0 else [])]
        parts = [
            "\n".join(f"{name.ljust(width)}  {value}" for name, value in self.facts.items()),
            table.as_text(),
            "\n".join(f"- {text}" for text in listed),
            "\n".join(f"repaired: {text}" for text in self.repaired),
            self._outcome,
        ]
        return "\n\n".join(filter(None, parts))

    @property
    def _outcome(self) -> str:
        return counted(len(self.differences), "difference") if self.differences else "no difference"

    @property
    def differences(self) -> tuple[MutatorError, ...]:
        """All differences, without duplicates."""
        found = (difference for check in self.checks for difference in check.differences)
        return tuple({str(difference): difference for difference in found}.values())

    @property
    def passed(self) -> bool:
        """Whether there is no difference."""
        return not self.differences


def verify(
    run: str | Path,
    *,
    rerun: int = 0,
    expect: str | None = None,
    repair: bool = False,
    workspace: WorkspaceLike = None,
) -> Audit:
    """Audit the run folder at `run`, finished or not, even if `load_run` can no longer open it.

    `rerun` is the number of randomly drawn experiments to rerun on the reference engine. `expect` is the seal
    that the run must have. With `repair`, damaged parts are set aside, and the next run of the campaign in
    this folder redoes them; otherwise nothing is written. MutatorError if `run` is not a run folder or its
    run.json cannot be read.
    """
    check_whole("rerun", rerun)
    if expect is not None:
        check_type("expect", expect, str, "a seal")
        if not re.fullmatch(r"[0-9a-f]{64}", expect):
            raise MutatorError(f"'{expect}'", argument="expect", expected="a seal: 64 hex digits")
    folder = RunFolder.unverified(Path(run))
    found = _workspace(workspace)
    checks = audit_checks(folder, found)
    facts = _facts(folder)
    if rerun:
        checks.append(_rerun(folder, found, rerun, facts))
    seal = _seal(folder, checks)
    facts["seal"] = seal or "none"
    if expect is not None:
        wrong = MutatorError(f"seal {seal or 'none'}", where=folder.path, expected=expect)
        facts["expected"] = expect
        checks.append(Check(what="seal as expected", count=1, differences=() if seal == expect else (wrong,)))
    damaged = any(check.differences for check in checks)
    repaired = put_aside(folder, found) if repair and damaged else []
    return Audit(run=folder.path, facts=facts, checks=tuple(checks), seal=seal, repaired=tuple(repaired))


def _workspace(given: WorkspaceLike) -> Workspace | None:
    try:
        return open_workspace(given)
    except MutatorError:
        if given is not None:
            raise
        return None


def _rerun(folder: RunFolder, workspace: Workspace | None, count: int, facts: dict[str, str]) -> Check:
    what = "experiments rerun on the reference engine"
    if workspace is None:
        raise MutatorError("no library found", argument="rerun", expected="the library of the run")
    try:
        ids = drawn(folder, count)
    except MutatorError as err:
        return Check(what=what, count=0, differences=(err,))
    facts["drawn at random"] = ", ".join(ids)
    return Check.of(what, len(ids), driven_again(workspace, folder, ids))


def _seal(folder: RunFolder, checks: list[Check]) -> str | None:
    try:
        return seal_of(folder)
    except (MutatorError, OSError):
        if not any(check.differences for check in checks):
            raise
        return None


def _facts(folder: RunFolder) -> dict[str, str]:
    head: Any = folder.head
    packages = package_versions(folder.stretches)
    return {
        "run": folder.path.name,
        "campaign": f"{head['campaign']} of {head['target']}, {head['reading']}, seed {head['seed']}",
        "experiments": f"{folder.planned}{f' of shard {folder.shard}' if folder.shard else ''}",
        "plan": head["plan"],
        **{f"digest of {name}": value for name, value in head["sources"].items()},
        "mutator": head["provenance"]["mutator"],
        **told(folder.stretches),
        **({"packages": f"{len(packages)}, with digest {digest(packages)}"} if packages else {}),
    }
