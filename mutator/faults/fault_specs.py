"""Fault specs: YAML files that each describe one fault type of a module, before values are drawn."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, create_model

from mutator.config.phrases_yaml import SignedPhraseModel, build_phrase
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.faults.draw_specs import DrawModel, DrawSpec, build_draws, check_name
from mutator.faults.injection_model import InjectionModel
from mutator.faults.injection_specs import InjectionSpec
from mutator.faults.library_readings import KEY_WITHOUT_NAME, SpecReadings
from mutator.model import Hold
from mutator.targets.stored_phrases import PhraseByCase

SCHEMA = "fault_spec/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One row of the library: for each reading, injections that share a trigger and a draw.

    `injections_by_reading` starts with the default reading. `hold_by_reading` overrides how long the fault
    stays active; `phrase_by_reading` says what the fault does, in words. An empty `aimed_hazard`: none.
    `paired_draws` are lists as long as `draw`'s: the n-th values of all belong to one fault.
    `first_value_number` counts the values before the first one, of a variant that has only some of them.
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
    paired_draws: tuple[DrawSpec, ...] = ()
    first_value_number: int = 0

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

    @property
    def all_draws(self) -> tuple[DrawSpec, ...]:
        return (self.draw, *self.paired_draws) if self.draw else ()


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
    draw: dict[str, DrawModel] | None = Field(
        None,
        description="Name and unit -> draw: one draw, or several lists of `values` of equal length. The "
        "n-th values of these lists make one fault. Those of the first list must differ, because tables name "
        "the fault by them. Without a draw, the variant is a single fault.",
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
        check_name(getattr(model, key), source, (key,))
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


def _build_variant(
    spec: str, name: str, model: _VariantModelBase, readings: SpecReadings, source: YamlSource
) -> Variant:
    keys: KeyPath = ("variants", name)
    check_name(name, source, keys)
    model_by_reading, keys_by_reading = _reading_models(model, readings, source, keys)
    draws = () if model.draw is None else build_draws(f"{spec}/{name}", model.draw, source, (*keys, "draw"))
    return Variant(
        name=name,
        aimed_hazard=model.aim or "",
        about=model.about,
        draw=draws[0] if draws else None,
        paired_draws=draws[1:],
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
