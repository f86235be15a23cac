"""The holes that phrases of specs and fault models can have."""

from collections.abc import Iterator

from mutator._common.phrase_texts import ABSOLUTE_PREFIX, CHANGED_HOLE, FILE_HOLE, FUNCTION_HOLE, VALUE_HOLE
from mutator.config import units
from mutator.faults.fault_models import UNIT_OF_CHANGED_VARIABLE, FaultModels, ParamSchema
from mutator.faults.fault_specs import Variant
from mutator.faults.injection_specs import InjectionSpec

_NUMBER_TYPES = ("number", "integer")


def fault_holes(variant: Variant, reading: str, models: FaultModels) -> tuple[str, ...]:
    """Return the holes of a variant's phrase: its value, and the numbers of its injections in the unit of the
    source (`by_kph`), each also without its sign (`abs_by_kph`).
    """
    injections = variant.injections_in_reading(reading)
    names = [VALUE_HOLE] if variant.draw else []
    names += [name for injection in injections for name in _number_holes(injection, models)]
    return tuple(dict.fromkeys(hole for name in names for hole in (name, f"{ABSOLUTE_PREFIX}{name}")))


def _number_holes(injection: InjectionSpec, models: FaultModels) -> Iterator[str]:
    model = models.get(injection.model)
    for param in injection.params:
        schema = model.param(param.name)
        if schema and schema.type in _NUMBER_TYPES:
            unit = injection.unit if schema.unit == UNIT_OF_CHANGED_VARIABLE else schema.unit
            yield schema.name if unit in (None, units.DIMENSIONLESS) else f"{schema.name}_{unit}"


def model_holes(params: tuple[ParamSchema, ...]) -> tuple[str, ...]:
    """Return the holes of a fault model's phrase: what is changed and where, and the model's parameters."""
    numbers = [f"{ABSOLUTE_PREFIX}{param.name}" for param in params if param.type in _NUMBER_TYPES]
    names = [param.name for param in params if param.type != "seed"]
    return (CHANGED_HOLE, FUNCTION_HOLE, FILE_HOLE, *names, *numbers)
