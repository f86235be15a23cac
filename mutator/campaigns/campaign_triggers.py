"""The triggers of a campaign file: contexts of a table, or a list."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.config.yaml_files import StrictModel, YamlRecord
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.limits import MOST_LIMIT_OR_TIME
from mutator.model import Trigger
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import canonical_condition
from mutator.triggers.trigger_kinds import always_trigger, held_for, named_with_hold, trigger_at_time

EVERY_READING = "*"  # key of a value that applies to all readings
_LIST_KEYS: KeyPath = ("triggers", "list")
Seconds = Annotated[float, Field(ge=0.0, le=MOST_LIMIT_OR_TIME, allow_inf_nan=False)]
_SECONDS_SCHEMA = {"type": "number", "minimum": 0.0, "maximum": MOST_LIMIT_OR_TIME}


def to_value_by_reading(value: object) -> object:
    """Return values by reading; a single value applies to all."""
    return value if isinstance(value, dict) else {EVERY_READING: value}


def schema_with_readings(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON schema of a value that is given once or for each reading."""
    return {"anyOf": [schema, {"type": "object", "additionalProperties": schema}]}


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedTrigger:
    """Exactly one of `always`, `at_s` and `when`. `always` is short for `always: true`."""

    __pydantic_config__ = pydantic_mapping_config("A trigger")

    always: bool = field(
        default=False, metadata=yaml_metadata("`true`: active from the time at which triggers are armed.")
    )
    at_s: Seconds | None = field(
        default=None, metadata=yaml_metadata("Active from this time (s) to the end.")
    )
    when: str | None = field(
        default=None,
        metadata=yaml_metadata(
            "Active while this condition on `t` (s) and the target's observed values holds."
        ),
    )
    hold_s: float | None = field(
        default=None,
        metadata=yaml_metadata(
            "How long the fault stays active after the trigger first fires, in s. Default: the campaign's "
            "`hold_s`.",
            gt=0.0,
            allow_inf_nan=False,
        ),
    )

    def __post_init__(self) -> None:
        if sum((self.always, self.at_s is not None, self.when is not None)) != 1:
            raise ValueError("one of `always`, `at_s` and `when`")


_TriggerMapping = YamlRecord[ListedTrigger]
_TriggerOrAlways = Literal["always"] | _TriggerMapping


def _always_as_mapping(trigger: object) -> object:
    return {"always": True} if trigger == "always" else trigger


_ListedTriggerField = Annotated[
    _TriggerMapping, BeforeValidator(_always_as_mapping, json_schema_input_type=_TriggerOrAlways)
]


class TriggersModel(StrictModel, title="Triggers"):
    """When faults become active.

    Guided experiments wait for the contexts of a table or the triggers of a list; random experiments start at
    a drawn time. `triggers` can be the list itself: `triggers: [always, {at_s: 3}, {when: speed > 5}]`.
    """

    table: str | None = Field(None, description="The context table, by its name.")
    rows: list[str] | None = Field(
        None, min_length=1, description="The contexts of the table to use. Default: all."
    )
    listed: list[_ListedTriggerField] | None = Field(
        None, alias="list", min_length=1, description="Instead of `table`: the triggers, each once."
    )
    armed_after_s: Annotated[
        dict[str, Seconds],
        BeforeValidator(to_value_by_reading),
        WithJsonSchema(schema_with_readings(_SECONDS_SCHEMA)),
    ] = Field(
        default_factory=dict,
        min_length=1,
        description="The time in s before which no trigger fires and no random time is drawn. Give one "
        "number, or one for each reading, by name. Default: the time in the target's "
        "manifest. A trigger with `at_s` is not delayed.",
    )
    random_until_s: float | None = Field(
        None,
        gt=0.0,
        le=MOST_LIMIT_OR_TIME,
        allow_inf_nan=False,
        description="The latest random time in s, required for `random` experiments. A fault whose time is "
        "past the end of its scenario is never active.",
    )
    hold_s: float | None = Field(
        None,
        gt=0.0,
        allow_inf_nan=False,
        description="How long a fault stays active once triggered, in s. Default: while its context holds, "
        "or from its random time to the end.",
    )

    @model_validator(mode="after")
    def _check(self) -> "TriggersModel":
        if (self.table is None) == (self.listed is None):
            raise ValueError("either a `table` or a `list`")
        if self.rows is not None and self.table is None:
            raise ValueError("`rows` only with a `table`")
        until, armed = self.random_until_s, max(self.armed_after_s.values(), default=0.0)
        if until is not None and until <= armed:
            raise ValueError("`random_until_s` later than `armed_after_s`")
        return self


def _same_value(value: object) -> object:
    return value


# `with_trigger_list_under_key` has already converted the list, so that errors have its lines
Triggers = Annotated[
    TriggersModel, BeforeValidator(_same_value, json_schema_input_type=TriggersModel | list[_TriggerOrAlways])
]


def with_trigger_list_under_key(source: YamlSource) -> YamlSource:
    """Convert a campaign whose key `triggers` has a list into one with that list under `list`."""
    triggers = source.data.get("triggers")
    if not isinstance(triggers, list):
        return source
    lines = {
        _LIST_KEYS + keys[1:] if keys[:1] == _LIST_KEYS[:1] else keys: line
        for keys, line in source.lines.items()
    }
    lines["triggers",] = lines[_LIST_KEYS]
    return replace(source, data={**source.data, "triggers": {"list": triggers}}, lines=lines)


def build_listed_triggers(
    listed: Sequence[ListedTrigger],
    source: YamlSource,
    manifest: TargetManifest,
    *,
    armed_after_s: float,
    hold_s: float | None,
) -> tuple[Trigger, ...]:
    """Return the triggers of a campaign's list in `source`; `hold_s` is their default hold.

    Triggers that differ only in the hold have it in their names. MutatorError with the line for a condition
    on unobserved values, and for a duplicate trigger.
    """
    triggers = []
    for i, item in enumerate(listed):
        with source.locating_errors((*_LIST_KEYS, i, "when")):
            triggers.append(
                _build_trigger(item, manifest.observation.variables, armed_after_s, item.hold_s or hold_s)
            )
    return _with_unique_names(triggers, source)


def _with_unique_names(triggers: Sequence[Trigger], source: YamlSource) -> tuple[Trigger, ...]:
    """Add the hold to names that several triggers have; MutatorError at the line of a duplicate."""
    counts = Counter(trigger.name for trigger in triggers)
    trigger_by_name: dict[str, Trigger] = {}
    for i, trigger in enumerate(triggers):
        named = named_with_hold(trigger) if counts[trigger.name] > 1 else trigger
        if named.name in trigger_by_name:
            got = f"'{named.name}' is listed twice"
            raise source.error((*_LIST_KEYS, i), got, expected="each trigger once", remedy="remove one")
        trigger_by_name[named.name] = named
    return tuple(trigger_by_name.values())


def _build_trigger(
    listed: ListedTrigger, variables: Collection[str], armed_after_s: float, hold_s: float | None
) -> Trigger:
    if listed.at_s is not None:
        return trigger_at_time(listed.at_s, name=f"at {listed.at_s:g} s", hold_s=hold_s)
    trigger = always_trigger(armed_after_s=armed_after_s)
    if listed.when is not None:
        text = canonical_condition(listed.when, variables=variables)
        trigger = Trigger(name=text, condition=text, armed_after_s=armed_after_s)
    return held_for(trigger, hold_s) if hold_s else trigger
