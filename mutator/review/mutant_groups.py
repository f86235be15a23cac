"""The groups to review: the mutants of a library or campaign by location and template.

A group does not depend on triggers, or on which of its mutants are selected. Its id follows from its label.
Decisions are bound to its diff, which has holes instead of values, to the target's code and to the templates
(`BasisTexts`).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from mutator._common.hashing import content_id
from mutator.campaigns.plan import Plan
from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.faults import probe_template_parts
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault, Injection, Trigger
from mutator.mutants.mutant_building import build
from mutator.mutants.parsed_files_and_anchors import parsed_file
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.operator_lookup import OPERATOR_MODELS, operator_name_of
from mutator.operators.statement_facts import statement_facts_of
from mutator.review import patch_shapes
from mutator.review.code_called_by_injections import CalledCode
from mutator.review.decision_basis_texts import BasisTexts, distinct_diffs, fault_hunks, function_sources
from mutator.review.fault_descriptions import descriptions_of_faults
from mutator.review.parameter_ranges_and_units import find_variant, units_of_parameters, value_ranges_of
from mutator.review.patch_shapes import PatchShape
from mutator.review.review_entries import BasisDigests, ValueRanges
from mutator.review.reviewed_texts import render_reviewed_text
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class Group:
    """Mutants that differ only in values and triggers, or all mutants that an operator makes in a function.
    `label` is location and template.

    `shapes` are the group's diffs with holes, several if a template writes different lines for different
    numbers. The members of the shapes are the ids of `faults`. `experiment_count` is that of the group in a
    campaign; None if no campaign is given. `trigger_kinds` and `hold_kinds` list the kinds that occur, joined
    by `or`. `value_ranges` has the range of each parameter in the specs, and `unit_by_parameter` its unit in
    the injected code. `about_by_variant` says what each variant of a spec does. `reviewed_text` is the text
    that a decision is bound to. `source_files` are the specs and templates. `fault_descriptions` say
    what each fault does.
    """

    id: str
    label: str
    injection_labels: tuple[str, ...]  # `place: model(parameters)` of each
    files: tuple[str, ...]
    functions: tuple[str, ...]
    models: tuple[str, ...]
    trigger_kinds: str
    hold_kinds: str
    shapes: tuple[PatchShape, ...]
    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    experiment_count: int | None
    basis_digests: BasisDigests
    value_ranges: ValueRanges = field(default_factory=dict)
    unit_by_parameter: Mapping[str, str] = field(default_factory=dict)
    about_by_variant: Mapping[str, str] = field(default_factory=dict)
    reviewed_text: str = ""
    source_files: tuple[Path, ...] = ()
    fault_descriptions: tuple[str, ...] = ()

    @property
    def diff(self) -> str:
        """The diffs with holes, for display."""
        return "".join(shape.diff for shape in self.shapes)

    @property
    def specs(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(fault.spec for fault in self.faults))


_FaultWithTrigger = tuple[Fault, Trigger]


def groups_of_plan(workspace: Workspace, plan: Plan) -> tuple[Group, ...]:
    """Return the groups of all mutants that the plan runs, canary included; the probe's group is last."""
    manifest = workspace.manifest(plan.campaign.target)
    members = [(e.fault, e.trigger) for e in (*plan.experiments, *filter(None, [plan.canary]))]
    runs = Counter(patch_shapes.group_label(e.fault) for e in plan.experiments)
    files = [selection.spec_file for selection in plan.campaign.fault_selections if selection.spec_file]
    named = [
        workspace.spec(file) for file in files if file.is_file()
    ]  # in a run folder's copy of a campaign, links can be dangling
    specs = (*workspace.specs(), *named)
    return _GroupBuilder(workspace.fault_models(), manifest, specs).build_groups(members, runs)


def groups_of_library(
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
    triggers = (*contexts, trigger_at_time(manifest.armed_after_s, name="random"))
    chosen = tuple(_selected_specs(workspace, specs))
    faults = [
        fault
        for spec in chosen
        for name in ((reading,) if reading else spec.readings.names)
        for fault in expand_spec(spec, seed, name, models=models, manifest=manifest)
    ]
    members = [(fault, trigger) for fault in faults for trigger in triggers]
    return _GroupBuilder(models, manifest, chosen).build_groups(members, None)


def _selected_specs(workspace: Workspace, patterns: Sequence[str]) -> Iterator[FaultSpec]:
    library = workspace.specs()
    if not patterns:
        yield from library
    for text in patterns:
        hits = [spec for spec in library if fnmatchcase(spec.name, text)]
        yield from hits or [workspace.spec(text)]


class _GroupBuilder:
    """Builds the groups of one target; `specs` define which values can be drawn."""

    def __init__(self, models: FaultModels, manifest: TargetManifest, specs: Sequence[FaultSpec]) -> None:
        self.models = models
        self.manifest = manifest
        self.specs = {spec.name: spec for spec in specs}
        self._called_code = CalledCode(manifest.tree)

    def build_groups(
        self, members: Sequence[_FaultWithTrigger], experiment_count_by_label: Mapping[str, int] | None
    ) -> tuple[Group, ...]:
        """Return the groups of `members`, sorted by label; `runs` counts experiments by label."""
        members_by_label: dict[str, list[_FaultWithTrigger]] = {}
        for fault, trigger in members:
            members_by_label.setdefault(patch_shapes.group_label(fault), []).append((fault, trigger))
        patch_by_injections: dict[tuple[Injection, ...], str] = {}
        for fault, trigger in members:
            if fault.injections not in patch_by_injections:
                mutant = build(self.manifest, self.models, fault, trigger)
                patch_by_injections[fault.injections] = fault_hunks(mutant.patch)
        built = [
            self._build_group(what, members_by_label[what], patch_by_injections, experiment_count_by_label)
            for what in sorted(members_by_label)
        ]
        return (*built, self._build_probe_group(experiment_count_by_label))

    def _build_group(
        self,
        label: str,
        members: Sequence[_FaultWithTrigger],
        patch_by_injections: dict[tuple[Injection, ...], str],
        experiment_count_by_label: Mapping[str, int] | None,
    ) -> Group:
        faults = {fault.id: fault for fault, _ in members}
        shapes = patch_shapes.shapes_of_patches(
            (fault.id, label, patch_by_injections[fault.injections]) for fault in faults.values()
        )
        fault, _ = members[0]
        injections = tuple(dict.fromkeys(i for f in faults.values() for i in f.injections))
        models = tuple(dict.fromkeys(injection.model for injection in injections))
        operator = operator_name_of(fault)
        values: ValueRanges = {}
        if operator:
            material = self._basis_of_operator(fault, operator)
        else:
            representatives = [faults[shape.member_ids[0]] for shape in shapes]
            material = self._basis_of_mutants(
                representatives,
                [patch_by_injections[representative.injections] for representative in representatives],
            )
            values = value_ranges_of(faults.values(), self.specs, self.models)
        return Group(
            id=self._group_id(label),
            label=label,
            injection_labels=(label,)
            if operator
            else tuple(map(patch_shapes.injection_label, fault.injections)),
            files=tuple(dict.fromkeys(i.location.path for i in injections)),
            functions=tuple(dict.fromkeys(i.location.function for i in injections)),
            models=models,
            trigger_kinds=" or ".join(sorted({patch_shapes.trigger_kind(trigger) for _, trigger in members})),
            hold_kinds=" or ".join(
                sorted({patch_shapes.effective_hold(*member).value for member in members})
            ),
            shapes=tuple(
                s.with_named_holes(patch_shapes.parameter_values(faults[m]) for m in s.member_ids)
                for s in shapes
            ),
            faults=tuple(faults.values()),
            triggers=tuple(dict.fromkeys(trigger for _, trigger in members)),
            experiment_count=None
            if experiment_count_by_label is None
            else experiment_count_by_label.get(label, 0),
            basis_digests=material.digests,
            value_ranges=values,
            unit_by_parameter={}
            if operator
            else units_of_parameters(faults.values(), self.specs, self.models),
            about_by_variant=self._about_by_variant(faults.values()),
            reviewed_text=render_reviewed_text(material.digests, values, material.sections),
            source_files=self._source_files(faults.values(), models),
            fault_descriptions=descriptions_of_faults(faults.values(), self.specs.values(), self.models),
        )

    def _about_by_variant(self, faults: Iterable[Fault]) -> dict[str, str]:
        names = dict.fromkeys(fault.spec for fault in faults)
        variants = {name: variant for name in names if (variant := find_variant(name, self.specs))}
        return {name: " ".join(variant.about.split()) for name, (_, variant) in variants.items()}

    def _source_files(self, faults: Iterable[Fault], models: Iterable[str]) -> tuple[Path, ...]:
        names = dict.fromkeys(fault.spec.rpartition("/")[0] for fault in faults)
        specs = [self.specs[name].path for name in names if name in self.specs]
        fault_models = map(self.models.get, models)
        return (
            *specs,
            *(path for model in fault_models for path in (model.template_path, model.source.path)),
        )

    def _basis_of_mutants(self, faults: Sequence[Fault], patches: Sequence[str]) -> BasisTexts:
        """Return the texts that a decision about mutants is bound to; `faults` has one for each shape."""
        calls: dict[str, str] = {}
        for fault in faults:
            mutant = build(self.manifest, self.models, fault, always_trigger())
            paths = dict.fromkeys(i.location.path for i in fault.injections)
            for path in (path for path in paths if path in mutant.files):
                calls |= self._called_code.called_by_injected_lines(path, mutant.files[path])
        injections = faults[0].injections
        return BasisTexts(
            diff=distinct_diffs(patches),
            functions=function_sources(self.manifest.tree, [i.location for i in injections]),
            templates={i.model: self.models.get(i.model).template for i in injections},
            called_code=calls,
        )

    def _basis_of_operator(self, fault: Fault, operator: str) -> BasisTexts:
        """Return the texts that determine all mutants of an operator in a function, selected or not."""
        location, tree = fault.injections[0].location, self.manifest.tree
        file, facts = parsed_file(tree, location.path), statement_facts_of(tree, location.path)
        mutations = list(mutations_of(file, facts, location.function, self.models, [operator]))
        models = {*OPERATOR_MODELS, *(mutation.model for mutation in mutations)}
        return BasisTexts(
            diff=[[mutation.source_before, mutation.source_after] for mutation in mutations],
            functions=function_sources(tree, [location]),
            templates={model.name: model.template for model in self.models if model.name in models},
            called_code=self._called_code.called_by_expressions(
                location.path, location.function, [mutation.source_after for mutation in mutations]
            ),
        )

    def _build_probe_group(self, experiment_count_by_label: Mapping[str, int] | None) -> Group:
        """Return the group of the code that every mutant has: the probe, its import, and the observing
        statement.
        """
        location = self.manifest.observation.location
        label = f"the probe, observing at {patch_shapes.location_label(location)}"
        patch = build(self.manifest, self.models, None, always_trigger()).patch
        material = BasisTexts(
            diff=distinct_diffs([patch]),
            functions=function_sources(self.manifest.tree, [location]),
            templates={probe_template_parts.CODE_TEMPLATE_FILE: self.models.probe_templates.whole_text},
            called_code={},
        )
        return Group(
            id=self._group_id(label),
            label=label,
            injection_labels=(label,),
            files=(location.path,),
            functions=(location.function,),
            models=(PROBE_MODULE_NAME,),
            trigger_kinds="",
            hold_kinds="",
            shapes=tuple(patch_shapes.shapes_of_patches([("", label, patch)])),
            faults=(),
            triggers=(),
            experiment_count=None
            if experiment_count_by_label is None
            else sum(experiment_count_by_label.values()),
            basis_digests=material.digests,
            reviewed_text=render_reviewed_text(material.digests, {}, material.sections),
            source_files=(
                *(self.models.folder / name for name in probe_template_parts.PROBE_TEMPLATE_FILES),
                self.manifest.path,
            ),
        )

    def _group_id(self, label: str) -> str:
        return content_id([self.manifest.name, label])[:12]
