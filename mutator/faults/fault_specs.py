"""Fault specs: YAML files that each describe one fault type of a module, before values are drawn."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, create_model, model_validator

from mutator.config import units
from mutator.config.phrases import SignedPhraseModel, build_phrase
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_sources import KeyPath, YamlSource
from mutator.faults.injection_model import InjectionModel
from mutator.faults.injection_specs import InjectionSpec
from mutator.faults.library_readings import KEY_WITHOUT_NAME, SpecReadings
from mutator.model import Hold
from mutator.targets.stored_phrases import PhraseByCase

SCHEMA = "fault_spec/1"
_NAME_PATTERN = re.compile(r"[a-z][a-z0-9_]*\Z")
_MOST_RANGES = 1000  # of a sweep; more mean a mistyped step, and each range is a fault
_MOST_DRAWN_NUMBER = 1e15  # limit of a drawn number: whole numbers up to it are exact


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawSpec:
    """How a variant's values are made: one draw from each range, or a list.

    Values are in `unit`, the suffix of the YAML key (None for plain numbers). `key` and the campaign's seed
    determine the draw: equal keys and ranges give equal values.
    """

    key: str
    name: str
    unit: str | None
    kind: Literal["integers", "reals", "list"]
    ranges: tuple[tuple[float, float], ...] = ()
    values: tuple[float | int, ...] = ()
    decimals: int | None = None
    cap: float | None = None
    keys: KeyPath = ()

    @property
    def value_count(self) -> int:
        return len(self.values) if self.kind == "list" else len(self.ranges)

    @property
    def least_and_greatest(self) -> tuple[float, float]:
        """The least and the greatest possible value."""
        ends = self.values or [end for ends in self.ranges for end in ends]
        return min(ends), max(ends) if self.cap is None else min(max(ends), self.cap)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One row of the library: for each reading, injections that share a trigger and a draw.

    `injections_by_reading` starts with the default reading. `hold_by_reading` overrides how long the fault
    stays active; `phrase_by_reading` says what the fault does, in words. An empty `aimed_hazard`: none.
    """

    name: str
    aimed_hazard: str
    about: str
    draw: DrawSpec | None
    changes: tuple[str, ...]
    injections_by_reading: Mapping[str, tuple[InjectionSpec, ...]]
    hold_by_reading: Mapping[str, Hold | None]
    phrase_by_reading: Mapping[str, PhraseByCase]
    keys: KeyPath
    keys_by_reading: Mapping[str, KeyPath]  # the mappings that have the injections

    def injections_in_reading(self, reading: str) -> tuple[InjectionSpec, ...]:
        return self.injections_by_reading[self._reading_or_default(reading)]

    def hold_in_reading(self, reading: str) -> Hold | None:
        """Return how long the fault stays active; None: the trigger decides."""
        return self.hold_by_reading[self._reading_or_default(reading)]

    def phrase_in_reading(self, reading: str) -> PhraseByCase:
        return self.phrase_by_reading[self._reading_or_default(reading)]

    def _reading_or_default(self, reading: str) -> str:
        return reading if reading in self.injections_by_reading else next(iter(self.injections_by_reading))

    @property
    def fault_count(self) -> int:
        return self.draw.value_count if self.draw else 1


@dataclass(frozen=True, kw_only=True)
class FaultSpec:
    """One file of `fault_library/faults/<module>/`: a fault type of a module with its variants."""

    module: str
    fault_type: str
    about: str
    variants: tuple[Variant, ...]
    readings: SpecReadings  # the library's
    source: YamlSource

    @property
    def name(self) -> str:
        """`<module>/<fault_type>`. The `Fault.spec` of its faults is `<module>/<fault_type>/<variant>`."""
        return f"{self.module}/{self.fault_type}"

    @property
    def path(self) -> Path:
        return self.source.path

    @property
    def fault_count(self) -> int:
        return sum(v.fault_count for v in self.variants)

    def __iter__(self) -> Iterator[Variant]:
        return iter(self.variants)


_DrawnNumber = Annotated[float, Field(ge=-_MOST_DRAWN_NUMBER, le=_MOST_DRAWN_NUMBER, allow_inf_nan=False)]


class SweepModel(StrictModel, title="A sweep"):
    """Ranges of equal width at equal distances. `{first: [15, 24], step: 10, last: [245, 254]}` gives the
    24 ranges [15, 24], [25, 34] ... [245, 254]. One value is drawn from each range, both ends included.
    """

    first: list[_DrawnNumber] = Field(description="The first range, [low, high].")
    step: float = Field(gt=0.0, allow_inf_nan=False, description="The distance from one range to the next.")
    last: list[_DrawnNumber] = Field(description="The last range, a whole number of steps above the first.")

    @model_validator(mode="after")
    def _check_ranges(self) -> "SweepModel":
        self.ranges()
        return self

    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Return all ranges as (low, high); ValueError if the sweep is not valid."""
        if len(self.first) != 2 or len(self.last) != 2 or not self.first[0] <= self.first[1]:
            raise ValueError("first and last as [low, high]")
        low, high = self.first
        steps = (self.last[0] - low) / self.step
        if steps >= _MOST_RANGES:
            raise ValueError(f"at most {_MOST_RANGES} ranges")
        ranges = tuple((low + i * self.step, high + i * self.step) for i in range(round(steps) + 1))
        # the step times a number is not exact in binary: 3 * 0.1 is not 0.3
        if not ranges or any(abs(a - b) > 1e-9 for a, b in zip(ranges[-1], self.last, strict=True)):
            raise ValueError("a last range that is a whole number of steps above the first")
        return ranges


class _DrawModel(StrictModel, title="A draw"):
    """The key of a draw is a name of your choice and a unit: `distance_m`. Parameters refer to the drawn
    value by that name without the unit, optionally with a minus sign: `by_m: -distance`. Give exactly one of
    `integers_from`, `reals_from` and `values`. The same seed and key give the same values.
    """

    integers_from: SweepModel | None = Field(None, description="One whole number from each range of a sweep.")
    reals_from: SweepModel | None = Field(None, description="One number from each range of a sweep.")
    decimals: int | None = Field(
        None, ge=0, le=12, description="The number of decimals to which values of `reals_from` are rounded."
    )
    values: list[float | int] | None = Field(None, description="A list of values, used unchanged.")
    cap: float | None = Field(
        None, allow_inf_nan=False, description="The maximum: larger drawn values are reduced to it."
    )
    key: str | None = Field(
        None,
        description="A name that seeds the draw together with the campaign's seed. Variants can share it. "
        "Default: the variant's full name.",
    )


_PHRASE_DESCRIPTION = (
    "What the fault does, as a clause, for the [sentence](../how-to/word-results.md) about an experiment: "
    "`the speed sensor reads {abs_value} too low`. Holes: `value` (the drawn value with its unit), "
    "`abs_value` (without its sign), and the injections' numbers in the unit of the source, such as `by_kph` "
    "and `abs_by_kph`"
)
_DIRECT_INJECTIONS_DESCRIPTION = (
    "In a library with one [reading](#readings), or without readings: what the fault injects, without the "
    "key of a reading. At least one injection."
)
_HOLD_DESCRIPTION = (
    "How long the fault stays active, if the trigger does not determine it: `to_end` for a fault that latches"
)


class _VariantReadingModel(StrictModel, title="A reading"):
    hold: Literal["while", "to_end"] | None = Field(
        None, description=f"{_HOLD_DESCRIPTION} in this reading; default: the variant's `hold`."
    )
    phrase: str | SignedPhraseModel | None = Field(
        None, description=f"{_PHRASE_DESCRIPTION}, in this reading; default: the variant's `phrase`."
    )
    injections: list[InjectionModel] = Field(
        description="At least one. The fault is activated if any of them runs while the fault is active."
    )


class _VariantModelBase(StrictModel, title="A variant"):
    """A variant is one row of the library: its injections share one trigger and one draw."""

    aim: str | None = Field(
        None, description="The hazard that the fault is meant to cause, one of the target's hazards."
    )
    about: str = Field(description="What this variant does.")
    changes: list[str] = Field(
        default_factory=list,
        description="Changes of the scenario that belong to the fault, by their names in the target's "
        "manifest.",
    )
    hold: Literal["while", "to_end"] | None = Field(None, description=f"{_HOLD_DESCRIPTION}.")
    phrase: str | SignedPhraseModel | None = Field(None, description=f"{_PHRASE_DESCRIPTION}.")
    draw: dict[str, _DrawModel] | None = Field(
        None,
        description="Exactly one draw: name and unit -> draw. Without a draw, the variant is a single fault.",
    )
    # `build_spec_model` adds the readings and `injections`


class SpecModel(StrictModel, title="The file"):
    """A fault type of a module, in one or more variants."""

    # `spec_model` adds `variants`

    module: str = Field(description="The module of the controller that the fault is in.")
    fault_type: str = Field(
        description="The name of the fault type. The spec is named `<module>/<fault_type>`."
    )
    about: str = Field(description="What goes wrong, in one sentence.")


@cache
def build_spec_model(readings: SpecReadings) -> type[SpecModel]:
    """Make the schema of a library's spec files. A variant has one key for each reading, or its injections
    directly if there is one reading.
    """
    keys: dict[str, Any] = {}
    for name, about in zip(readings.names, readings.descriptions, strict=True):
        required = name == readings.default_name and len(readings.names) > 1
        kind = _VariantReadingModel if required else _VariantReadingModel | None
        keys[name or KEY_WITHOUT_NAME] = (kind, Field(... if required else None, description=about))
    keys["injections"] = (
        list[InjectionModel] | None,
        Field(None, description=_DIRECT_INJECTIONS_DESCRIPTION),
    )
    variant = create_model(
        "_VariantModel", __base__=_VariantModelBase, __doc__=_VariantModelBase.__doc__, **keys
    )
    variants = Field(description="Name of the variant -> variant; at least one.")
    return create_model(
        "SpecModel",
        __base__=SpecModel,
        __doc__=SpecModel.__doc__,
        variants=(dict[str, variant], variants),  # type: ignore[valid-type]
    )


def load_spec(path: Path, readings: SpecReadings) -> FaultSpec:
    """Read one spec of a library; errors have file and line. `expand_spec` does the remaining checks."""
    model, source = load_yaml_model(path, build_spec_model(readings), SCHEMA)
    models: dict[str, _VariantModelBase] = model.variants  # type: ignore[attr-defined]
    for key in ("module", "fault_type"):
        _check_name(getattr(model, key), source, (key,))
    if not models:
        raise source.error(("variants",), "no variant", expected="at least one", remedy="describe a fault")
    name = f"{model.module}/{model.fault_type}"
    variants = tuple(_build_variant(name, key, variant, readings, source) for key, variant in models.items())
    return FaultSpec(
        module=model.module,
        fault_type=model.fault_type,
        about=model.about,
        variants=variants,
        readings=readings,
        source=source,
    )


def _check_name(name: str, source: YamlSource, keys: KeyPath) -> None:
    if not _NAME_PATTERN.match(name):
        raise source.error(keys, f"'{name}'", expected="lowercase letters, digits and _", remedy="rename it")


def _build_variant(
    spec: str, name: str, model: _VariantModelBase, readings: SpecReadings, source: YamlSource
) -> Variant:
    keys: KeyPath = ("variants", name)
    _check_name(name, source, keys)
    model_by_reading, keys_by_reading = _reading_models(model, readings, source, keys)
    return Variant(
        name=name,
        aimed_hazard=model.aim or "",
        about=model.about,
        draw=_build_draw(f"{spec}/{name}", model.draw, source, (*keys, "draw"))
        if model.draw is not None
        else None,
        changes=tuple(model.changes),
        injections_by_reading={
            reading: _build_injections(reading_model, source, keys_by_reading[reading])
            for reading, reading_model in model_by_reading.items()
        },
        hold_by_reading={
            reading: (hold := reading_model.hold or model.hold) and Hold(hold)
            for reading, reading_model in model_by_reading.items()
        },
        phrase_by_reading={
            reading: build_phrase(reading_model.phrase or model.phrase, None, source, keys)
            for reading, reading_model in model_by_reading.items()
        },
        keys=keys,
        keys_by_reading=keys_by_reading,
    )


def _reading_models(
    model: _VariantModelBase, readings: SpecReadings, source: YamlSource, keys: KeyPath
) -> tuple[dict[str, _VariantReadingModel], dict[str, KeyPath]]:
    """Return what a variant has in each reading, and where."""
    key_by_reading = {name: name or KEY_WITHOUT_NAME for name in readings.names}
    model_by_reading = {
        name: reading_model
        for name, key in key_by_reading.items()
        if (reading_model := getattr(model, key)) is not None
    }
    keys_by_reading = {name: (*keys, key_by_reading[name]) for name in model_by_reading}
    injections: list[InjectionModel] | None = model.injections  # type: ignore[attr-defined]
    if injections is None and model_by_reading:
        return model_by_reading, keys_by_reading
    if injections is None:
        raise source.error(
            keys, "no injections", expected="the key `injections`", remedy="say what the fault injects"
        )
    if model_by_reading or len(readings.names) > 1:
        named = ", ".join(f"`{key}`" for key in key_by_reading.values())
        raise source.error(
            (*keys, "injections"),
            "injections outside a reading" if len(readings.names) > 1 else "injections twice",
            expected=f"the key {named}, with `injections` below it"
            if len(readings.names) > 1
            else f"`injections` directly under the variant, or under {named}",
            remedy="move them there" if len(readings.names) > 1 else "delete one of the two",
        )
    name = readings.default_name
    return {name: _VariantReadingModel(hold=None, phrase=None, injections=injections)}, {name: keys}


def _build_injections(
    model: _VariantReadingModel, source: YamlSource, keys: KeyPath
) -> tuple[InjectionSpec, ...]:
    if not model.injections:
        raise source.error((*keys, "injections"), "no injection", expected="at least one")
    return tuple(
        injection.injection_spec(source, (*keys, "injections", i))
        for i, injection in enumerate(model.injections)
    )


def _build_draw(
    default_key: str, models: dict[str, _DrawModel], source: YamlSource, keys: KeyPath
) -> DrawSpec:
    if len(models) != 1:
        raise source.error(
            keys, f"{len(models)} draws", expected="one", remedy="use one draw for all injections"
        )
    key, model = next(iter(models.items()))
    name, unit = units.split_unit(key)
    _check_name(name, source, (*keys, key))
    ways = {"integers": model.integers_from, "reals": model.reals_from, "list": model.values}
    kinds = [kind for kind, way in ways.items() if way is not None]
    draw_keys = (*keys, key)
    if len(kinds) != 1:
        raise source.error(
            draw_keys, f"{len(kinds)} ways to draw", expected="integers_from, reals_from or values"
        )
    kind: Literal["integers", "reals", "list"] = kinds[0]  # type: ignore[assignment]
    ranges = model.integers_from or model.reals_from
    if model.integers_from and any(x != int(x) for pair in model.integers_from.ranges() for x in pair):
        raise source.error((*draw_keys, "integers_from"), "a range with fractions", expected="whole numbers")
    if model.decimals is not None and kind != "reals":
        raise source.error(
            (*draw_keys, "decimals"),
            f"decimals: {model.decimals}",
            expected="`decimals` only with reals_from",
        )
    return DrawSpec(
        key=model.key or default_key,
        name=name,
        unit=unit.suffix if unit else None,
        kind=kind,
        ranges=ranges.ranges() if ranges else (),
        values=tuple(model.values or ()),
        decimals=model.decimals,
        cap=model.cap,
        keys=draw_keys,
    )
