"""Injections that name a message are made where the manifest says that it is read."""

from dataclasses import replace

import pytest

from mutator.errors import MutatorError
from mutator.faults.message_places import describe_message
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection
from mutator.targets.message_readers import MessageReader
from mutator.workspace import Workspace

SENSE = FaultLocation(
    path="toycar/sensing.py", function="Sensor.sense", anchor=Anchor(kind=AnchorKind.ENTRY, name="")
)
CAR = MessageReader(
    name="car",
    location=SENSE,
    queue="frames",
    message=None,
    topic="message[0]",
    value_by_topic={"speed": 464, "gap": "gap"},
    where="self.bus == 1",
)
SCAN = replace(
    CAR, name="scan", queue=None, message="scan", topic=None, value_by_topic={"scan": "scan"}, where=None
)
SPEC = """\
schema: fault_spec/1
module: bus
fault_type: late
about: A message is late.
variants:
  late:
    about: It is late.
    draw: {lag_s: {values: [0.5]}}
    as_described:
      injections:
        - message: {topic: speed, reader: car}
          model: message_delay
          params: {delay_s: lag}
          where: self.speed > 3
"""


def injection(toycar: Workspace, text: str, car: MessageReader = CAR) -> Injection:
    path = toycar.library / "late.yaml"
    path.write_text(text)
    manifest = replace(toycar.manifest("toycar"), message_readers={"car": car, "scan": SCAN})
    (fault,) = expand_spec(toycar.spec(path), 1, models=toycar.fault_models(), manifest=manifest)
    return fault.injections[0]


def test_a_message_of_a_queue_is_changed_where_it_is_read(toycar: Workspace) -> None:
    """The reader gives place, variable and topic; its condition and that of the spec both hold."""
    found = injection(toycar, SPEC)
    assert found.location == SENSE and found.where == "self.bus == 1 and self.speed > 3"
    assert dict(found.params) == {"delay": 0.5, "name": 464, "queue": "frames", "topic": "message[0]"}


def test_a_callback_needs_no_topic(toycar: Workspace) -> None:
    found = injection(toycar, SPEC.replace("topic: speed, reader: car", "topic: scan, reader: scan"))
    assert dict(found.params) == {"delay": 0.5, "message": "scan"} and found.where == "self.speed > 3"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("reader: car", "reader: cars", r"11: reader 'cars'; expected .*did you mean 'car'"),
        ("topic: speed", "topic: spede", r"11: topic 'spede' of reader 'car'; expected .*'speed'"),
        ("- message: {topic: speed, reader: car}\n          model", "- model", "neither `at` nor `message`"),
        ("model: message_delay", "model: offset", "model offset at a message; expected .*message_loss"),
        (
            "message_delay\n          params: {delay_s: lag}",
            "message_delay\n          params: {delay_s: lag, topic: 1 + 1}",
            r"13: 'topic' in the parameters of a message; expected .*toycar.yaml sets it for reader 'car'",
        ),
        (
            "message_delay\n          params: {delay_s: lag}",
            "message_delay\n          params: {delay_s: lag, name: 1}",
            r"13: 'name' in the parameters of a message; .*; leave it out",
        ),
    ],
)
def test_a_mistake_is_refused_at_its_line(toycar: Workspace, old: str, new: str, said: str) -> None:
    assert SPEC.count(old) == 1
    with pytest.raises(MutatorError, match=said):
        injection(toycar, SPEC.replace(old, new))


@pytest.mark.parametrize("queue", ["queue", "message"])
def test_a_spec_cannot_set_the_variable_that_the_manifest_sets(toycar: Workspace, queue: str) -> None:
    with pytest.raises(MutatorError, match=f"'{queue}' in the parameters of a message"):
        injection(toycar, SPEC.replace("{delay_s: lag}", f"{{delay_s: lag, {queue}: other}}"))


@pytest.mark.parametrize("name", ["speed", "lag", "spead"])
def test_a_topic_is_no_draw_whatever_its_name(toycar: Workspace, name: str) -> None:
    """A topic that is called as the spec's draw, or similarly, keeps its value."""
    text = SPEC.replace("topic: speed", f"topic: {name}").replace("lag", "speed" if name != "lag" else name)
    found = injection(toycar, text, replace(CAR, value_by_topic={name: name}))
    assert dict(found.params)["name"] == name and dict(found.params)["delay"] == 0.5


@pytest.mark.parametrize("number", [464, -1, 2**53 + 1, 2**64 + 3])
def test_a_topic_that_is_an_integer_stays_one(toycar: Workspace, number: int) -> None:
    name = dict(injection(toycar, SPEC, replace(CAR, value_by_topic={"speed": number})).params)["name"]
    assert name == number and isinstance(name, int)


def test_a_large_integer_in_a_spec_keeps_its_value(toycar: Workspace) -> None:
    at = "at: {file: toycar/sensing.py, function: Sensor.sense, entry: true}"
    text = SPEC.replace("message: {topic: speed, reader: car}", at)
    text = text.replace(
        "{delay_s: lag}", f"{{delay_s: lag, queue: frames, topic: 'message[0]', name: {2**53 + 1}}}"
    )
    assert dict(injection(toycar, text).params)["name"] == 2**53 + 1


def test_an_expression_of_another_name_is_no_topic(toycar: Workspace) -> None:
    at = "at: {file: toycar/sensing.py, function: Sensor.sense, entry: true}"
    text = SPEC.replace("message: {topic: speed, reader: car}", at)
    text = text.replace("{delay_s: lag}", "{delay_s: lag, queue: frames, topic: 1 + 1, name: 1}")
    with pytest.raises(MutatorError, match="expected an expression of `message`"):
        injection(toycar, text)


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ({"topic": "message[0]", "name": 464}, "a message of topic 'speed'"),
        ({"topic": "message[0]", "name": 5}, "a message with `message[0] == 5`"),
        ({}, "a message of topic 'scan'"),
    ],
)
def test_a_message_is_described_by_its_topic(
    toycar: Workspace, params: dict[str, str | int], expected: str
) -> None:
    manifest = replace(toycar.manifest("toycar"), message_readers={"car": CAR, "scan": SCAN})
    lost = Injection(location=SENSE, model="message_loss", params=tuple(params.items()))
    assert describe_message(lost, manifest) == expected


@pytest.mark.parametrize("model", ["message_repetition", "message_reordering"])
def test_without_a_queue_no_message_is_repeated_or_overtaken(toycar: Workspace, model: str) -> None:
    text = SPEC.replace("topic: speed, reader: car", "topic: scan, reader: scan")
    text = text.replace("message_delay\n          params: {delay_s: lag}", model)
    with pytest.raises(MutatorError, match=f"model {model} at a message that comes alone"):
        injection(toycar, text)
