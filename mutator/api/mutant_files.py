"""Write many mutants to a folder: patches, optionally source trees, and an index."""

import csv
import fnmatch
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder
from mutator._common.message_text import counted
from mutator.api.mutants import BuiltMutant, build_selected
from mutator.api.operator_mutants import OperatorChoice, draw_operator_faults
from mutator.api.target_and_fault_selection import (
    FaultChoice,
    SelectedTarget,
    WorkspaceLike,
    context_tables,
    open_workspace,
)
from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.model import Fault, Trigger
from mutator.mutants.mutant_building import write_mutated_tree
from mutator.store.plan_choices import Choices
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

INDEX_COLUMNS = (
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
FaultWithTrigger = tuple[Fault, Trigger]


def pairs_of_specs(
    selected_target: SelectedTarget,
    specs_globs_or_files: Iterable[str],
    triggers: Sequence[str] = (),
    *,
    seed: int | None = None,
    reading: str | None = None,
) -> list[FaultWithTrigger]:
    """Return every fault of the specs (names, globs, files) with every trigger; default: all contexts, or
    `always` if there are none.
    """
    selected_triggers = [selected_target.trigger(text) for text in triggers]
    if not selected_triggers:
        armed_after_s = selected_target.manifest.armed_after_s
        tables = context_tables(selected_target.workspace)
        selected_triggers = [
            trigger for table in tables for trigger in table.triggers(armed_after_s=armed_after_s)
        ]
        selected_triggers = selected_triggers or [always_trigger(armed_after_s=armed_after_s)]
    pairs: list[FaultWithTrigger] = []
    for name in _spec_names(selected_target.workspace, specs_globs_or_files):
        faults = selected_target.faults(FaultChoice(spec=name, seed=seed, reading=reading))
        pairs += [(fault, trigger) for fault in faults for trigger in selected_triggers]
    if not pairs:
        raise MutatorError(
            "no spec given",
            argument="specs",
            remedy="name specs (`mutator list specs` shows them) or a `campaign`",
        )
    return pairs


def pairs_of_campaign(
    workspace: Workspace, campaign: str, choices: Choices
) -> tuple[SelectedTarget, list[FaultWithTrigger]]:
    plan = build_plan(workspace, campaign, choices)
    return SelectedTarget.of(workspace, plan.campaign.target), [
        (e.fault, e.trigger) for e in plan.experiments
    ]


@dataclass(frozen=True, repr=False)
class MutantSet:
    """Faults with triggers for one target. Mutants are built when written."""

    selected_target: SelectedTarget  #: workspace and target
    pairs: tuple[FaultWithTrigger, ...]  #: each fault with its trigger
    note: str = ""  #: for operators: how many mutants were chosen and left out

    def __repr__(self) -> str:
        return f"<MutantSet: {counted(len(self), 'mutant')} of {self.selected_target.manifest.name}>"

    def __len__(self) -> int:
        return len(self.pairs)

    @classmethod
    def of_specs(
        cls,
        specs: Iterable[str],
        triggers: Sequence[str] = (),
        *,
        seed: int | None = None,
        reading: str | None = None,
        target: str | None = None,
        workspace: WorkspaceLike = None,
    ) -> "MutantSet":
        """Choose every fault of the specs (names, globs, files) with every trigger; default: all contexts."""
        selected_target = SelectedTarget.of(workspace, target)
        return cls(
            selected_target,
            tuple(pairs_of_specs(selected_target, specs, triggers, seed=seed, reading=reading)),
        )

    @classmethod
    def of_operators(
        cls,
        choice: OperatorChoice,
        triggers: Sequence[str] = (),
        *,
        target: str | None = None,
        workspace: WorkspaceLike = None,
    ) -> "MutantSet":
        """Choose mutants of mutation operators, with every trigger; default: `always`."""
        selected_target = SelectedTarget.of(workspace, target)
        faults, note = draw_operator_faults(selected_target, choice)
        selected_triggers = [selected_target.trigger(text) for text in triggers or ("always",)]
        return cls(
            selected_target,
            tuple((fault, trigger) for fault in faults for trigger in selected_triggers),
            note,
        )

    @classmethod
    def of_campaign(
        cls, campaign: str, *, choices: Choices | None = None, workspace: WorkspaceLike = None
    ) -> "MutantSet":
        """Choose the faults and triggers of a campaign's experiments."""
        selected_target, pairs = pairs_of_campaign(open_workspace(workspace), campaign, choices or Choices())
        return cls(selected_target, tuple(pairs))

    def write(
        self, out: str | Path, *, trees: bool = False, step: Callable[[], None] = lambda: None
    ) -> list[dict[str, str]]:
        """Write patches, index.csv and, with `trees`, whole source trees into a new or empty folder; return
        the index.

        `step` is called after each pair of fault and trigger.
        """
        return write_mutants(self.selected_target, self.pairs, Path(out), trees=trees, step=step)


def write_mutants(
    selected_target: SelectedTarget,
    pairs: Sequence[FaultWithTrigger],
    out: Path,
    *,
    trees: bool = False,
    step: Callable[[], None] = lambda: None,
) -> list[dict[str, str]]:
    """Write `out`/patches, `out`/index.csv and, with `trees`, `out`/trees; return the index.

    `out` must be new or empty, and is so again after an error. `step` is called after each pair.
    """
    is_new = not out.exists()
    make_folder(out)
    if any(out.iterdir()):  # older patches could be taken for these
        raise MutatorError(
            "not empty",
            where=out,
            argument="out",
            expected="a new or empty folder",
            remedy="choose another `out`",
        )
    try:
        return _write_into_empty_folder(selected_target, pairs, out, trees=trees, step=step)
    except BaseException:
        _empty_folder(out)
        if is_new:
            out.rmdir()
        raise


def _empty_folder(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _write_into_empty_folder(
    selected_target: SelectedTarget,
    pairs: Sequence[FaultWithTrigger],
    out: Path,
    *,
    trees: bool,
    step: Callable[[], None],
) -> list[dict[str, str]]:
    (out / "patches").mkdir()
    index: dict[str, dict[str, str]] = {}
    for fault, trigger in pairs:
        mutant = build_selected(selected_target, fault, trigger)
        if mutant.id not in index:  # experiments of a campaign share mutants, e.g. in several scenarios
            index[mutant.id] = _write_mutant(mutant, out, trees=trees)
        step()
    rows = list(index.values())
    with (out / "index.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, INDEX_COLUMNS, lineterminator="\n")  # the default would be \r\n
        table.writeheader()
        table.writerows(rows)
    return rows


def _spec_names(workspace: Workspace, specs_globs_or_files: Iterable[str]) -> Iterator[str]:
    for name_or_glob in specs_globs_or_files:
        if not any(c in name_or_glob for c in "*?["):
            yield name_or_glob
            continue
        matches = fnmatch.filter([s.name for s in workspace.specs()], name_or_glob)
        if not matches:
            raise MutatorError(
                f"no spec matches {name_or_glob!r}", argument="specs", remedy="see `mutator list specs`"
            )
        yield from matches


def _write_mutant(built_mutant: BuiltMutant, out: Path, *, trees: bool) -> dict[str, str]:
    mutant, fault, trigger = built_mutant.mutant, built_mutant.fault, built_mutant.trigger
    patch = Path("patches") / f"{mutant.id}.patch"
    # a source can have another encoding than UTF-8
    (path_below(out, patch.as_posix())).write_bytes(mutant.patch_bytes)
    tree = Path("trees") / mutant.id
    if trees:
        write_mutated_tree(built_mutant.manifest, mutant, path_below(out, tree.as_posix()))
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
        tree.as_posix() if trees else "",
        mutant.tree_digest,
    )
    return {k: "" if v is None else str(v) for k, v in zip(INDEX_COLUMNS, cells, strict=True)}
