"""Mutants written to a folder: patches, optionally trees, and an index of them."""

import csv
import fnmatch
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.files import make_folder
from mutator.cli import choose
from mutator.cli.console import Terminal
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.model import Fault, Trigger
    from mutator.mutants.building import Mutant
    from mutator.targets.manifest import TargetManifest
    from mutator.workspace import Workspace

COLUMNS = (
    "mutant_id",
    "fault_id",
    "spec",
    "value",
    "unit",
    "reading",
    "trigger",
    "condition",
    "hold",
    "changes",
    "files",
    "patch",
    "tree",
    "tree_digest",
)


@dataclass(frozen=True, kw_only=True)
class Request:
    """Which mutants are wanted: of specs under triggers, or of a campaign."""

    specs: tuple[str, ...]
    campaign: str | None
    triggers: tuple[str, ...]
    seed: int | None
    reading: str | None
    manifest: str | None
    trees: bool


def write_mutants(
    workspace: "Workspace", request: Request, out: Path, terminal: Terminal
) -> tuple["TargetManifest", list[dict[str, str]]]:
    """Write `out`/patches, `out`/trees if wanted, and `out`/index.csv; returns the target and the index.

    `out` must be new or empty, since old patches beside new ones would be taken for theirs.
    """
    from mutator.mutants.building import build

    make_folder(out)
    if any(out.iterdir()):
        raise MutatorError(
            "not empty", where=out, expected="a new or empty folder", remedy="choose another --out"
        )
    models = workspace.fault_models()
    if request.campaign:
        target, pairs = _of_campaign(workspace, request)
    else:
        target, pairs = _of_specs(workspace, request)
    index: dict[str, dict[str, str]] = {}
    (out / "patches").mkdir()
    writer = _Writer(target=target, out=out, trees=request.trees)
    with terminal.count(len(pairs), "mutants") as step:
        for fault, trigger in pairs:
            mutant = build(target, models, fault, trigger)
            if mutant.id not in index:
                index[mutant.id] = writer.write(mutant, fault, trigger)
            step()
    rows = list(index.values())
    with (out / "index.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    return target, rows


def _of_specs(
    workspace: "Workspace", request: Request
) -> tuple["TargetManifest", list[tuple["Fault", "Trigger"]]]:
    from mutator.model import Trigger

    if not request.specs:
        raise MutatorError("no spec named", remedy="name specs (`mutator list specs`) or --campaign")
    target, models = choose.find_target(workspace, request.manifest), workspace.fault_models()
    triggers: list[Trigger] = [
        choose.find_trigger(workspace, text, target.armed_after_s) for text in request.triggers
    ]
    if not triggers:
        for table in choose.context_tables(workspace):
            triggers += table.triggers(armed_after_s=target.armed_after_s)
    pairs = []
    for name in _spec_names(workspace, request.specs):
        choice = choose.FaultChoice(spec=name, seed=request.seed, reading=request.reading)
        pairs += [(f, t) for f in choice.faults(workspace, target, models) for t in triggers]
    return target, pairs


def _of_campaign(
    workspace: "Workspace", request: Request
) -> tuple["TargetManifest", list[tuple["Fault", "Trigger"]]]:
    from mutator.campaigns.plans import Choices, make_plan

    if request.specs or request.triggers:
        raise MutatorError(
            "--campaign together with specs or --trigger", expected="one or the other", where="generate"
        )
    plan = make_plan(workspace, request.campaign or "", Choices(seed=request.seed, reading=request.reading))
    pairs = [(e.fault, e.trigger) for e in plan.experiments]
    return workspace.manifest(plan.campaign.target), pairs


def _spec_names(workspace: "Workspace", wanted: tuple[str, ...]) -> Iterator[str]:
    """The specs meant: a glob is matched against the library's names, anything else is taken as it is."""
    for text in wanted:
        if not any(c in text for c in "*?["):
            yield text
            continue
        hits = fnmatch.filter([s.name for s in workspace.specs()], text)
        if not hits:
            raise MutatorError(f"no spec matches {text!r}", remedy="see `mutator list specs`")
        yield from hits


@dataclass(frozen=True, kw_only=True)
class _Writer:
    """Writes mutants below a folder."""

    target: "TargetManifest"
    out: Path
    trees: bool

    def write(self, mutant: "Mutant", fault: "Fault", trigger: "Trigger") -> dict[str, str]:
        """Write one mutant; returns its line of the index."""
        from mutator.mutants.building import write_tree

        patch = Path("patches") / f"{mutant.id}.patch"
        (self.out / patch).write_bytes(mutant.patch_bytes)
        tree = Path("trees") / mutant.id
        if self.trees:
            write_tree(self.target, mutant, self.out / tree)
        cells = (
            mutant.id,
            fault.id,
            fault.spec,
            fault.value,
            fault.unit,
            fault.reading,
            trigger.name,
            trigger.condition,
            (fault.hold or trigger.hold).value,
            ";".join(fault.changes),
            ";".join(sorted(mutant.files)),
            patch.as_posix(),
            tree.as_posix() if self.trees else "",
            mutant.tree_digest,
        )
        return {k: "" if v is None else str(v) for k, v in zip(COLUMNS, cells, strict=True)}
