"""The CAN encoder and decoder agree with cantools on every message of the car and its radar."""

from functools import cache

import cantools
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from selfdrive.can.dbc import CHECKSUM, COUNTER, load_dbc
from selfdrive.can.packer import MessagePacker, encode_payload
from selfdrive.can.parser import decode_payload
from selfdrive.car.honda.values import CAR_DBC, RADAR_DBC

load_reference = cache(cantools.database.load_file)
MESSAGES = [(path, name) for path in (CAR_DBC, RADAR_DBC) for name in load_dbc(path)]


@pytest.mark.parametrize(("path", "name"), MESSAGES, ids=lambda value: str(value).rsplit("/", 1)[-1])
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_pack_and_decode_agree_with_cantools(path, name, data):
    message = load_dbc(path)[name]
    reference = load_reference(path).get_message_by_name(name)
    signals = [n for n in message.fields if n not in (COUNTER, CHECKSUM)]
    raw = {n: data.draw(st.integers(0, message.fields[n].mask), label=n) for n in signals}
    physical = {}
    for n, value in raw.items():
        field = message.fields[n]
        physical[n] = ((value ^ field.sign_bit) - field.sign_bit) * field.factor + field.offset
    counter = data.draw(st.integers(0, 1000), label="counter")

    frame = MessagePacker(message, signals).pack(tuple(physical.values()), counter)

    read = reference.decode(frame.data, decode_choices=False)
    assert len(frame.data) == reference.length
    assert {n: read[n] for n in signals} == pytest.approx(physical)
    if COUNTER in message.fields:
        assert read[COUNTER] == counter % 4
    ours = decode_payload([message.fields[n] for n in signals], int.from_bytes(frame.data, "big"))
    assert ours == pytest.approx(tuple(physical.values()))


def test_checksum_of_a_known_frame():
    """The nibbles of address, data and checksum add up to 8 modulo 16, as the car requires."""
    frame = MessagePacker(load_dbc(CAR_DBC)["ENGINE_DATA"], ("XMISSION_SPEED",)).pack((96.56,), 2)
    halves = [int(digit, 16) for digit in f"{frame.address:x}" + frame.data.hex()]
    assert frame.data[:2] == (9656).to_bytes(2, "big")
    assert sum(halves) % 16 == 8


@pytest.mark.parametrize(
    ("value", "raw"),
    [
        (-1.0, 0),
        (0.004, 0),
        (0.006, 1),
        (1e9, 0x7FFF),
        (float("inf"), 0x7FFF),
        (float("-inf"), 0),
        (float("nan"), 0),
    ],
)
def test_unsigned_values_round_and_stay_in_range(value, raw):
    field = load_dbc(CAR_DBC)["WHEEL_SPEEDS"].fields["WHEEL_SPEED_FL"]
    assert encode_payload([field], [value]) == raw << field.shift


@pytest.mark.parametrize(
    ("value", "raw"), [(-1e9, 0x7FFF), (1e9, 0x8000), (-0.1, 1), (float("-inf"), 0x7FFF), (float("nan"), 0)]
)
def test_signed_values_stay_in_range(value, raw):
    """One count of the steering angle is -0.1 degrees."""
    field = load_dbc(CAR_DBC)["STEERING_SENSORS"].fields["STEER_ANGLE"]
    assert encode_payload([field], [value]) == raw << field.shift


def test_a_frame_does_not_depend_on_earlier_ones():
    used = MessagePacker(load_dbc(CAR_DBC)["ENGINE_DATA"], ("XMISSION_SPEED",))
    for kph in (50.0, 50.0, 51.0, 50.0):
        for counter in (0, 1, 5, 4):
            fresh = MessagePacker(load_dbc(CAR_DBC)["ENGINE_DATA"], ("XMISSION_SPEED",))
            assert used.pack((kph,), counter) == fresh.pack((kph,), counter)


@pytest.mark.parametrize("path", [CAR_DBC, RADAR_DBC], ids=lambda path: path.name)
def test_message_layouts_agree_with_cantools(path):
    reference = {message.name: message for message in load_reference(path).messages}
    assert list(load_dbc(path)) == list(reference)
    for name, message in load_dbc(path).items():
        other = reference[name]
        assert (message.address, message.size) == (other.frame_id, other.length)
        assert set(message.fields) == {signal.name for signal in other.signals}
        for signal in other.signals:
            field = message.fields[signal.name]
            assert field.mask.bit_length() == signal.length
            assert (field.sign_bit != 0) == signal.is_signed
            for ours, theirs in ((field.factor, signal.scale), (field.offset, signal.offset)):
                assert (ours, type(ours)) == (theirs, type(theirs))


@pytest.mark.parametrize(
    ("signal", "complaint"),
    [
        ('SG_ S : 0|8@1+ (1,0) [0|255] "" A', "big-endian"),
        ('SG_ S m0 : 7|8@0+ (1,0) [0|255] "" A', "plain"),
        ('SG_ S : 63|9@0+ (1,0) [0|511] "" A', "beyond the message's 8 bytes"),
    ],
)
def test_unsupported_layouts_are_refused(tmp_path, signal, complaint):
    dbc = tmp_path / "other.dbc"
    dbc.write_text(f'VERSION ""\nBU_: A\nBO_ 1 M: 8 A\n {signal}\n')
    with pytest.raises(ValueError, match=rf"other\.dbc:4.*{complaint}"):
        load_dbc(dbc)
