"""From what is typed to a fault, a trigger, a run folder: the choices that several verbs share."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.faults.fault_models import FaultModels
    from mutator.faults.specs import FaultSpec, Variant
    from mutator.model import Fault, Trigger
    from mutator.stpa.context_tables import ContextTable
    from mutator.targets.manifest import TargetManifest
    from mutator.workspace import Workspace

RUNS = Path("runs")
HEAD = "run.json"


@dataclasses.dataclass(frozen=True, kw_only=True)
class FaultChoice:
    """Which faults of one spec are meant. `value` replaces the drawn ones."""

    spec: str
    variant: str | None = None
    value: float | None = None
    seed: int | None = None
    reading: str | None = None

    def faults(
        self, workspace: "Workspace", manifest: "TargetManifest", models: "FaultModels"
    ) -> tuple["Fault", ...]:
        """The chosen faults in the spec's order, never none; a mistake in the spec is told at its line."""
        from mutator.faults.expansion import expand
        from mutator.verification.library import check_spec

        spec = self._narrowed(workspace.spec(self.spec))
        for problem in check_spec(spec, models, manifest):
            raise problem
        return expand(spec, self.seed or 0, self.reading, models=models, manifest=manifest)

    def _narrowed(self, spec: "FaultSpec") -> "FaultSpec":
        variants = tuple(v for v in spec if self.variant in (None, v.name))
        if not variants:
            names = ", ".join(v.name for v in spec)
            raise MutatorError(f"no variant {self.variant!r}", where=spec.path, expected=f"one of {names}")
        if self.value is not None:
            variants = tuple(_with_value(spec, v, self.value) for v in variants)
        return dataclasses.replace(spec, variants=variants)


def one_of_each_variant(faults: "tuple[Fault, ...]") -> "tuple[tuple[Fault, int], ...]":
    """The middle fault of each variant, and how many the variant has: they differ in their value alone."""
    groups: dict[str, list[Fault]] = {}
    for fault in faults:
        groups.setdefault(fault.spec, []).append(fault)
    return tuple((group[len(group) // 2], len(group)) for group in groups.values())


def target_name(workspace: "Workspace", given: str | None) -> str:
    """The target that was named, or the library's only one."""
    names = workspace.target_names()
    if given is None and len(names) != 1:
        known = ", ".join(names) or "none"
        raise MutatorError(
            f"{len(names)} targets in the library ({known})", remedy="name one: --manifest NAME"
        )
    return given or names[0]


def find_target(workspace: "Workspace", given: str | None) -> "TargetManifest":
    """The manifest of that target."""
    return workspace.manifest(target_name(workspace, given))


def context_tables(workspace: "Workspace") -> tuple["ContextTable", ...]:
    """The context tables of the library, in the order of their names."""
    return tuple(workspace.context_table(name) for name in workspace.context_table_names())


def find_trigger(workspace: "Workspace", text: str, armed_after_s: float) -> "Trigger":
    """A trigger from what was typed: a context (`C1`), a time in s (`10`), `always`, or a condition."""
    from mutator.triggers.kinds import TYPED, read_trigger

    named = [
        (table, row.id)
        for table in context_tables(workspace)
        for row in table.rows
        if text in (row.id, f"{table.name}/{row.id}")
    ]
    if len(named) > 1:
        known = ", ".join(f"{table.name}/{row}" for table, row in named)
        raise MutatorError(
            f"context '{text}' in {len(named)} tables", where="--trigger", expected=f"one of {known}"
        )
    if named:
        table, row = named[0]
        return table.triggers(armed_after_s=armed_after_s, rows=(row,))[0]
    try:
        return read_trigger(text, armed_after_s)
    except MutatorError as e:
        contexts = ", ".join(row.id for table in context_tables(workspace) for row in table.rows)
        raise MutatorError(
            e.got, where="--trigger", expected=f"a context ({contexts}), {TYPED}", remedy=e.remedy
        ) from e


def find_run(given: Path | None, root: Path) -> Path:
    """The run folder that was named, else the newest one in runs/ here or under `root`."""
    if given is not None:
        return given
    here = {base.resolve() for base in (RUNS, root / RUNS)}
    heads = [head for base in here for head in base.glob(f"*/{HEAD}")]
    if not heads:
        raise MutatorError(
            "no run folder in runs/",
            remedy="name one: --run DIR, or make one: `mutator run quickstart --out runs/first`",
        )
    newest = max(heads, key=lambda head: (head.stat().st_mtime_ns, str(head)))
    return _from_here(newest.parent)


def _from_here(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _with_value(spec: "FaultSpec", variant: "Variant", value: float) -> "Variant":
    if variant.draw is None:
        raise MutatorError(
            f"variant {variant.name!r} takes no value", where=spec.path, remedy="leave --value out"
        )
    exact = int(value) if value.is_integer() else value
    draw = dataclasses.replace(variant.draw, kind="list", ranges=(), values=(exact,))
    return dataclasses.replace(variant, draw=draw)
