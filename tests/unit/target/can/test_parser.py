"""The parser accepts only frames with a valid size, checksum and counter, and detects missing messages."""

import pytest
from selfdrive.can.dbc import load_dbc
from selfdrive.can.packer import MessagePacker
from selfdrive.can.parser import CanParser, ExpectedMessage
from selfdrive.car.honda.values import CAR_DBC

MESSAGES = load_dbc(CAR_DBC)
EXPECTED = {
    "ENGINE_DATA": ExpectedMessage(("XMISSION_SPEED",), 100, (-1,)),
    "WHEEL_SPEEDS": ExpectedMessage(("WHEEL_SPEED_FL",), 50),
}


@pytest.fixture
def parser():
    return CanParser(MESSAGES, EXPECTED, bus=0)


@pytest.fixture
def speed():
    return MessagePacker(MESSAGES["ENGINE_DATA"], ("XMISSION_SPEED",))


@pytest.fixture
def wheels():
    return MessagePacker(MESSAGES["WHEEL_SPEEDS"], ("WHEEL_SPEED_FL",))


def test_values_are_defaults_before_the_first_frame(parser):
    parser.update([], 0.0)
    assert parser.values == {"ENGINE_DATA": (-1,), "WHEEL_SPEEDS": (0,)}
    assert not parser.valid


def test_the_bus_is_valid_once_every_message_has_arrived(parser, speed, wheels):
    parser.update([speed.pack((50.0,), 0)], 0.0)
    assert not parser.valid
    parser.update([speed.pack((51.0,), 1), wheels.pack((52.0,))], 0.01)
    assert parser.valid
    assert parser.values["ENGINE_DATA"] == pytest.approx((51.0,))
    assert parser.values["WHEEL_SPEEDS"] == pytest.approx((52.0,))
    assert parser.updated == ["ENGINE_DATA", "WHEEL_SPEEDS"]


@pytest.mark.parametrize("bit", range(64))
def test_a_frame_with_any_flipped_bit_is_rejected(parser, speed, bit):
    frame = speed.pack((50.0,), 0)
    broken = (int.from_bytes(frame.data, "big") ^ (1 << bit)).to_bytes(8, "big")
    parser.update([frame._replace(data=broken)], 0.0)
    assert parser.values["ENGINE_DATA"] == (-1,)
    assert parser.updated == []


@pytest.mark.parametrize("change", [{"bus": 1}, {"address": 0x999}, {"data": b"\0" * 7}])
def test_frames_of_another_bus_address_or_size_are_ignored(parser, speed, change):
    parser.update([speed.pack((50.0,), 0)._replace(**change)], 0.0)
    assert parser.values["ENGINE_DATA"] == (-1,)


def test_the_bus_is_invalid_after_more_than_ten_missed_periods(parser, speed, wheels):
    parser.update([speed.pack((50.0,), 0), wheels.pack((50.0,))], 1.0)
    for step in range(1, 11):
        parser.update([wheels.pack((50.0,))], 1.0 + step / 100)
        assert parser.valid
    parser.update([wheels.pack((50.0,))], 1.11)
    assert not parser.valid
    parser.update([speed.pack((50.0,), 1)], 1.12)
    assert parser.valid


def test_slower_messages_have_longer_timeouts(parser, speed, wheels):
    """At 50 Hz, ten missed periods are 0.2 s."""
    parser.update([wheels.pack((50.0,))], 1.0)
    for step in range(1, 21):
        parser.update([speed.pack((50.0,), step)], 1.0 + step / 100)
        assert parser.valid
    parser.update([speed.pack((50.0,), 21)], 1.21)
    assert not parser.valid


def test_four_frames_with_a_repeated_counter_are_accepted(parser, speed):
    for repeat in range(8):
        parser.update([speed.pack((float(repeat),), 0)], repeat / 100)
    assert parser.values["ENGINE_DATA"] == pytest.approx((4.0,))


def test_a_frame_after_a_lost_one_is_accepted(parser, speed):
    parser.update([speed.pack((1.0,), 0)], 0.0)
    parser.update([speed.pack((2.0,), 2)], 0.02)
    assert parser.values["ENGINE_DATA"] == pytest.approx((2.0,))


def test_frames_are_accepted_again_once_the_counter_is_correct(parser, speed):
    for repeat in range(8):
        parser.update([speed.pack((1.0,), 0)], repeat / 100)
    for counter in range(1, 5):
        parser.update([speed.pack((2.0,), counter)], 0.1 + counter / 100)
    assert parser.values["ENGINE_DATA"] == pytest.approx((2.0,))
