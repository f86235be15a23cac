"""An injection as written in YAML."""

from dataclasses import replace
from typing import Any

from pydantic import Field

from mutator._common.message_text import shortened_repr
from mutator.config import units
from mutator.config.instance_conditions import canonical_instance_condition
from mutator.config.location_yaml import LocationModel
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.faults.injection_specs import (
    InjectionSpec,
    MessagePlace,
    ParamSpec,
    ParamValue,
    parse_draw_reference,
)
from mutator.model import LOAD_TIME_ANCHORS, AnchorKind


class MessageModel(StrictModel, title="A message"):
    """A message instead of a place: a topic, and one of its readers. The target's manifest declares both
    under [`messages`](target-manifest.md#a-reader-of-messages).
    """

    topic: str = Field(description="The topic.")
    reader: str = Field(description="The part of the target that reads it.")


class InjectionModel(StrictModel, title="An injection"):
    """One fault model applied at one place. Give either `at` or `message`."""

    at: LocationModel | None = Field(None, description="The place where the fault is injected.")
    message: MessageModel | None = Field(
        None,
        description="Instead of `at`: the message that a fault model for messages (`message_loss`, "
        "`message_delay`, ...) changes on its way to a reader.",
    )
    model: str = Field(description="A [fault model](fault-models.md).")
    unit: str | None = Field(
        None,
        description="The unit of the changed variable in the source: a suffix or symbol from the [table of "
        "units](#units), or `'1'` for a plain number. Required if the model has parameters in that unit.",
    )
    params: dict[str, Any] = Field(
        default_factory=dict,
        description="Parameters of the model, with the unit in the key. A value is a number, a name, a "
        "constant such as `true`, or the draw's name. For a number that is written in one unit "
        "and read as another, write `{draw: ..., written_in: ..., read_as: ...}`.",
    )

    where: str | None = Field(
        None,
        description="A condition that selects one instance among several: `index == 2`, `self.name == "
        "'left'`, `item is self.items[0]`. It can use names that the function knows, attributes, "
        "items, constants, comparisons, `and`, `or` and `not`. It is evaluated only while the "
        "fault is active.",
    )
    call: int | None = Field(
        None,
        ge=1,
        description="The fault acts only in this execution of the place. Executions are counted from 1 at "
        "each activation; with `where`, only those that satisfy the condition are counted.",
    )
    every: int | None = Field(
        None, ge=1, description="The fault acts in every n-th execution of the place, counted as for `call`."
    )

    def injection_spec(self, source: YamlSource, keys: KeyPath) -> InjectionSpec:
        """Check and convert the injection; errors point into `source` at `keys`."""
        unit_suffix = None if self.unit is None else units.suffix_of_unit(self.unit)
        if self.unit is not None and unit_suffix is None:
            raise source.error(
                (*keys, "unit"),
                f"unit '{self.unit}'",
                expected=f"one of {units.UNIT_SUFFIXES_TEXT}, its symbol (`m/s`), or '1' for a plain number",
                remedy="name the unit that the variable has in the source",
            )
        params = []
        for key, value in self.params.items():
            name, unit = units.split_key_at_unit(key)
            param_keys = (*keys, "params", key)
            suffix = unit.suffix if unit else None
            params.append(
                ParamSpec(
                    name=name,
                    unit=suffix,
                    value=_parse_param_value(value, source, param_keys),
                    keys=param_keys,
                )
            )
        if (self.at is None) == (self.message is None):
            raise source.error(
                keys,
                "neither `at` nor `message`" if self.at is None else "both `at` and `message`",
                expected="one of them: a place in the source, or a message",
            )
        location = self.at.build_location(source, (*keys, "at")) if self.at else None
        self._check_instance_keys(location.anchor.kind if location else None, source, keys)
        return InjectionSpec(
            location=location,
            message=MessagePlace(topic=self.message.topic, reader=self.message.reader)
            if self.message
            else None,
            model=self.model,
            params=tuple(params),
            unit=unit_suffix,
            keys=keys,
            where=None if self.where is None else canonical_instance_condition(self.where),
            call=self.call,
            every=self.every,
        )

    def _check_instance_keys(self, kind: AnchorKind | None, source: YamlSource, keys: KeyPath) -> None:
        instance_keys = [name for name in ("where", "call", "every") if getattr(self, name) is not None]
        if instance_keys and kind is not None and kind in LOAD_TIME_ANCHORS:
            raise source.error(
                (*keys, instance_keys[0]),
                f"`{instance_keys[0]}` at a {kind.value}",
                expected="no `where`, `call` or `every`: the value is set once a step, for all instances",
                remedy="leave it out, or anchor where the value is used",
            )
        if {"call", "every"} <= set(instance_keys):
            raise source.error(
                (*keys, "every"), "`call` and `every`", expected="one of them", remedy="leave one out"
            )
        try:
            canonical_instance_condition("True" if self.where is None else self.where)
        except ValueError:
            raise source.error(
                (*keys, "where"),
                shortened_repr(self.where),
                expected="names, attributes, items, constants, comparisons, `and`, `or` and `not`",
                remedy="use something that the function knows, e.g. `where: index == 2`",
            ) from None


def _parse_param_value(value: Any, source: YamlSource, keys: KeyPath) -> ParamValue:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    key = keys[-1]
    if not isinstance(value, dict) or set(value) != {"draw", "written_in", "read_as"}:
        raise source.error(
            keys,
            f"{shortened_repr(value)} for '{key}'",
            expected="a number, a name, or {draw: ..., written_in: ..., read_as: ...}",
            remedy="write a plain value",
        )
    for name in ("written_in", "read_as"):
        if value[name] not in units.UNITS:
            raise source.error(
                (*keys, name),
                f"{shortened_repr(value[name])} for '{name}'",
                expected=f"one of {units.UNIT_SUFFIXES_TEXT}",
            )
    drawn = parse_draw_reference(str(value["draw"]))
    if not drawn:
        raise source.error(
            (*keys, "draw"), f"{shortened_repr(value['draw'])} for 'draw'", expected="the draw's name"
        )
    return replace(drawn, written_unit=value["written_in"], misread_unit=value["read_as"])
