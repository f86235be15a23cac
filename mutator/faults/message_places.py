"""Find the place of an injection that names a message instead of a place in the source."""

from dataclasses import replace

from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.config.instance_conditions import canonical_instance_condition
from mutator.config.location_syntax import defence_at
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, FaultModels
from mutator.faults.injection_specs import InjectionSpec, ParamSpec
from mutator.model import FaultLocation, Injection
from mutator.targets.manifest import TargetManifest
from mutator.targets.message_readers import MessageReader

_READER_PARAMS = ("queue", "message", "topic", "name")  # parameters of fault models that a reader sets


def locate_injection(injection: InjectionSpec, manifest: TargetManifest, source: YamlSource) -> InjectionSpec:
    """Return the injection at the place where its message is read, or in the model of its defence; others
    unchanged.

    The reader's variables become parameters, and its `where` part of the injection's. MutatorError with file
    and line if the manifest declares no such reader or topic, or if the spec sets these parameters, too.
    """
    place = injection.message
    if place is None:
        return _in_package_of_defences(injection, manifest)
    keys = (*injection.keys, "message")
    readers, declared = manifest.message_readers, f"declared in `messages` of {manifest.path.name}"
    if place.reader not in readers:
        raise source.error(
            (*keys, "reader"),
            f"reader '{place.reader}'",
            expected=f"{describe_choices(readers)}, {declared}" if readers else f"a reader {declared}",
            remedy="correct it, or declare the reader" + spelling_suggestion(place.reader, list(readers)),
        )
    reader = readers[place.reader]
    topics = reader.value_by_topic
    if place.topic not in topics:
        raise source.error(
            (*keys, "topic"),
            f"topic '{place.topic}' of reader '{reader.name}'",
            expected=f"{describe_choices(topics)}, {declared}",
            remedy="correct it, or declare the topic" + spelling_suggestion(place.topic, list(topics)),
        )
    for param in injection.params:
        if param.name in _READER_PARAMS:
            raise source.error(
                param.keys,
                f"'{param.key}' in the parameters of a message",
                expected=f"no such parameter: {manifest.path.name} sets it for reader '{reader.name}'",
                remedy="leave it out, or name the place with `at` instead of `message`",
            )
    return replace(
        injection,
        location=reader.location,
        message=None,
        params=(*injection.params, *_params_of(reader, place.topic, injection)),
        where=_both(reader.where, injection.where),
    )


def _in_package_of_defences(injection: InjectionSpec, manifest: TargetManifest) -> InjectionSpec:
    """Return an injection at a defence with the path that its model has in defended trees."""
    location, package = injection.location, manifest.probe_package
    if location is None or package is None or not defence_at(location.path) or "/" in location.path:
        return injection
    return replace(injection, location=replace(location, path=f"{package}/{location.path}"))


def check_changes_messages(located: InjectionSpec, model: FaultModel, models: FaultModels) -> None:
    """Check that the model can change a message that comes in this way, in a queue or alone."""
    needed = {param.name for param in located.params if param.name in _READER_PARAMS}
    if not _can_change(model, needed):
        alone = " that comes alone, without a queue" if "message" in needed else ""
        raise MutatorError(
            f"model {model.name} at a message{alone}",
            expected=describe_choices([other.name for other in models if _can_change(other, needed)]),
            remedy="use one of these models, or name a place in the source with `at`",
        )


def changes_messages(model: FaultModel) -> bool:
    """Return whether a fault model changes messages of a topic."""
    topic = model.param("topic")
    return topic is not None and topic.type == "expression"


def describe_message(injection: Injection, manifest: TargetManifest) -> str:
    """Return `a message of topic 'gap'`; without the topic's name if the manifest has no such reader."""
    params = dict(injection.params)
    topic, value = params.get("topic"), params.get("name")
    for reader in manifest.message_readers.values():
        if reader.location != injection.location or reader.topic != topic:
            continue
        for name, value_of_topic in reader.value_by_topic.items():
            if topic is None or value_of_topic == value:
                return f"a message of topic '{name}'"
    return "a message" if topic is None else f"a message with `{topic} == {value!r}`"


def _can_change(model: FaultModel, needed: set[str]) -> bool:
    return all(model.param(name) for name in needed)


def location_of(injection: InjectionSpec, manifest: TargetManifest, source: YamlSource) -> FaultLocation:
    """Return where an injection is made; errors as for `locate_injection`."""
    location = locate_injection(injection, manifest, source).location
    assert location is not None, "an injection names a place or a message"
    return location


def _params_of(reader: MessageReader, topic: str, injection: InjectionSpec) -> list[ParamSpec]:
    values: dict[str, str | int | None] = {"queue": reader.queue, "message": reader.message}
    if reader.topic is not None:
        values |= {"topic": reader.topic, "name": reader.value_by_topic[topic]}
    keys = (*injection.keys, "message")
    return [
        ParamSpec(name=name, unit=None, value=value, keys=keys, is_literal=True)
        for name, value in values.items()
        if value is not None
    ]


def _both(first: str | None, second: str | None) -> str | None:
    if first is None or second is None:
        return first or second
    return canonical_instance_condition(f"({first}) and ({second})")
