"""Check that the hazard analysis is complete and consistent, and that the fault library matches it."""

import ast
from collections.abc import Iterator

from mutator._common.message_text import suggestion
from mutator.config.yaml_sources import KeyPath
from mutator.errors import MutatorError
from mutator.faults.fault_specs import FaultSpec
from mutator.stpa.analysis_files import Analysis, Category, FactorModel, UnsafeActionModel
from mutator.stpa.context_tables import ContextRow
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import names_in

Specs = dict[str, FaultSpec]


def check_analysis(
    analysis: Analysis, specs: tuple[FaultSpec, ...], manifest: TargetManifest
) -> list[MutatorError]:
    """List every gap and contradiction, in the order of the files.

    * Each hazard has an unsafe action that causes it; unsafe actions and context tables agree.
    * Each action is judged in all four categories; each unsafe action has a causal factor.
    * Each factor's faults are injected at the factor's places and aim at hazards that the factor leads to;
      each spec belongs to a factor.
    """
    by_name = {spec.name: spec for spec in specs}
    return [
        *_hazards(analysis),
        *_unobserved(analysis, manifest),
        *_unknown_variables(analysis, manifest),
        *_unmodelled(analysis),
        *_categories(analysis),
        *_contradictions(analysis),
        *_unjudged(analysis),
        *_causeless(analysis),
        *_places(analysis, manifest),
        *_faults(analysis, by_name),
        *_unreached(analysis, specs),
    ]


def _hazards(analysis: Analysis) -> Iterator[MutatorError]:
    reached = {hazard for action in analysis.unsafe.values() for hazard in action.hazards}
    source = analysis.hazards.source
    for hazard in analysis.hazards.hazards:
        if hazard not in reached:
            yield source.error(
                ("hazards", hazard),
                f"hazard '{hazard}' follows from no unsafe control action",
                remedy=f"name it in {analysis.unsafe_source.path.name}, or delete it",
            )
    led_to = {accident for names in analysis.hazards.leads_to.values() for accident in names}
    for accident in analysis.hazards.accidents:
        if accident not in led_to:
            yield source.error(("accidents", accident), f"accident '{accident}' follows from no hazard")


def _unobserved(analysis: Analysis, manifest: TargetManifest) -> Iterator[MutatorError]:
    channels = [channel.name for channel in manifest.compared]
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
                remedy="correct the name" + suggestion(channel.component, list(components)),
            )


def _unknown_variables(analysis: Analysis, manifest: TargetManifest) -> Iterator[MutatorError]:
    known = manifest.observation.variables
    for name, component in analysis.structure.components.items():
        for variable, model in component.process_model.items():
            if model.observed is not None and model.observed not in known:
                yield analysis.structure_source.error(
                    ("components", name, "process_model", variable, "observed"),
                    f"variable '{model.observed}'",
                    expected=f"one of the values observed in the target: {', '.join(known)}",
                    remedy="correct the name" + suggestion(model.observed, list(known)),
                )


def _unmodelled(analysis: Analysis) -> Iterator[MutatorError]:
    models = [component.process_model for component in analysis.structure.components.values()]
    observed = {variable.observed for model in models for variable in model.values()}
    for table in analysis.tables.values():
        for row in table.rows:
            for name in sorted(set(names_in(row.condition)) - observed):
                yield table.source.error(
                    ("contexts", row.id, "when"),
                    f"context '{row.id}' uses '{name}', which is in no process model",
                    remedy=f"add it to a component of {analysis.structure_source.path.name}",
                )


def _categories(analysis: Analysis) -> Iterator[MutatorError]:
    for name in analysis.structure.control_actions:
        judged = {action.category for action in analysis.unsafe.values() if action.action == name}
        for category in Category:
            if category not in judged:
                yield analysis.structure_source.error(
                    ("control_actions", name),
                    f"no unsafe control action for '{name}' in category {category}",
                    expected="one in each of the four categories",
                    remedy=f"add it to {analysis.unsafe_source.path.name}",
                )


def _contradictions(analysis: Analysis) -> Iterator[MutatorError]:
    for name, action in analysis.unsafe.items():
        for i, context in enumerate(action.contexts):
            row = _row(analysis, context)
            for hazard in action.hazards:
                if hazard not in _judged(row, action):
                    table = analysis.tables[context.partition("/")[0]]
                    yield analysis.unsafe_source.error(
                        ("unsafe_control_actions", name, "contexts", i),
                        f"{name} ({action.action} {action.category}) leads to {hazard} in {context}",
                        expected=f"what {table.path.name} says there: "
                        f"{', '.join(sorted(_judged(row, action))) or 'no hazard'}",
                        remedy="correct the unsafe control action or the table",
                    )


def _unjudged(analysis: Analysis) -> Iterator[MutatorError]:
    """Yield hazardous cells of the context tables that no unsafe action matches."""
    known = {
        (context, action.action, action.category, hazard)
        for action in analysis.unsafe.values()
        for context in action.contexts
        for hazard in action.hazards
    }
    for table in analysis.tables.values():
        for row in table.rows:
            for action, verdicts in row.actions.items():
                for category in (Category.PROVIDED, Category.NOT_PROVIDED):
                    hazard = getattr(verdicts, category.value)
                    if hazard and (f"{table.name}/{row.id}", action, category, hazard) not in known:
                        yield table.source.error(
                            ("contexts", row.id, "actions", action, category.value),
                            f"{hazard} of '{action}' ({category}) in context '{row.id}' matches no unsafe "
                            "control action",
                            remedy=f"add one to {analysis.unsafe_source.path.name}, or write null here",
                        )


def _row(analysis: Analysis, context: str) -> ContextRow:
    table, _, row = context.partition("/")
    return next(r for r in analysis.tables[table].rows if r.id == row)


def _judged(row: ContextRow, action: UnsafeActionModel) -> set[str]:
    """Return the hazards that a row names for the category of `action`; for wrong timing or duration, those
    of both columns.
    """
    verdicts = row.actions.get(action.action)
    if verdicts is None:
        return set()
    cells = {Category.PROVIDED: (verdicts.provided,), Category.NOT_PROVIDED: (verdicts.not_provided,)}
    return {
        hazard
        for hazard in cells.get(action.category, (verdicts.provided, verdicts.not_provided))
        if hazard is not None
    }


def _causeless(analysis: Analysis) -> Iterator[MutatorError]:
    caused = {action for factor in analysis.factors.values() for action in factor.leads_to}
    for name in analysis.unsafe:
        if name not in caused:
            yield analysis.unsafe_source.error(
                ("unsafe_control_actions", name),
                f"no causal factor leads to {name}",
                remedy=f"add one to {analysis.factors_source.path.name}",
            )


def _places(analysis: Analysis, manifest: TargetManifest) -> Iterator[MutatorError]:
    files = manifest.tree.files
    for name, component in analysis.structure.components.items():
        for i, path in enumerate(component.modules):
            if path not in files:
                yield analysis.structure_source.error(
                    ("components", name, "modules", i),
                    f"no file '{path}' in target {manifest.name}",
                    remedy="correct the path" + suggestion(path, list(files)),
                )
    for name, factor in analysis.factors.items():
        for i, place in enumerate(factor.at):
            path, _, function = place.partition("::")
            known = sorted(functions(files[path])) if path in files and path.endswith(".py") else []
            if function not in known:
                yield analysis.factors_source.error(
                    ("causal_factors", name, "at", i),
                    f"no place '{place}' in target {manifest.name}",
                    expected="file::Class.function",
                    remedy="correct the place" + suggestion(function, known),
                )


def functions(code: bytes) -> Iterator[str]:
    for node in ast.parse(code).body:
        if isinstance(node, ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.ClassDef):
            yield from (f"{node.name}.{item.name}" for item in node.body if isinstance(item, ast.FunctionDef))


def _faults(analysis: Analysis, specs: Specs) -> Iterator[MutatorError]:
    for name, factor in analysis.factors.items():
        keys: KeyPath = ("causal_factors", name)
        known = True
        for i, fault in enumerate(factor.faults):
            if fault not in specs:
                known = False
                yield analysis.factors_source.error(
                    (*keys, "faults", i),
                    f"fault spec '{fault}'",
                    expected="a spec of the library",
                    remedy="correct the name" + suggestion(fault, list(specs)),
                )
        if known and factor.faults:
            yield from _misplaced(analysis, keys, factor, specs)
            yield from _misdirected(analysis, keys, factor, specs)


def _misplaced(
    analysis: Analysis, keys: KeyPath, factor: FactorModel, specs: Specs
) -> Iterator[MutatorError]:
    actual = {place for fault in factor.faults for place in injected(specs[fault])}
    if actual != set(factor.at):
        yield analysis.factors_source.error(
            (*keys, "at"),
            f"{keys[1]} at {', '.join(factor.at) or 'no place'}",
            expected=f"the places where its faults are injected: {', '.join(sorted(actual))}",
            remedy="correct the places or the faults",
        )


def _misdirected(
    analysis: Analysis, keys: KeyPath, factor: FactorModel, specs: Specs
) -> Iterator[MutatorError]:
    hazards = {hazard for action in factor.leads_to for hazard in analysis.unsafe[action].hazards}
    for i, fault in enumerate(factor.faults):
        for variant in specs[fault]:
            if variant.aim not in hazards:
                yield analysis.factors_source.error(
                    (*keys, "faults", i),
                    f"{fault}/{variant.name} aims at {variant.aim}",
                    expected=f"a hazard that {keys[1]} leads to: {', '.join(sorted(hazards))}",
                    remedy="correct `leads_to` or the spec's `aim`",
                )


def injected(spec: FaultSpec) -> set[str]:
    """Return the places at which a spec injects in any reading, as `file::function`."""
    return {
        f"{injection.location.path}::{injection.location.function}"
        for variant in spec
        for injections in variant.readings.values()
        for injection in injections
    }


def _unreached(analysis: Analysis, specs: tuple[FaultSpec, ...]) -> Iterator[MutatorError]:
    reached = {fault for factor in analysis.factors.values() for fault in factor.faults}
    path = analysis.factors_source.path
    for spec in specs:
        if spec.name not in reached:
            yield spec.source.error(
                (),
                f"fault spec '{spec.name}' belongs to no causal factor",
                remedy=f"name it in {path.parent.name}/{path.name}",
            )
