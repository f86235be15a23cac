"""The ranges and units of a group's parameters, from its specs, independent of the seed."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from math import isfinite

from mutator.config.units import UNITS
from mutator.errors import MutatorError
from mutator.faults.draw_specs import DrawSpec
from mutator.faults.fault_models import UNIT_OF_CHANGED_VARIABLE, FaultModels
from mutator.faults.fault_specs import FaultSpec, Variant
from mutator.faults.injection_parameters import DrawnValue, resolve_injection
from mutator.faults.injection_specs import InjectionSpec
from mutator.faults.spec_expansion import drawn_values_of
from mutator.model import Fault, Injection
from mutator.review.review_entries import ValueRanges

_Value = float | str


def value_ranges_of(
    faults: Iterable[Fault], specs: Mapping[str, FaultSpec], models: FaultModels
) -> ValueRanges:
    """Return the range of each parameter of `faults`: all drawn values and all that their specs can draw.

    `specs` maps names to specs; a fault without a spec contributes only its own values. With several
    injections, names are numbered: `1.by`, `2.by`. Texts and truth values define the group, so they are not
    included.
    """
    values_by_name: dict[str, set[_Value]] = {}
    handled_specs: set[tuple[str, str]] = set()
    for fault in faults:
        ends = [fault.injections]
        if (fault.spec, fault.reading) not in handled_specs:
            handled_specs.add((fault.spec, fault.reading))
            ends += _injections_at_bounds(fault, specs, models)
        for injections in ends:
            for name, value in _ranged_values(injections, models):
                values_by_name.setdefault(name, set()).add(value)
    return {name: _range_of(values) for name, values in sorted(values_by_name.items())}


def units_of_parameters(
    faults: Iterable[Fault], specs: Mapping[str, FaultSpec], models: FaultModels
) -> dict[str, str]:
    """Return the symbol of each parameter's unit in the injected code; a parameter without one is left out.

    Names are those of the ranges; with several injections, a name without a number stands for all of them. A
    parameter whose unit differs between specs is left out.
    """
    symbols_by_name: dict[str, set[str]] = {}
    for name, reading in dict.fromkeys((fault.spec, fault.reading) for fault in faults):
        _, variant = find_variant(name, specs) or (None, None)
        injections = variant.injections_in_reading(reading) if variant else ()
        for number, injection in enumerate(injections, start=1):
            for parameter, symbol in _symbols_of_units(injection, models):
                names = (parameter, f"{number}.{parameter}") if len(injections) > 1 else (parameter,)
                for each in names:
                    symbols_by_name.setdefault(each, set()).add(symbol)
    return {
        name: min(symbols)
        for name, symbols in symbols_by_name.items()
        if len(symbols) == 1 and "" not in symbols
    }


def _symbols_of_units(injection: InjectionSpec, models: FaultModels) -> Iterator[tuple[str, str]]:
    for schema in models.get(injection.model).params:
        suffix = injection.unit if schema.unit == UNIT_OF_CHANGED_VARIABLE else schema.unit
        yield schema.name, UNITS[suffix].symbol if suffix in UNITS else ""


def find_variant(name: str, specs: Mapping[str, FaultSpec]) -> tuple[FaultSpec, Variant] | None:
    """Return the variant `<module>/<fault_type>/<variant>` and its spec; None if `specs` lacks it."""
    spec_name, _, variant_name = name.rpartition("/")
    spec = specs.get(spec_name)
    return next(((spec, variant) for variant in spec or () if spec and variant.name == variant_name), None)


def _injections_at_bounds(
    fault: Fault, specs: Mapping[str, FaultSpec], models: FaultModels
) -> Iterator[tuple[Injection, ...]]:
    """Yield the injections with the least and the greatest value that the fault's spec can draw; with all
    values, if they come in pairs.
    """
    spec, variant = find_variant(fault.spec, specs) or (None, None)
    if not (spec and variant and variant.draw):
        return
    ends = (
        drawn_values_of(variant, seed=0)  # lists do not depend on the seed
        if variant.paired_draws
        else ((DrawnValue(variant.draw, value),) for value in _drawn_bounds(variant.draw))
    )
    for drawn in ends:
        with suppress(MutatorError):  # values out of range are never drawn
            yield tuple(
                resolve_injection(injection, models.get(injection.model), spec.source, drawn_values=drawn)
                for injection in variant.injections_in_reading(fault.reading)
            )


def _drawn_bounds(draw: DrawSpec) -> tuple[float, ...]:
    digits = draw.decimals
    return tuple(end if digits is None else round(end, digits) for end in draw.least_and_greatest)


def _ranged_values(injections: tuple[Injection, ...], models: FaultModels) -> Iterator[tuple[str, _Value]]:
    for number, injection in enumerate(injections, start=1):
        prefix = f"{number}." if len(injections) > 1 else ""
        model = models.get(injection.model)
        for name, value in injection.params:
            schema = model.param(name)
            if isinstance(value, bool | str | None) or (schema and schema.type == "seed"):
                continue
            yield prefix + name, float(value) if isfinite(value) else str(value)
        for name in ("call", "every"):
            if (count := getattr(injection, name)) is not None:
                yield prefix + name, float(count)
        if injection.where:
            yield f"{prefix}where", injection.where


def _range_of(values: set[_Value]) -> tuple[_Value, ...]:
    numbers = [value for value in values if not isinstance(value, str)]
    words = sorted(value for value in values if isinstance(value, str))
    return (*((min(numbers), max(numbers)) if numbers else ()), *words)
