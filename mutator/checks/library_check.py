"""Check that everything in the library is usable, for `mutator check`."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

from mutator.campaigns.campaign_files import Campaign, check_readings, load_campaign, load_campaign_study
from mutator.campaigns.campaign_triggers import build_listed_triggers
from mutator.campaigns.installed_studies import study_problems
from mutator.config.yaml_source_lines import KeyPath
from mutator.defences.defence_yaml import check_file_names
from mutator.defences.parameter_checks import check_parameters
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, FaultModelExample, FaultModels
from mutator.faults.fault_specs import FaultSpec, Variant
from mutator.faults.injection_parameters import resolve_injection
from mutator.faults.library_readings import SpecReadings
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault
from mutator.mutants.injection_edits import edits_of, injection_edit
from mutator.mutants.mutant_building import build
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, unsplice
from mutator.onboarding.todo_marks import unfilled_mark_errors
from mutator.stpa.context_tables import ContextTable
from mutator.stpa.hazard_analysis_checks import list_analysis_problems
from mutator.targets.manifest import TargetManifest
from mutator.targets.required_packages import check_requirements
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

EXAMPLE_TAG = "example"
Result = TypeVar("Result")


def library_problems(workspace: Workspace, target: str) -> list[MutatorError]:
    """Every problem of the library, templates and target, in file order.

    * All placeholders must be filled in.
    * Manifests, models, specs, hazards and context tables must load.
    * The models' examples must hold.
    * Every spec must expand in every reading, and every anchor must match the target exactly once.
    * In every reading, one mutant of each variant must compile and un-splice.
    * Campaigns must load, and their studies must find valid data.
    * Defences must load with their models, and fit the targets of the campaigns that name them.
    * A hazard analysis, if any, must have no gap.
    """
    collector = _ProblemCollector()
    collector.problems += unfilled_mark_errors(workspace.library)
    manifest = collector.result_of(lambda: workspace.manifest(target))
    if manifest:
        collector.result_of(lambda: check_requirements(manifest))
        collector.result_of(lambda: workspace.scale_of(manifest))
    models = collector.result_of(workspace.fault_models)
    hazards = collector.result_of(workspace.hazards)
    tables = [
        collector.result_of(partial(workspace.context_table, name)) for name in workspace.context_tables
    ]
    readings = collector.result_of(workspace.readings)
    spec_files = workspace.spec_files() if readings else ()
    specs = [collector.result_of(partial(workspace.spec, path)) for path in spec_files]
    if models:
        collector.problems += example_problems(models)
    if manifest and hazards:
        collector.problems += _unknown_hazard_problems(
            manifest, tuple(hazards.hazards), [t for t in tables if t]
        )
    if manifest and models and collector.result_of(lambda: build(manifest, models, None, always_trigger())):
        for spec in specs:
            collector.problems += spec_problems(spec, models, manifest) if spec else ()
    for name in workspace.families:
        collector.result_of(partial(workspace.family, name))
    if readings:
        collector.problems += campaign_problems(workspace, readings, manifest)
    collector.problems += defence_problems(workspace, manifest)
    # the analysis compares specs with context tables, so it needs all of them to be valid
    if not collector.problems:
        specs_in_order = collector.result_of(workspace.specs)
        analysis = collector.result_of(workspace.analysis)
        if analysis and specs_in_order and manifest:
            collector.problems += list_analysis_problems(analysis, specs_in_order, manifest)
    return collector.problems


def campaign_problems(
    workspace: Workspace, readings: SpecReadings, manifest: TargetManifest | None = None
) -> list[MutatorError]:
    """Problems of the library's campaigns, and those that their studies find in the library's data.

    With a `manifest`, triggers that use values which this target does not observe are problems too.
    """
    collector, checked_studies = _ProblemCollector(), set[str]()
    for name in workspace.campaigns:
        campaign = collector.result_of(partial(load_campaign, workspace.campaign(name)))
        if campaign is None:
            continue
        collector.result_of(partial(check_readings, campaign, readings))
        if manifest and manifest.name == campaign.target:
            collector.result_of(partial(_check_listed_triggers, campaign, manifest))
        study = collector.result_of(partial(load_campaign_study, campaign))
        if study and campaign.study and campaign.study not in checked_studies:
            checked_studies.add(campaign.study)
            problems = study_problems(campaign.study, study, workspace)
            collector.problems += [_problem_at_campaign(problem, campaign) for problem in problems]
    return collector.problems


def defence_problems(workspace: Workspace, manifest: TargetManifest | None = None) -> list[MutatorError]:
    """Problems of the library's defences, and of the sets that its campaigns name: each is put into the tree
    of the campaign's target, as a plan does. `manifest` is one that is loaded already.
    """
    collector = _ProblemCollector()
    collector.result_of(lambda: check_file_names(workspace.library))
    path_by_name = None if collector.problems else collector.result_of(lambda: workspace.defences)
    if path_by_name is None:
        return collector.problems
    defences = {name: collector.result_of(partial(workspace.defence, name)) for name in path_by_name}
    broken_names = {name for name, defence in defences.items() if defence is None}
    fitted_names = set[str]()
    for campaign, target in _defended_campaigns(workspace, manifest):
        fitted_names.update(*campaign.defence_sets)
        for i, names in enumerate(campaign.defence_sets):
            if broken_names.isdisjoint(names):
                collector.result_of(partial(_check_defence_set, workspace, campaign, i, target))
    for name, defence in defences.items():
        # if a campaign names it, a misspelt command is the better explanation of an unused parameter
        if defence and name not in fitted_names:
            collector.result_of(partial(check_parameters, defence))
    # several sets can have the same defence
    return list({str(problem): problem for problem in collector.problems}.values())


def _defended_campaigns(
    workspace: Workspace, manifest: TargetManifest | None
) -> Iterator[tuple[Campaign, TargetManifest]]:
    """Yield the campaigns with defences, and their targets.

    What cannot be loaded is left out, because another check has that problem. So are other targets than
    `manifest` if the workspace names the folder of one.
    """
    manifest_by_name = {manifest.name: manifest} if manifest else {}
    for path in workspace.campaigns.values():
        with suppress(MutatorError):
            campaign = load_campaign(path)
            if not campaign.defence_sets:
                continue
            name = campaign.target
            if name not in manifest_by_name and (workspace.target is None or manifest is None):
                manifest_by_name[name] = workspace.manifest(name)
            if name in manifest_by_name:
                yield campaign, manifest_by_name[name]


def _check_defence_set(workspace: Workspace, campaign: Campaign, index: int, target: TargetManifest) -> None:
    with campaign.locating_errors(("defences", index)):
        workspace.defended(target, campaign.defence_sets[index])


def _check_listed_triggers(campaign: Campaign, manifest: TargetManifest) -> None:
    build_listed_triggers(
        campaign.listed_triggers, campaign.yaml_source, manifest, armed_after_s=0.0, hold_s=None
    )


def _problem_at_campaign(problem: MutatorError, campaign: Campaign) -> MutatorError:
    """Locate a study's problem at the campaign that uses the study, unless the problem names a file."""
    if problem.where:
        return problem
    return campaign.yaml_source.error(
        ("study",), problem.got, expected=problem.expected, remedy=problem.remedy
    )


class _ProblemCollector:
    """Collects problems instead of stopping at the first."""

    def __init__(self) -> None:
        self.problems: list[MutatorError] = []

    def result_of(self, make: Callable[[], Result]) -> Result | None:
        """Return the result of `make`; None if that fails."""
        try:
            return make()
        except MutatorError as error:
            self.problems.append(error)
            return None


def spec_problems(spec: FaultSpec, models: FaultModels, manifest: TargetManifest) -> Iterator[MutatorError]:
    for reading in spec.readings.names:
        try:
            faults = expand_spec(spec, 0, reading, models=models, manifest=manifest)
        except MutatorError as error:
            yield error
            return
        for variant in spec:
            if reading in variant.injections_by_reading:
                name = f"{spec.name}/{variant.name}"
                fault = next(f for f in faults if f.spec == name)
                yield from _unbuildable_fault_problems(spec, variant, fault, models, manifest)


def _unbuildable_fault_problems(
    spec: FaultSpec, variant: Variant, fault: Fault, models: FaultModels, manifest: TargetManifest
) -> Iterator[MutatorError]:
    """Yield why a fault of a variant cannot be built, located at the injection that is the cause, if any."""
    try:
        build(manifest, models, fault, always_trigger())
    except MutatorError as error:
        keys = (*variant.keys_by_reading[fault.reading], *_keys_of_failing_injection(fault, models, manifest))
        name = f"{fault.spec} ({fault.reading})" if fault.reading else fault.spec
        got = f"{name}: {error.got}{_describe_target_place(error, manifest)}"
        remedy = error.remedy or "correct the spec or the target"
        yield spec.source.error(keys, got, expected=error.expected, remedy=remedy)


def _keys_of_failing_injection(fault: Fault, models: FaultModels, manifest: TargetManifest) -> KeyPath:
    """Return the keys of the first injection without an edit; none if all have one."""
    for count in range(1, len(fault.injections) + 1):
        try:
            edits_of(manifest, models, fault.injections[:count])
        except MutatorError:
            return ("injections", count - 1, "at")
    return ()


def _describe_target_place(error: MutatorError, manifest: TargetManifest) -> str:
    """Return the place of an error in the target, with the file named as in specs: ` (pkg/sonar.py:28)`."""
    if not error.where:
        return ""
    path = manifest.tree.path_as_in_specs(error.where)
    return f" ({path})" if error.line is None else f" ({path}:{error.line})"


def _unknown_hazard_problems(
    manifest: TargetManifest, hazard_names: tuple[str, ...], tables: list[ContextTable]
) -> Iterator[MutatorError]:
    for name in manifest.hazard_names:
        if name not in hazard_names:
            yield MutatorError(
                f"hazard '{name}'", where=manifest.path, expected=f"one of {', '.join(hazard_names)}"
            )
    for table in tables:
        for row in table.rows:
            for action, verdicts in row.hazards_by_action.items():
                for hazard in (verdicts.provided, verdicts.not_provided):
                    if hazard is not None and hazard not in hazard_names:
                        yield table.source.error(
                            ("contexts", row.id, "actions", action),
                            f"hazard '{hazard}' of {action} in {row.id}",
                            expected=f"one of {', '.join(hazard_names)}, or null",
                        )


def example_problems(models: FaultModels) -> Iterator[MutatorError]:
    for model in models:
        for example in model.examples:
            try:
                after = apply_example(model, models, example)
            except MutatorError as error:
                yield MutatorError(f"the example fails: {error}", where=model.source.path, line=example.line)
                continue
            if after != example.after:
                yield MutatorError(
                    f"the example renders\n{after}",
                    where=model.source.path,
                    line=example.line,
                    expected=f"\n{example.after}",
                    remedy="correct the template or the example",
                )


def apply_example(model: FaultModel, models: FaultModels, example: FaultModelExample) -> str:
    """Splice the example's injection into its `before`; the result must also un-splice."""
    location = example.injection.location
    if location is None:
        raise MutatorError(
            "an example at a `message`", expected="`at`", remedy="name the place in the source"
        )
    file = parse_file(location.path, example.before.encode(), Path("example"))
    injection = resolve_injection(example.injection, model, model.source)
    edit = injection_edit(file, models, injection, EXAMPLE_TAG)
    after = mutated_bytes(apply_edits(file, as_line_edits(file, [edit])))
    if unsplice(after) != file.data:
        raise MutatorError("the example does not un-splice to its `before`")
    return after.decode()
