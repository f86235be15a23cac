"""Interpolation tables and limits for plain floats."""

from math import nan

from selfdrive.common.interp import clip, interp

XP = (0.0, 5.0, 10.0)
FP = (1.0, 2.0, 4.0)


def test_interp_between_and_beyond_breakpoints() -> None:
    assert [interp(x, XP, FP) for x in (-1.0, 0.0, 2.5, 5.0, 7.5, 10.0, 99.0)] == [1, 1, 1.5, 2, 3, 4, 4]


def test_interp_takes_the_last_of_equal_breakpoints() -> None:
    assert interp(0.0, (0.0, 0.0, 1.0), (5.0, 7.0, 8.0)) == 7.0


def test_nan_has_a_defined_result() -> None:
    assert interp(nan, XP, FP) == 1.0
    assert clip(nan, -1.0, 1.0) == 1.0


def test_clip_limits_both_ways() -> None:
    assert [clip(x, -1.0, 2.0) for x in (-3.0, -1.0, 0.5, 2.0, 3.0)] == [-1.0, -1.0, 0.5, 2.0, 2.0]
