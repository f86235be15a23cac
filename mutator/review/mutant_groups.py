"""The groups to review: the mutants of a library or campaign by location and template.

A group does not depend on triggers, or on which of its mutants are selected. Its id follows from its label.
Decisions are bound to its diff, which has holes instead of values, to the target's code and to the templates
(`Material`).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from mutator._common.hashing import content_id
from mutator.campaigns.plan import Plan
from mutator.config.location_syntax import PROBE_NAME
from mutator.faults import probe_templates
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.spec_expansion import expand
from mutator.model import Fault, Injection, Trigger
from mutator.mutants.anchors import parsed_file
from mutator.mutants.mutant_building import build
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.operator_lookup import OPERATOR_MODELS, operator_name_of
from mutator.operators.statement_facts import facts_of
from mutator.review import patch_shapes
from mutator.review.called_code import CalledCode
from mutator.review.decision_basis import Material, diffs_of, fault_hunks, functions_of
from mutator.review.entries import Bound, Values
from mutator.review.patch_shapes import Shape
from mutator.review.seen_texts import text_of
from mutator.review.value_ranges import ranges_of
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class Group:
    """Mutants that differ only in values and triggers, or all mutants that an operator makes in a function.
    `what` is the label: location and template.

    `shapes` are the group's diffs with holes, several if a template writes different lines for different
    numbers. The members of the shapes are the ids of `faults`. `runs` is the number of the group's
    experiments in a campaign; None if no campaign is given. `trigger` and `hold` list the kinds that occur,
    joined by `or`. `values` is the range of each parameter in the specs. `seen` is the text that a decision
    is bound to. `made_from` are the files of the specs and templates.
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
    values: Values = field(default_factory=dict)
    seen: str = ""
    made_from: tuple[Path, ...] = ()

    @property
    def diff(self) -> str:
        """The diffs with holes, for display."""
        return "".join(shape.diff for shape in self.shapes)

    @property
    def specs(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(fault.spec for fault in self.faults))


_Member = tuple[Fault, Trigger]


def of_plan(workspace: Workspace, plan: Plan) -> tuple[Group, ...]:
    """Return the groups of all mutants that the plan runs, canary included; the probe's group is last."""
    manifest = workspace.manifest(plan.campaign.target)
    members = [(e.fault, e.trigger) for e in (*plan.experiments, plan.canary)]
    runs = Counter(patch_shapes.group_label(e.fault) for e in plan.experiments)
    files = [one.spec_file for one in plan.campaign.fault_selections if one.spec_file]
    named = [
        workspace.spec(file) for file in files if file.is_file()
    ]  # in a run folder's copy of a campaign, links can be dangling
    specs = (*workspace.specs(), *named)
    return _Catalogue(workspace.fault_models(), manifest, specs).groups(members, runs)


def of_library(
    workspace: Workspace,
    manifest: TargetManifest,
    *,
    specs: Sequence[str] = (),
    reading: str | None = None,
    seed: int = 0,
) -> tuple[Group, ...]:
    """Return the groups of the library's faults; the probe's group is last.

    Each fault is built with a trigger for every context of the tables and one for a random time, as in
    campaigns that do not set `hold`. Without `reading`, all readings are included. `specs` are spec files, or
    globs over spec names (none: all); MutatorError if one matches nothing.
    """
    models = workspace.fault_models()
    tables = map(workspace.context_table, workspace.context_tables)
    contexts = [t for table in tables for t in table.triggers(armed_after_s=manifest.armed_after_s)]
    triggers = (*contexts, trigger_at_time(manifest.armed_after_s))
    chosen = tuple(_specs(workspace, specs))
    faults = [
        fault
        for spec in chosen
        for name in ((reading,) if reading else spec.readings.names)
        for fault in expand(spec, seed, name, models=models, manifest=manifest)
    ]
    members = [(fault, trigger) for fault in faults for trigger in triggers]
    return _Catalogue(models, manifest, chosen).groups(members, None)


def _specs(workspace: Workspace, wanted: Sequence[str]) -> Iterator[FaultSpec]:
    library = workspace.specs()
    if not wanted:
        yield from library
    for text in wanted:
        hits = [spec for spec in library if fnmatchcase(spec.name, text)]
        yield from hits or [workspace.spec(text)]


class _Catalogue:
    """Builds the groups of one target; `specs` define which values can be drawn."""

    def __init__(self, models: FaultModels, manifest: TargetManifest, specs: Sequence[FaultSpec]) -> None:
        self.models = models
        self.manifest = manifest
        self.specs = {spec.name: spec for spec in specs}
        self._called = CalledCode(manifest.tree)

    def groups(self, members: Sequence[_Member], runs: Mapping[str, int] | None) -> tuple[Group, ...]:
        """Return the groups of `members`, sorted by label; `runs` counts experiments by label."""
        found: dict[str, list[_Member]] = {}
        for fault, trigger in members:
            found.setdefault(patch_shapes.group_label(fault), []).append((fault, trigger))
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
        shapes = patch_shapes.shapes((fault.id, what, patches[fault.injections]) for fault in faults.values())
        fault, _ = members[0]
        injections = tuple(dict.fromkeys(i for one in faults.values() for i in one.injections))
        models = tuple(dict.fromkeys(injection.model for injection in injections))
        operator = operator_name_of(fault)
        values: Values = {}
        if operator:
            material = self._material_of_operator(fault, operator)
        else:
            several = [faults[shape.members[0]] for shape in shapes]
            material = self._material(several, [patches[one.injections] for one in several])
            values = ranges_of(faults.values(), self.specs, self.models)
        return Group(
            id=self._id(what),
            what=what,
            injections=(what,) if operator else tuple(map(patch_shapes.injection_label, fault.injections)),
            files=tuple(dict.fromkeys(i.location.path for i in injections)),
            functions=tuple(dict.fromkeys(i.location.function for i in injections)),
            models=models,
            trigger=" or ".join(sorted({patch_shapes.trigger_kind(trigger) for _, trigger in members})),
            hold=" or ".join(sorted({patch_shapes.hold_of(*member).value for member in members})),
            shapes=tuple(
                s.with_named_holes(patch_shapes.parameter_values(faults[m]) for m in s.members)
                for s in shapes
            ),
            faults=tuple(faults.values()),
            triggers=tuple(dict.fromkeys(trigger for _, trigger in members)),
            runs=None if runs is None else runs.get(what, 0),
            bound=material.bound,
            values=values,
            seen=text_of(material.bound, values, material.sections),
            made_from=self._made_from(faults.values(), models),
        )

    def _made_from(self, faults: Iterable[Fault], models: Iterable[str]) -> tuple[Path, ...]:
        names = dict.fromkeys(fault.spec.rpartition("/")[0] for fault in faults)
        specs = [self.specs[name].path for name in names if name in self.specs]
        found = map(self.models.get, models)
        return (*specs, *(path for one in found for path in (one.template_path, one.source.path)))

    def _material(self, faults: Sequence[Fault], patches: Sequence[str]) -> Material:
        """Return the texts that a decision about mutants is bound to; `faults` has one for each shape."""
        calls: dict[str, str] = {}
        for fault in faults:
            mutant = build(self.manifest, self.models, fault, always_trigger())
            for path in dict.fromkeys(i.location.path for i in fault.injections):
                calls |= self._called.of_lines(path, mutant.files[path])
        injections = faults[0].injections
        return Material(
            diff=diffs_of(patches),
            functions=functions_of(self.manifest.tree, [i.location for i in injections]),
            templates={i.model: self.models.get(i.model).template for i in injections},
            calls=calls,
        )

    def _material_of_operator(self, fault: Fault, operator: str) -> Material:
        """Return the texts that determine all mutants of an operator in a function, selected or not."""
        at, tree = fault.injections[0].location, self.manifest.tree
        file, facts = parsed_file(tree, at.path), facts_of(tree, at.path)
        found = list(mutations_of(file, facts, at.function, self.models, [operator]))
        models = {*OPERATOR_MODELS, *(one.model for one in found)}
        return Material(
            diff=[[one.source_before, one.source_after] for one in found],
            functions=functions_of(tree, [at]),
            templates={one.name: one.template for one in self.models if one.name in models},
            calls=self._called.of_expressions(at.path, at.function, [one.source_after for one in found]),
        )

    def _probe(self, runs: Mapping[str, int] | None) -> Group:
        """Return the group of the code that every mutant has: the probe, its import, and the observing
        statement.
        """
        location = self.manifest.observation.location
        what = f"the probe, observing at {patch_shapes.location_label(location)}"
        patch = build(self.manifest, self.models, None, always_trigger()).patch
        material = Material(
            diff=diffs_of([patch]),
            functions=functions_of(self.manifest.tree, [location]),
            templates={probe_templates.CODE: self.models.probe.text},
            calls={},
        )
        return Group(
            id=self._id(what),
            what=what,
            injections=(what,),
            files=(location.path,),
            functions=(location.function,),
            models=(PROBE_NAME,),
            trigger="",
            hold="",
            shapes=tuple(patch_shapes.shapes([("", what, patch)])),
            faults=(),
            triggers=(),
            runs=None if runs is None else sum(runs.values()),
            bound=material.bound,
            seen=text_of(material.bound, {}, material.sections),
            made_from=(*(self.models.folder / name for name in probe_templates.FILES), self.manifest.path),
        )

    def _id(self, what: str) -> str:
        return content_id([self.manifest.name, what])[:12]
