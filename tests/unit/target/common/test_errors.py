"""Errors that a user can correct."""

from selfdrive.common.errors import ConfigError


def test_an_error_names_place_expectation_and_remedy() -> None:
    error = ConfigError("speed_mph is -3", where="S1.yaml", line=4, expected="0 or more", remedy="correct it")
    assert str(error) == "S1.yaml:4: speed_mph is -3, expected 0 or more; correct it"
