"""Ctrl-C and SIGTERM end a command cleanly, once any running native code has returned."""

import signal

import pytest

from mutator._common.interrupts import delaying_interrupts, raising_keyboard_interrupts

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_raises_a_keyboard_interrupt(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), raising_keyboard_interrupts():
        signal.raise_signal(number)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", SIGNALS)
def test_a_held_signal_waits_until_the_outermost_block_ends(number: signal.Signals) -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), raising_keyboard_interrupts(), delaying_interrupts():
        with delaying_interrupts():
            signal.raise_signal(number)
            done.append("inner")
        done.append("outer")
    assert done == ["inner", "outer"]
    with raising_keyboard_interrupts(), delaying_interrupts():
        pass  # the signal is raised only once


def test_a_held_signal_is_raised_before_the_error() -> None:
    with pytest.raises(KeyboardInterrupt), raising_keyboard_interrupts(), delaying_interrupts():
        signal.raise_signal(signal.SIGINT)
        raise ValueError


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with raising_keyboard_interrupts():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
