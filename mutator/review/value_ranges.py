"""The ranges of a group's parameters, from the draws of its specs, independent of the seed."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from math import isfinite

from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec, Variant
from mutator.faults.injection_parameters import resolve_injection
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
            ends += _injections_at_bounds(fault, specs.get(fault.spec.rpartition("/")[0]), models)
        for injections in ends:
            for name, value in _ranged_values(injections, models):
                values_by_name.setdefault(name, set()).add(value)
    return {name: _range_of(values) for name, values in sorted(values_by_name.items())}


def _injections_at_bounds(
    fault: Fault, spec: FaultSpec | None, models: FaultModels
) -> Iterator[tuple[Injection, ...]]:
    """Yield the injections with the least and the greatest value that the fault's spec can draw."""
    name = fault.spec.rpartition("/")[2]
    for variant in spec or ():
        if variant.name == name and variant.draw and spec:
            for value in _drawn_bounds(variant):
                with suppress(MutatorError):  # values out of range are never drawn
                    yield tuple(
                        resolve_injection(
                            injection,
                            models.get(injection.model),
                            spec.source,
                            draw=variant.draw,
                            value=value,
                        )
                        for injection in variant.injections_in_reading(fault.reading)
                    )


def _drawn_bounds(variant: Variant) -> tuple[float, ...]:
    assert variant.draw is not None
    digits = variant.draw.decimals
    return tuple(end if digits is None else round(end, digits) for end in variant.draw.least_and_greatest)


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
