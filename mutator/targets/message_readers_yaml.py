"""A reader of messages as written in a manifest."""

import ast

from pydantic import Field

from mutator.config.instance_conditions import canonical_instance_condition
from mutator.config.location_syntax import is_assignable, is_message_expression
from mutator.config.location_yaml import LocationModel
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS
from mutator.targets.message_readers import MessageReader


class MessageReaderModel(StrictModel, title="A reader of messages"):
    """A place at which a part of the target gets its messages. Give either `queue` or `message`."""

    about: str = Field("", description="Which part of the target reads here.")
    at: LocationModel = Field(description="The statement before or after which the messages are there.")
    queue: str | None = Field(
        None,
        description="The variable with a list of messages, in order, which the function goes through. `None` "
        "in it is no message.",
    )
    message: str | None = Field(
        None,
        description="The variable with the only message, in a callback; a message that is lost or late ends "
        "the call. Without a queue, no message can be repeated or overtaken.",
    )
    topic: str | None = Field(
        None,
        description="The topic of a message, as an expression of `message`: attributes, items, and calls "
        "without arguments (`message.which()`, `message[0]`). Without it, all messages are of one topic.",
    )
    topics: list[str] | dict[str, str | int] = Field(
        description="The topics: names, or name -> the value of `topic`."
    )
    where: str | None = Field(
        None,
        description="A condition that selects one reader if several share the code, as in an "
        "[injection](fault-spec.md#an-injection): `'modelV2' in self.services`.",
    )


def build_message_readers(
    models: dict[str, MessageReaderModel], source: YamlSource
) -> dict[str, MessageReader]:
    return {name: _build_reader(name, model, source) for name, model in models.items()}


def _build_reader(name: str, model: MessageReaderModel, source: YamlSource) -> MessageReader:
    keys: KeyPath = ("messages", name)
    location = model.at.build_location(source, (*keys, "at"))
    if location.anchor.kind in VALUE_ANCHORS | LOAD_TIME_ANCHORS:
        raise source.error(
            (*keys, "at"), f"`{location.anchor.kind.value}`", expected="a statement, such as `entry: true`"
        )
    if (model.queue is None) == (model.message is None):
        raise source.error(
            keys,
            "neither `queue` nor `message`" if model.queue is None else "both `queue` and `message`",
            expected="one of them: the variable with the messages, or with the only one",
        )
    for key in ("queue", "message"):
        variable = getattr(model, key)
        if variable is not None and not is_assignable(variable):
            raise source.error((*keys, key), f"'{variable}'", expected="a variable as in the source")
    if model.topic is not None and not is_message_expression(model.topic):
        raise source.error(
            (*keys, "topic"),
            f"'{model.topic}'",
            expected="an expression of `message`: attributes, items, and calls without arguments",
            remedy="write, e.g., `message.topic`, `message[0]` or `message.which()`",
        )
    topics = model.topics if isinstance(model.topics, dict) else {topic: topic for topic in model.topics}
    if not topics or (model.topic is None and len(topics) > 1):
        raise source.error(
            (*keys, "topics"),
            f"{len(topics)} topics",
            expected="one topic, or `topic`, which tells them apart" if topics else "at least one topic",
        )
    return MessageReader(
        name=name,
        location=location,
        queue=model.queue,
        message=model.message,
        topic=None if model.topic is None else ast.unparse(ast.parse(model.topic, mode="eval")),
        value_by_topic=topics,
        where=_condition(model.where, source, (*keys, "where")),
    )


def _condition(text: str | None, source: YamlSource, keys: KeyPath) -> str | None:
    if text is None:
        return None
    try:
        return canonical_instance_condition(text)
    except ValueError:
        raise source.error(
            keys,
            f"'{text}'",
            expected="names, attributes, items, constants, comparisons, `and`, `or` and `not`",
            remedy="use something that the function knows",
        ) from None
