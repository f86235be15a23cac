"""Check that the hazard analysis is complete and consistent, and that the fault library matches it."""

import ast
from collections.abc import Iterator
from fnmatch import fnmatchcase

from mutator._common.message_text import spelling_suggestion
from mutator.config.yaml_source_lines import KeyPath
from mutator.errors import MutatorError
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.message_places import location_of
from mutator.stpa.context_tables import ContextRow
from mutator.stpa.hazard_analysis_yaml import (
    CausalFactorModel,
    HazardAnalysis,
    UnsafeActionModel,
    UnsafeCategory,
)
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import names_in

SpecsByName = dict[str, FaultSpec]


def list_analysis_problems(
    analysis: HazardAnalysis, specs: tuple[FaultSpec, ...], manifest: TargetManifest
) -> list[MutatorError]:
    """List every gap and contradiction, in the order of the files.

    * Each hazard has an unsafe action that causes it; unsafe actions and context tables agree.
    * Each action is judged in all four categories; each unsafe action has a causal factor.
    * Each factor's faults are injected at the factor's places and aim at hazards that the factor leads to;
      each spec belongs to a factor.
    """
    specs_by_name = {spec.name: spec for spec in specs}
    return [
        *_unreached_hazards(analysis),
        *_unrecorded_actions(analysis, manifest),
        *_unknown_variables(analysis, manifest),
        *_unmodelled_variables(analysis),
        *_missing_categories(analysis),
        *_contradicted_contexts(analysis),
        *_unmatched_hazards(analysis),
        *_actions_without_factor(analysis),
        *_missing_files_and_places(analysis, manifest),
        *_unknown_faults_of_components(analysis, specs),
        *_factor_problems(analysis, specs_by_name, manifest),
        *_specs_without_factor(analysis, specs),
    ]


def _unreached_hazards(analysis: HazardAnalysis) -> Iterator[MutatorError]:
    reached = {hazard for action in analysis.unsafe_actions.values() for hazard in action.hazards}
    source = analysis.hazards.source
    for hazard in analysis.hazards.hazards:
        if hazard not in reached:
            yield source.error(
                ("hazards", hazard),
                f"hazard '{hazard}' follows from no unsafe control action",
                remedy=f"name it in {analysis.unsafe_actions_source.path.name}, or delete it",
            )
    led_to = {accident for names in analysis.hazards.accidents_by_hazard.values() for accident in names}
    for accident in analysis.hazards.accidents:
        if accident not in led_to:
            yield source.error(("accidents", accident), f"accident '{accident}' follows from no hazard")


def _unrecorded_actions(analysis: HazardAnalysis, manifest: TargetManifest) -> Iterator[MutatorError]:
    channels = [channel.name for channel in manifest.compared_channels]
    for name, action in analysis.structure.control_actions.items():
        if action.channel not in channels:
            yield analysis.structure_source.error(
                ("control_actions", name, "channel"),
                f"channel '{action.channel}'",
                expected=f"one that the target compares: {', '.join(channels)}",
            )
    components = analysis.structure.components
    for channel in manifest.channels:
        if channel.component and channel.component not in components:
            yield manifest.source.error(
                ("channels", channel.name, "component"),
                f"component '{channel.component}'",
                expected=f"a component of the control structure: {', '.join(components)}",
                remedy="correct the name" + spelling_suggestion(channel.component, list(components)),
            )


def _unknown_variables(analysis: HazardAnalysis, manifest: TargetManifest) -> Iterator[MutatorError]:
    observed = manifest.observation.variables
    for name, component in analysis.structure.components.items():
        for variable, model in component.process_model.items():
            if model.observed is not None and model.observed not in observed:
                yield analysis.structure_source.error(
                    ("components", name, "process_model", variable, "observed"),
                    f"variable '{model.observed}'",
                    expected=f"one of the values observed in the target: {', '.join(observed)}",
                    remedy="correct the name" + spelling_suggestion(model.observed, list(observed)),
                )


def _unmodelled_variables(analysis: HazardAnalysis) -> Iterator[MutatorError]:
    models = [component.process_model for component in analysis.structure.components.values()]
    observed = {variable.observed for model in models for variable in model.values()}
    for table in analysis.context_tables.values():
        for row in table.rows:
            for name in sorted(set(names_in(row.condition)) - observed):
                yield table.source.error(
                    ("contexts", row.id, "when"),
                    f"context '{row.id}' uses '{name}', which is in no process model",
                    remedy=f"add it to a component of {analysis.structure_source.path.name}",
                )


def _missing_categories(analysis: HazardAnalysis) -> Iterator[MutatorError]:
    for name in analysis.structure.control_actions:
        judged = {action.category for action in analysis.unsafe_actions.values() if action.action == name}
        for category in UnsafeCategory:
            if category not in judged:
                yield analysis.structure_source.error(
                    ("control_actions", name),
                    f"no unsafe control action for '{name}' in category {category}",
                    expected="one in each of the four categories",
                    remedy=f"add it to {analysis.unsafe_actions_source.path.name}",
                )


def _contradicted_contexts(analysis: HazardAnalysis) -> Iterator[MutatorError]:
    for name, action in analysis.unsafe_actions.items():
        for i, context in enumerate(action.contexts):
            row = _context_row(analysis, context)
            for hazard in action.hazards:
                if hazard not in _hazards_of_action(row, action):
                    table = analysis.context_tables[context.partition("/")[0]]
                    yield analysis.unsafe_actions_source.error(
                        ("unsafe_control_actions", name, "contexts", i),
                        f"{name} ({action.action} {action.category}) leads to {hazard} in {context}",
                        expected=f"what {table.path.name} says there: "
                        f"{', '.join(sorted(_hazards_of_action(row, action))) or 'no hazard'}",
                        remedy="correct the unsafe control action or the table",
                    )


def _unmatched_hazards(analysis: HazardAnalysis) -> Iterator[MutatorError]:
    """Yield hazardous cells of the context tables that no unsafe action matches."""
    matched = {
        (context, action.action, action.category, hazard)
        for action in analysis.unsafe_actions.values()
        for context in action.contexts
        for hazard in action.hazards
    }
    for table in analysis.context_tables.values():
        for row in table.rows:
            for action, verdicts in row.hazards_by_action.items():
                for category in (UnsafeCategory.PROVIDED, UnsafeCategory.NOT_PROVIDED):
                    hazard = getattr(verdicts, category.value)
                    if hazard and (f"{table.name}/{row.id}", action, category, hazard) not in matched:
                        yield table.source.error(
                            ("contexts", row.id, "actions", action, category.value),
                            f"{hazard} of '{action}' ({category}) in context '{row.id}' matches no unsafe "
                            "control action",
                            remedy=f"add one to {analysis.unsafe_actions_source.path.name}, or write null "
                            "here",
                        )


def _context_row(analysis: HazardAnalysis, context: str) -> ContextRow:
    table, _, row = context.partition("/")
    return next(r for r in analysis.context_tables[table].rows if r.id == row)


def _hazards_of_action(row: ContextRow, action: UnsafeActionModel) -> set[str]:
    """Return the hazards that a row names for the category of `action`; for wrong timing or duration, those
    of both columns.
    """
    verdicts = row.hazards_by_action.get(action.action)
    if verdicts is None:
        return set()
    cells = {
        UnsafeCategory.PROVIDED: (verdicts.provided,),
        UnsafeCategory.NOT_PROVIDED: (verdicts.not_provided,),
    }
    return {
        hazard
        for hazard in cells.get(action.category, (verdicts.provided, verdicts.not_provided))
        if hazard is not None
    }


def _actions_without_factor(analysis: HazardAnalysis) -> Iterator[MutatorError]:
    caused = {action for factor in analysis.factors_by_id.values() for action in factor.leads_to}
    for name in analysis.unsafe_actions:
        if name not in caused:
            yield analysis.unsafe_actions_source.error(
                ("unsafe_control_actions", name),
                f"no causal factor leads to {name}",
                remedy=f"add one to {analysis.factors_source.path.name}",
            )


def _missing_files_and_places(analysis: HazardAnalysis, manifest: TargetManifest) -> Iterator[MutatorError]:
    files = manifest.tree.files
    for name, component in analysis.structure.components.items():
        for i, path in enumerate(component.modules):
            if path not in files:
                yield analysis.structure_source.error(
                    ("components", name, "modules", i),
                    f"no file '{path}' in target {manifest.name}",
                    remedy="correct the path" + spelling_suggestion(path, list(files)),
                )
    for name, factor in analysis.factors_by_id.items():
        for i, place in enumerate(factor.at):
            path, _, function = place.partition("::")
            function_names = (
                sorted(top_level_functions(files[path])) if path in files and path.endswith(".py") else []
            )
            if function not in function_names:
                yield analysis.factors_source.error(
                    ("causal_factors", name, "at", i),
                    f"no place '{place}' in target {manifest.name}",
                    expected="file::Class.function",
                    remedy="correct the place" + spelling_suggestion(function, function_names),
                )


def top_level_functions(code: bytes) -> Iterator[str]:
    for node in ast.parse(code).body:
        if isinstance(node, ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.ClassDef):
            yield from (f"{node.name}.{item.name}" for item in node.body if isinstance(item, ast.FunctionDef))


def _unknown_faults_of_components(
    analysis: HazardAnalysis, specs: tuple[FaultSpec, ...]
) -> Iterator[MutatorError]:
    fault_names = [
        name for spec in specs for name in (spec.name, *(f"{spec.name}/{variant.name}" for variant in spec))
    ]
    for component_name, component in analysis.structure.components.items():
        for i, pattern in enumerate(component.faults):
            if not any(fnmatchcase(name, pattern) for name in fault_names):
                yield analysis.structure_source.error(
                    ("components", component_name, "faults", i),
                    f"no fault '{pattern}'",
                    expected="a fault spec or a variant of the library",
                    remedy="correct the name" + spelling_suggestion(pattern, fault_names),
                )


def _factor_problems(
    analysis: HazardAnalysis, specs: SpecsByName, manifest: TargetManifest
) -> Iterator[MutatorError]:
    for name, factor in analysis.factors_by_id.items():
        keys: KeyPath = ("causal_factors", name)
        all_exist = True
        for i, fault in enumerate(factor.faults):
            if fault not in specs:
                all_exist = False
                yield analysis.factors_source.error(
                    (*keys, "faults", i),
                    f"fault spec '{fault}'",
                    expected="a spec of the library",
                    remedy="correct the name" + spelling_suggestion(fault, list(specs)),
                )
        if all_exist and factor.faults:
            yield from _factor_place_problems(analysis, keys, factor, specs, manifest)
            yield from _factor_aim_problems(analysis, keys, factor, specs)


def _factor_place_problems(
    analysis: HazardAnalysis,
    keys: KeyPath,
    factor: CausalFactorModel,
    specs: SpecsByName,
    manifest: TargetManifest,
) -> Iterator[MutatorError]:
    actual = {place for fault in factor.faults for place in injection_places(specs[fault], manifest)}
    if actual != set(factor.at):
        yield analysis.factors_source.error(
            (*keys, "at"),
            f"{keys[1]} at {', '.join(factor.at) or 'no place'}",
            expected=f"the places where its faults are injected: {', '.join(sorted(actual))}",
            remedy="correct the places or the faults",
        )


def _factor_aim_problems(
    analysis: HazardAnalysis, keys: KeyPath, factor: CausalFactorModel, specs: SpecsByName
) -> Iterator[MutatorError]:
    hazards = {hazard for action in factor.leads_to for hazard in analysis.unsafe_actions[action].hazards}
    for i, fault in enumerate(factor.faults):
        for variant in specs[fault]:
            if variant.aimed_hazard and variant.aimed_hazard not in hazards:
                yield analysis.factors_source.error(
                    (*keys, "faults", i),
                    f"{fault}/{variant.name} aims at {variant.aimed_hazard}",
                    expected=f"a hazard that {keys[1]} leads to: {', '.join(sorted(hazards))}",
                    remedy="correct `leads_to` or the spec's `aim`",
                )


def injection_places(spec: FaultSpec, manifest: TargetManifest) -> set[str]:
    """Return the places at which a spec injects in any reading, as `file::function`.

    A function inside another one counts as the outer one.
    """
    return {
        f"{location.path}::{location.function.partition('.<locals>')[0]}"
        for variant in spec
        for injections in variant.injections_by_reading.values()
        for injection in injections
        for location in [location_of(injection, manifest, spec.source)]
    }


def _specs_without_factor(analysis: HazardAnalysis, specs: tuple[FaultSpec, ...]) -> Iterator[MutatorError]:
    reached = {fault for factor in analysis.factors_by_id.values() for fault in factor.faults}
    path = analysis.factors_source.path
    for spec in specs:
        if spec.name not in reached:
            yield spec.source.error(
                (),
                f"fault spec '{spec.name}' belongs to no causal factor",
                remedy=f"name it in {path.parent.name}/{path.name}",
            )
