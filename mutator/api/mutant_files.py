"""Write many mutants to a folder: patches, optionally source trees, and an index."""

import csv
import fnmatch
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder
from mutator._common.message_text import counted
from mutator.api.mutants import BuiltMutant, built
from mutator.api.operator_mutants import OperatorChoice, operator_faults
from mutator.api.selection import Bench, FaultChoice, WorkspaceLike, context_tables, open_workspace
from mutator.campaigns.plan import make_plan
from mutator.errors import MutatorError
from mutator.model import Fault, Trigger
from mutator.mutants.mutant_building import write_tree
from mutator.store.plan_choices import Choices
from mutator.triggers.trigger_kinds import always_trigger
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
Pair = tuple[Fault, Trigger]


def pairs_of_specs(
    bench: Bench,
    specs: Iterable[str],
    triggers: Sequence[str] = (),
    *,
    seed: int | None = None,
    reading: str | None = None,
) -> list[Pair]:
    """Return every fault of the specs (names, globs, files) with every trigger; default: all contexts, or
    `always` if there are none.
    """
    made = [bench.trigger(text) for text in triggers]
    if not made:
        armed_after_s = bench.manifest.armed_after_s
        tables = context_tables(bench.workspace)
        made = [trigger for table in tables for trigger in table.triggers(armed_after_s=armed_after_s)]
        made = made or [always_trigger(armed_after_s=armed_after_s)]
    pairs: list[Pair] = []
    for name in _spec_names(bench.workspace, specs):
        faults = bench.faults(FaultChoice(spec=name, seed=seed, reading=reading))
        pairs += [(fault, trigger) for fault in faults for trigger in made]
    if not pairs:
        raise MutatorError(
            "no spec given",
            argument="specs",
            remedy="name specs (`mutator list specs` shows them) or a `campaign`",
        )
    return pairs


def pairs_of_campaign(workspace: Workspace, campaign: str, choices: Choices) -> tuple[Bench, list[Pair]]:
    plan = make_plan(workspace, campaign, choices)
    return Bench.of(workspace, plan.campaign.target), [(e.fault, e.trigger) for e in plan.experiments]


@dataclass(frozen=True, repr=False)
class MutantSet:
    """Faults with triggers for one target. Mutants are built when written."""

    bench: Bench  #: workspace and target
    pairs: tuple[Pair, ...]  #: each fault with its trigger
    told: str = ""  #: for operators: how many mutants were chosen and left out

    def __repr__(self) -> str:
        return f"<MutantSet: {counted(len(self), 'mutant')} of {self.bench.manifest.name}>"

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
        bench = Bench.of(workspace, target)
        return cls(bench, tuple(pairs_of_specs(bench, specs, triggers, seed=seed, reading=reading)))

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
        bench = Bench.of(workspace, target)
        faults, told = operator_faults(bench, choice)
        made = [bench.trigger(text) for text in triggers or ("always",)]
        return cls(bench, tuple((fault, trigger) for fault in faults for trigger in made), told)

    @classmethod
    def of_campaign(
        cls, campaign: str, *, choices: Choices | None = None, workspace: WorkspaceLike = None
    ) -> "MutantSet":
        """Choose the faults and triggers of a campaign's experiments."""
        bench, pairs = pairs_of_campaign(open_workspace(workspace), campaign, choices or Choices())
        return cls(bench, tuple(pairs))

    def write(
        self, out: str | Path, *, trees: bool = False, step: Callable[[], None] = lambda: None
    ) -> list[dict[str, str]]:
        """Write patches, index.csv and, with `trees`, whole source trees into a new or empty folder; return
        the index.

        `step` is called after each pair of fault and trigger.
        """
        return write_mutants(self.bench, self.pairs, Path(out), trees=trees, step=step)


def write_mutants(
    bench: Bench,
    pairs: Sequence[Pair],
    out: Path,
    *,
    trees: bool = False,
    step: Callable[[], None] = lambda: None,
) -> list[dict[str, str]]:
    """Write `out`/patches, `out`/index.csv and, with `trees`, `out`/trees; return the index.

    `out` must be new or empty. `step` is called after each pair.
    """
    make_folder(out)
    if any(out.iterdir()):
        raise MutatorError(
            "not empty",
            where=out,
            argument="out",
            expected="a new or empty folder",
            remedy="choose another `out`",
        )
    (out / "patches").mkdir()
    index: dict[str, dict[str, str]] = {}
    for fault, trigger in pairs:
        mutant = built(bench, fault, trigger)
        if mutant.id not in index:
            index[mutant.id] = _write(mutant, out, trees=trees)
        step()
    rows = list(index.values())
    with (out / "index.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    return rows


def _spec_names(workspace: Workspace, wanted: Iterable[str]) -> Iterator[str]:
    for text in wanted:
        if not any(c in text for c in "*?["):
            yield text
            continue
        hits = fnmatch.filter([s.name for s in workspace.specs()], text)
        if not hits:
            raise MutatorError(
                f"no spec matches {text!r}", argument="specs", remedy="see `mutator list specs`"
            )
        yield from hits


def _write(built_mutant: BuiltMutant, out: Path, *, trees: bool) -> dict[str, str]:
    mutant, fault, trigger = built_mutant.mutant, built_mutant.fault, built_mutant.trigger
    patch = Path("patches") / f"{mutant.id}.patch"
    (path_below(out, patch.as_posix())).write_bytes(mutant.patch_bytes)
    tree = Path("trees") / mutant.id
    if trees:
        write_tree(built_mutant.manifest, mutant, path_below(out, tree.as_posix()))
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
    return {k: "" if v is None else str(v) for k, v in zip(COLUMNS, cells, strict=True)}
