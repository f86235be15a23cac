"""The planes that an exploration is asked for."""

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase

from mutator._common.argument_checks import check_number, check_whole_number
from mutator._common.message_text import spelling_suggestion
from mutator.api.scenario_choice import ScenarioLike, concrete_scenario_of
from mutator.api.target_and_fault_selection import SelectedTarget, TriggerLike, context_or_parsed_trigger
from mutator.campaigns.exploration_section import ExploredPlane
from mutator.config.units import UNITS
from mutator.errors import MutatorError
from mutator.explore.lattice import durations_between
from mutator.explore.plane_building import magnitudes_by_sign
from mutator.families.family import argument_of
from mutator.faults.fault_specs import Variant


def chosen_planes(
    selected_target: SelectedTarget,
    names: Sequence[str],
    scenarios: Sequence[ScenarioLike],
    starts: Sequence[TriggerLike],
    *,
    magnitude_count: int,
    duration_count: int,
    longest_s: float,
    seed: int,
) -> Iterator[ExploredPlane]:
    """Yield a plane for each variant that the names choose, sign of its values, scenario and start.

    MutatorError for a name, scenario or start that does not exist.
    """
    check_whole_number("points", min(magnitude_count, duration_count), least=1)
    check_whole_number("seed", seed)
    check_number("longest_s", longest_s, least=0.0)
    workspace, manifest = selected_target.workspace, selected_target.manifest
    durations = durations_between(manifest.step_s, longest_s, duration_count, manifest.step_s)
    triggers = [
        context_or_parsed_trigger(
            workspace, str(start), manifest.armed_after_s, manifest.observation.variables
        )
        for start in starts
    ]
    for spec, variant in _chosen_variants(selected_target, names):
        unit = UNITS[variant.draw.unit].symbol if variant.draw and variant.draw.unit else ""
        for magnitudes in magnitudes_by_sign(variant, magnitude_count):
            for scenario in scenarios:
                concrete = concrete_scenario_of(workspace, scenario)
                for start, trigger in zip(starts, triggers, strict=True):
                    yield ExploredPlane(
                        spec=f"{spec}/{variant.name}",
                        scenario=argument_of(concrete) if concrete else str(scenario),
                        start=str(start),
                        condition=trigger.condition,
                        armed_after_s=trigger.armed_after_s,
                        magnitudes=magnitudes,
                        unit=unit,
                        durations_s=list(durations),
                        seed=seed,
                    )


def _chosen_variants(selected_target: SelectedTarget, names: Sequence[str]) -> Iterator[tuple[str, Variant]]:
    """Yield the variants that the names choose, each with its spec's name, in the library's order."""
    specs = selected_target.workspace.specs()
    variants = [(spec.name, variant) for spec in specs for variant in spec]
    full_names = [f"{spec}/{variant.name}" for spec, variant in variants]
    for name in names:
        if not any(_is_chosen(full_name, name) for full_name in full_names):
            raise MutatorError(
                f"no fault '{name}'",
                argument="specs",
                expected="a spec or a variant of the library, such as " + full_names[0],
                remedy="`mutator list faults` lists them" + spelling_suggestion(name, full_names),
            )
    for (spec, variant), full_name in zip(variants, full_names, strict=True):
        if any(_is_chosen(full_name, name) for name in names):
            yield spec, variant


def _is_chosen(full_name: str, name: str) -> bool:
    return fnmatchcase(full_name, name) or full_name.startswith(f"{name}/")
