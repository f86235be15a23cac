"""What there is to review: the mutants of a library or campaign, grouped by location, template and trigger.

A group is the same whichever of its mutants are selected: its id follows from what it is about, and what a
decision is bound to (`Bound`) from its diff with holes, the target's functions and the templates.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import lru_cache

from mutator._common.hashing import content_id
from mutator.campaigns.plans import Plan
from mutator.faults.expansion import expand
from mutator.faults.fault_models import PROBE_TEMPLATE, FaultModels
from mutator.faults.specs import FaultSpec
from mutator.model import Fault, FaultLocation, Injection, Trigger
from mutator.mutants.anchors import parsed
from mutator.mutants.building import build
from mutator.mutants.probe import adds_fault
from mutator.mutants.readable_diffs import adds_file, file_patches
from mutator.operators.enumeration import mutations_of
from mutator.operators.facts import facts_of
from mutator.operators.names import MODELS, Operator, operator_of
from mutator.review import groups
from mutator.review.groups import Shape
from mutator.targets.manifest import TargetManifest
from mutator.triggers.kinds import always, at_time
from mutator.workspace import Workspace

_HUNK_HEAD = re.compile(r"^@@ .*$", re.MULTILINE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """Digests of what a decision is about; when one of them changes, the decision no longer holds."""

    diff: str  # of the hunks with injected lines, without their values and line numbers
    function: str  # of the target's functions that are changed, without injected lines
    template: str  # of the templates that the injected lines were made from

    def changed(self, now: "Bound") -> list[str]:
        """What has changed, in words."""
        words = {"template": "template", "function": "target function", "diff": "diff"}
        return [word for name, word in words.items() if getattr(self, name) != getattr(now, name)]


@dataclass(frozen=True, kw_only=True)
class Group:
    """Mutants that differ only in values, or those that an operator makes of a function. `what` is one line:
    the location, the template and the trigger.

    `shapes` are its diffs with holes: more than one if a template writes different lines for different
    numbers. Their members are `faults`, by id. `runs` is the number of its experiments in a campaign; None
    without a campaign.
    """

    id: str
    what: str
    injections: tuple[str, ...]  # `place: model(parameters)` of each
    files: tuple[str, ...]
    functions: tuple[str, ...]
    models: tuple[str, ...]
    trigger: str
    hold: str
    shapes: tuple[Shape, ...]
    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    runs: int | None
    bound: Bound

    @property
    def diff(self) -> str:
        """Its diffs with holes, for reading."""
        return "".join(shape.diff for shape in self.shapes)

    @property
    def specs(self) -> tuple[str, ...]:
        """The specs and variants of its faults."""
        return tuple(dict.fromkeys(fault.spec for fault in self.faults))


_Member = tuple[Fault, Trigger]


def of_plan(workspace: Workspace, plan: Plan) -> tuple[Group, ...]:
    """The groups of every mutant that the plan runs, its canary included; the probe's comes last."""
    manifest = workspace.manifest(plan.campaign.target)
    members = [(e.fault, e.trigger) for e in (*plan.experiments, plan.canary)]
    runs = Counter(groups.group_label(e.fault, e.trigger) for e in plan.experiments)
    return _Catalogue(workspace.fault_models(), manifest).groups(members, runs)


def of_library(
    workspace: Workspace,
    manifest: TargetManifest,
    *,
    specs: Sequence[str] = (),
    reading: str | None = None,
    seed: int = 0,
) -> tuple[Group, ...]:
    """The groups of the library's faults; the probe's comes last.

    Each fault is built under every context of the tables and at a random time, as campaigns do that leave
    open how long a fault stays; without `reading`, in every reading of the library. `specs` are spec files or
    globs over specs (none: all); MutatorError for one that matches nothing.
    """
    models = workspace.fault_models()
    tables = map(workspace.context_table, workspace.context_tables)
    contexts = [t for table in tables for t in table.triggers(armed_after_s=manifest.armed_after_s)]
    triggers = (*contexts, at_time(manifest.armed_after_s))
    faults = [
        fault
        for spec in _specs(workspace, specs)
        for name in ((reading,) if reading else spec.readings.names)
        for fault in expand(spec, seed, name, models=models, manifest=manifest)
    ]
    members = [(fault, trigger) for fault in faults for trigger in triggers]
    return _Catalogue(models, manifest).groups(members, None)


def _specs(workspace: Workspace, wanted: Sequence[str]) -> Iterator[FaultSpec]:
    """The wanted specs: all of them, files, or those whose names match a glob."""
    library = workspace.specs()
    if not wanted:
        yield from library
    for text in wanted:
        hits = [spec for spec in library if fnmatchcase(spec.name, text)]
        yield from hits or [workspace.spec(text)]


class _Catalogue:
    """Makes the groups of one target and its templates."""

    def __init__(self, models: FaultModels, manifest: TargetManifest) -> None:
        self.models = models
        self.manifest = manifest

    def groups(self, members: Sequence[_Member], runs: Mapping[str, int] | None) -> tuple[Group, ...]:
        """The groups of `members`, sorted by label; `runs` counts experiments by label."""
        found: dict[str, list[_Member]] = {}
        for fault, trigger in members:
            found.setdefault(groups.group_label(fault, trigger), []).append((fault, trigger))
        patches: dict[tuple[Injection, ...], str] = {}
        for fault, trigger in members:
            if fault.injections not in patches:
                mutant = build(self.manifest, self.models, fault, trigger)
                patches[fault.injections] = fault_hunks(mutant.patch)
        made = [self._group(what, found[what], patches, runs) for what in sorted(found)]
        return (*made, self._probe(runs))

    def _group(
        self,
        what: str,
        members: Sequence[_Member],
        patches: dict[tuple[Injection, ...], str],
        runs: Mapping[str, int] | None,
    ) -> Group:
        faults = {fault.id: fault for fault, _ in members}
        shapes = groups.shapes((fault.id, what, patches[fault.injections]) for fault in faults.values())
        fault, _ = members[0]
        injections = tuple(dict.fromkeys(i for one in faults.values() for i in one.injections))
        kinds = dict.fromkeys(groups.trigger_kind(trigger) for _, trigger in members)
        holds = dict.fromkeys(groups.hold_of(*member).value for member in members)
        operator = operator_of(fault)
        return Group(
            id=self._id(what),
            what=what,
            injections=(what,) if operator else tuple(map(groups.injection_label, fault.injections)),
            files=tuple(dict.fromkeys(i.location.path for i in injections)),
            functions=tuple(dict.fromkeys(i.location.function for i in injections)),
            models=tuple(dict.fromkeys(injection.model for injection in injections)),
            trigger=" or ".join(kinds),
            hold=" or ".join(holds),
            shapes=tuple(
                s.with_named_holes(groups.parameter_values(faults[m]) for m in s.members) for s in shapes
            ),
            faults=tuple(faults.values()),
            triggers=tuple(dict.fromkeys(trigger for _, trigger in members)),
            runs=None if runs is None else runs.get(what, 0),
            bound=self._bound_of_operator(fault, operator)
            if operator
            else self._bound(
                sorted({patches[fault.injections] for fault in faults.values()}, key=groups.without_values),
                [injection.location for injection in fault.injections],
                {i.model: self.models.get(i.model).template for i in fault.injections},
            ),
        )

    def _bound_of_operator(self, fault: Fault, operator: Operator) -> Bound:
        """What all the mutants of an operator in a function follow from, whichever were drawn."""
        at = fault.injections[0].location
        file, facts = parsed(self.manifest.tree, at.path), facts_of(self.manifest.tree, at.path)
        changes = [
            [one.was, one.now] for one in mutations_of(file, facts, at.function, self.models, [operator])
        ]
        templates = {one.name: one.template for one in self.models if one.name in MODELS}
        return replace(self._bound([], [at], templates), diff=content_id(changes))

    def _probe(self, runs: Mapping[str, int] | None) -> Group:
        """What every mutant has: the probe, its import, and the statement that observes."""
        location = self.manifest.observation.location
        what = f"the probe, observing at {groups.location_label(location)}"
        patch = build(self.manifest, self.models, None, always()).patch
        return Group(
            id=self._id(what),
            what=what,
            injections=(what,),
            files=(location.path,),
            functions=(location.function,),
            models=(PROBE_TEMPLATE.partition(".")[0],),
            trigger="",
            hold="",
            shapes=tuple(groups.shapes([("", what, patch)])),
            faults=(),
            triggers=(),
            runs=None if runs is None else sum(runs.values()),
            bound=self._bound([patch], [location], {PROBE_TEMPLATE: self.models.probe}),
        )

    def _id(self, what: str) -> str:
        return content_id([self.manifest.name, what])[:12]

    def _bound(
        self, patches: Sequence[str], locations: Sequence[FaultLocation], templates: dict[str, str]
    ) -> Bound:
        diffs = dict.fromkeys(_HUNK_HEAD.sub("@@", groups.without_values(patch)) for patch in patches)
        sources = {
            f"{place.path} {place.function}": _function(
                self.manifest.tree.files[place.path], place.function
            ).decode("utf-8", "surrogateescape")
            for place in locations
        }
        return Bound(
            diff=content_id(list(diffs)), function=content_id(sources), template=content_id(templates)
        )


def fault_hunks(patch: str) -> str:
    """The hunks that hold lines of a fault, without those that every mutant has."""
    kept = []
    for section in file_patches(patch):
        if not adds_file(section):
            head, *hunks = re.split(r"^(?=@@ )", section, flags=re.MULTILINE)
            own = [hunk for hunk in hunks if adds_fault(hunk)]
            kept += [head, *own] if own else []
    return "".join(kept)


@lru_cache(maxsize=256)
def _function(data: bytes, name: str) -> bytes:
    """The source of the functions with this qualified name, decorators included."""
    lines = data.splitlines(keepends=True)
    spans = [
        (min(n.lineno for n in (node, *node.decorator_list)), node.end_lineno)
        for path, node in _functions(ast.parse(data), ())
        if path == name
    ]
    return b"".join(b"".join(lines[first - 1 : last]) for first, last in spans)


def _functions(
    tree: ast.AST, path: tuple[str, ...]
) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for node in ast.iter_child_nodes(tree):
        inside = path
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            inside = (*path, node.name)
            if not isinstance(node, ast.ClassDef):
                yield ".".join(inside), node
        yield from _functions(node, inside)
