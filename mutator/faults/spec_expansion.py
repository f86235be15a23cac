"""Expand specs into faults."""

import math
from collections.abc import Iterator

from mutator._common.message_text import describe_choices
from mutator._common.random_streams import random_generator
from mutator.config import units
from mutator.config.location_syntax import defence_at
from mutator.config.phrases_yaml import check_holes
from mutator.config.yaml_source_lines import KeyPath
from mutator.errors import MutatorError
from mutator.faults.draw_specs import DrawSpec
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec, Variant
from mutator.faults.import_checks import check_import_defined
from mutator.faults.injection_parameters import DrawnValue, resolve_injection
from mutator.faults.injection_specs import InjectionSpec
from mutator.faults.message_places import check_changes_messages, locate_injection, location_of
from mutator.faults.phrase_holes import fault_holes
from mutator.model import Fault, Injection
from mutator.targets.allowed_locations import check_location_allowed
from mutator.targets.manifest import TargetManifest

# Published ids contain seeds of image effects, which differ from value to value.
_MODELS_WITH_SEED_BY_VALUE = frozenset(("image_effect",))
_MOST_REDRAWS_OF_VALUE = 100  # of one value
_MOST_REDRAWS_OF_ALL_VALUES = 20_000  # of all values; more mean that the ranges have too few different values


def expand_spec(
    spec: FaultSpec,
    seed: int,
    reading: str | None = None,
    *,
    models: FaultModels,
    manifest: TargetManifest,
) -> tuple[Fault, ...]:
    """Return the faults of `spec` in `reading` (None: the library's default), ordered by variant and range.

    The same seed draws the same values for every reading, trigger, scenario and method. MutatorError
    (file:line) for an unknown model, parameter or change, a wrong unit, a value out of range, and a location
    outside the target or in a forbidden place. Anchors are resolved later, when a mutant is built.
    """
    reading = reading or spec.readings.default_name
    spec.readings.check_name(reading)
    expander = _SpecExpander(spec, seed, reading, models, manifest)
    return tuple(fault for variant in spec for fault in expander.faults(variant))


def drawn_values_of(variant: Variant, seed: int) -> Iterator[tuple[DrawnValue, ...]]:
    """Yield the values of each of the variant's faults, one from each draw; none for a fault without a
    draw.
    """
    if variant.draw is None:
        yield ()
        return
    columns = [draw_values(draw, seed) for draw in variant.all_draws]
    for values in zip(*columns, strict=True):
        yield tuple(DrawnValue(draw, value) for draw, value in zip(variant.all_draws, values, strict=True))


def draw_values(draw: DrawSpec, seed: int) -> tuple[int | float, ...]:
    """Return the values of `draw` for `seed`, in the draw's unit: one from each range, or the list unchanged.

    The value from a range depends only on seed, key, position and earlier values. Duplicates are drawn again,
    because equal faults have the same id. A 0 among `reals` is drawn again, because it changes nothing.
    """
    if draw.kind == "list":
        return draw.values
    stream = random_generator(seed, draw.key).random(len(draw.ranges))
    values: list[int | float] = []
    remaining_redraws = _MOST_REDRAWS_OF_ALL_VALUES
    for i, fraction in enumerate(map(float, stream)):
        value = _value_in_range(draw, i, fraction)
        for attempt in range(min(_MOST_REDRAWS_OF_VALUE, remaining_redraws)):
            if value not in values and not (value == 0 and draw.kind == "reals"):
                break
            remaining_redraws -= 1
            value = _value_in_range(
                draw, i, float(random_generator(seed, f"{draw.key}/{i}/{attempt}").random())
            )
        values.append(value)
    return tuple(values)


def _value_in_range(draw: DrawSpec, index: int, fraction: float) -> int | float:
    low, high = draw.ranges[index]
    if draw.kind == "integers":
        whole = int(low) + math.floor(fraction * (int(high) - int(low) + 1))
        return whole if draw.cap is None else min(whole, int(draw.cap))
    value = low + fraction * (high - low)
    value = value if draw.decimals is None else round(value, draw.decimals)
    return value if draw.cap is None else float(min(value, draw.cap))


class _SpecExpander:
    def __init__(
        self, spec: FaultSpec, seed: int, reading: str, models: FaultModels, manifest: TargetManifest
    ) -> None:
        self.spec = spec
        self.seed = seed
        self.reading = reading
        self.models = models
        self.manifest = manifest

    def faults(self, variant: Variant) -> Iterator[Fault]:
        """Yield a fault for each drawn value of the variant, or one fault for a variant without a draw."""
        self._check_variant(variant)
        draw = variant.draw
        unit = units.UNITS[draw.unit].symbol if draw and draw.unit else "-"
        drawn_values = drawn_values_of(variant, self.seed)
        for number, drawn in enumerate(drawn_values, start=variant.first_value_number):
            yield Fault(
                spec=f"{self.spec.name}/{variant.name}",
                module=self.spec.module,
                fault_type=self.spec.fault_type,
                reading=self.reading,
                value=drawn[0].value if drawn else None,
                unit=unit,
                aim=variant.aimed_hazard,
                injections=self._injections(variant, drawn, number),
                hold=variant.hold_in_reading(self.reading),
                changes=variant.changes,
            )

    def _injections(
        self, variant: Variant, drawn: tuple[DrawnValue, ...], number: int
    ) -> tuple[Injection, ...]:
        return tuple(
            resolve_injection(
                locate_injection(injection, self.manifest, self.spec.source),
                self.models.get(injection.model),
                self.spec.source,
                drawn_values=drawn,
                seed=self.seed,
                key=self._seed_key(variant, injection, number, i),
            )
            for i, injection in enumerate(variant.injections_in_reading(self.reading))
        )

    def _seed_key(self, variant: Variant, injection: InjectionSpec, number: int, position: int) -> str:
        """Return what determines an injection's random numbers: neighbouring values meet the same ones."""
        by_value = f"/{number}" if injection.model in _MODELS_WITH_SEED_BY_VALUE else ""
        return f"{self.spec.name}/{variant.name}{by_value}/{position}"

    def _check_variant(self, variant: Variant) -> None:
        if variant.aimed_hazard and variant.aimed_hazard not in self.manifest.hazard_names:
            raise self._unknown_name_error(
                (*variant.keys, "aim"), f"aim '{variant.aimed_hazard}'", self.manifest.hazard_names
            )
        for i, change in enumerate(variant.changes):
            if change not in self.manifest.args_by_change:
                keys = (*variant.keys, "changes", i)
                raise self._unknown_name_error(
                    keys, f"change '{change}'", tuple(self.manifest.args_by_change)
                )
        for injection in variant.injections_in_reading(self.reading):
            self._check_injection(injection)
        if phrase := variant.phrase_in_reading(self.reading):
            check_holes(
                phrase,
                fault_holes(variant, self.reading, self.models),
                self.spec.source,
                self._phrase_keys(variant),
            )

    def _phrase_keys(self, variant: Variant) -> KeyPath:
        in_reading: KeyPath = (*variant.keys_by_reading.get(self.reading, variant.keys), "phrase")
        return in_reading if in_reading in self.spec.source.lines else (*variant.keys, "phrase")

    def _check_injection(self, injection: InjectionSpec) -> None:
        keys: KeyPath = (*injection.keys, "model")
        located = locate_injection(injection, self.manifest, self.spec.source)
        location = location_of(injection, self.manifest, self.spec.source)
        try:
            model = self.models.get(injection.model)
            keys = (*injection.keys, *(("message",) if injection.message else ("at", "file")))
            if not defence_at(location.path):  # where a defence is, the checks before a run look
                check_location_allowed(self.manifest, location)
            if injection.message:
                check_changes_messages(located, model, self.models)
            for param in injection.params:
                schema = model.param(param.name)
                if schema and schema.type == "import":
                    keys = param.keys
                    check_import_defined(self.manifest, str(param.value))
        except MutatorError as error:
            raise self.spec.source.error(
                keys, error.got, expected=error.expected, remedy=error.remedy
            ) from None

    def _unknown_name_error(self, keys: KeyPath, got: str, names: tuple[str, ...]) -> MutatorError:
        return self.spec.source.error(
            keys,
            got,
            expected=f"{describe_choices(names)}, as in {self.manifest.path.name}",
            remedy="correct it",
        )
