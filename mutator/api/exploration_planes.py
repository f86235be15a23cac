"""The planes that an exploration is asked for."""

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase

from mutator._common.argument_checks import check_number, check_whole_number
from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.api.scenario_choice import ScenarioLike, concrete_scenario_of
from mutator.api.target_and_fault_selection import SelectedTarget, TriggerLike, context_or_parsed_trigger
from mutator.campaigns.exploration_section import CHALLENGER_KINDS, MOST_SEEDS, ExploredPlane
from mutator.config.units import UNITS
from mutator.errors import MutatorError
from mutator.explore.challengers import challenger_names
from mutator.explore.lattice import durations_between
from mutator.explore.plane_building import can_be_challenged, has_random_numbers, magnitudes_by_sign
from mutator.families.family import argument_of
from mutator.faults.fault_specs import Variant
from mutator.limits import MOST_LIMIT_OR_TIME


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
    reading: str = "",
    seeds: int = 1,
    challengers: Sequence[str] = (),
) -> Iterator[ExploredPlane]:
    """Yield a plane for each variant that the names choose, sign of its values, scenario and start.

    `seeds` is for faults that have random numbers, `challengers` (kinds) for those that can be challenged.
    MutatorError for a name, scenario or start that does not exist.
    """
    check_whole_number("points", min(magnitude_count, duration_count), least=1)
    check_whole_number("seed", seed)
    _check_seeds_and_challengers(seeds, challengers)
    workspace, manifest = selected_target.workspace, selected_target.manifest
    check_number("longest_s", longest_s, least=manifest.step_s)
    check_number("longest_s", -longest_s, least=-MOST_LIMIT_OR_TIME)
    durations = durations_between(manifest.step_s, longest_s, duration_count, manifest.step_s)
    start_texts = list(dict.fromkeys(map(_start_text, starts)))
    scenarios = list(dict.fromkeys(scenarios))
    triggers = [
        context_or_parsed_trigger(workspace, start, manifest.armed_after_s, manifest.observation.variables)
        for start in start_texts
    ]
    for spec, variant in _chosen_variants(selected_target, names):
        unit = UNITS[variant.draw.unit].symbol if variant.draw and variant.draw.unit else ""
        has_seeds = has_random_numbers(variant, reading, selected_target.models)
        is_challenged = can_be_challenged(variant, reading)
        for magnitudes in _magnitudes(spec, variant, magnitude_count):
            for scenario in scenarios:
                concrete = concrete_scenario_of(workspace, scenario)
                for start, trigger in zip(start_texts, triggers, strict=True):
                    yield ExploredPlane(
                        spec=f"{spec}/{variant.name}",
                        scenario=argument_of(concrete) if concrete else str(scenario),
                        start=start,
                        condition=trigger.condition,
                        armed_after_s=trigger.armed_after_s,
                        magnitudes=magnitudes,
                        unit=unit,
                        durations_s=list(durations),
                        seed=seed,
                        seeds=seeds if has_seeds else 1,
                        challengers=tuple(challenger_names(challengers, seeds)) if is_challenged else (),
                    )


def _check_seeds_and_challengers(seeds: int, challengers: Sequence[str]) -> None:
    check_whole_number("seeds", seeds, least=1)
    if seeds > MOST_SEEDS:
        raise MutatorError(f"{seeds}", argument="seeds", expected=f"at most {MOST_SEEDS}")
    for kind in challengers:
        if kind not in CHALLENGER_KINDS:
            expected = describe_choices(CHALLENGER_KINDS)
            raise MutatorError(repr(kind), argument="challengers", expected=expected)


def _magnitudes(spec: str, variant: Variant, count: int) -> list[list[float]]:
    try:
        return list(magnitudes_by_sign(variant, count))
    except ValueError as error:
        raise MutatorError(
            f"{spec}/{variant.name}: {error}",
            argument="specs",
            expected="values that are sizes of an error, from small to large",
            remedy="choose other faults, or run its values with a campaign",
        ) from None


def _start_text(start: TriggerLike) -> str:
    """Return a time as `1`, not `1.0`, or a context's name; MutatorError for a time before the drive."""
    try:
        time_s = float(str(start))
    except ValueError:
        return str(start)
    if not 0 <= time_s <= MOST_LIMIT_OR_TIME:
        raise MutatorError(f"{start}", argument="starts", expected="times in s from 0 on, or contexts")
    return f"{time_s:.9g}"


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
