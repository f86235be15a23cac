"""A speed sensor that is wrong for a few steps has the effect that it has in openpilot v0.4.2."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest

REPO = Path(__file__).parents[4]
PAGE = REPO / "docs/explanation/speed-glitch.md"

# Contact and warning of the original (s), by scenario, mph, first step and number of steps.
ORIGINAL = {
    ("S5", 60, 1000, 2): (15.76, 15.60),
    ("S5", 60, 1200, 2): (16.30, None),
    ("S5", 10, 1000, 5): (17.21, None),
}
SMALLEST_GAPS = {"S1": 29.00, "S2": 12.28, "S3": 37.97, "S4": 15.77}  # m, of the original


@pytest.fixture
def glitches(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(REPO / "benchmarks")
    return importlib.import_module("glitch")


@pytest.mark.slow
@pytest.mark.parametrize("glitch", ORIGINAL)
def test_contact_and_warning_come_when_they_come_in_openpilot(glitches: ModuleType, glitch: tuple) -> None:
    """On the reference plant, within 0.07 s."""
    ran = glitches.drive(glitches.Glitch(*glitch), "reference")
    contact, warning = ORIGINAL[glitch]
    assert ran.contact == pytest.approx(contact, abs=0.07)
    assert ran.warning == (warning and pytest.approx(warning, abs=0.07))


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALLEST_GAPS)
def test_other_scenarios_leave_the_gap_that_openpilot_leaves(glitches: ModuleType, name: str) -> None:
    ran = glitches.drive(glitches.Glitch(name, 60, 1000, 2), "reference")
    assert ran.contact is None
    assert ran.gap == pytest.approx(SMALLEST_GAPS[name], abs=0.12)


def test_a_single_step_is_a_knife_edge(glitches: ModuleType) -> None:
    """The car stops within centimetres of the lead, so the plants differ in whether it touches."""
    glitch = glitches.Glitch("S5", 60, 1000, 1)
    assert glitches.drive(glitch, "reference").contact == pytest.approx(18.11, abs=0.005)
    ran = glitches.drive(glitch, "standard")
    assert ran.contact is None and ran.gap == pytest.approx(0.064, abs=0.0005)


@pytest.mark.slow
def test_the_page_shows_what_its_command_prints(glitches: ModuleType) -> None:
    page = PAGE.read_text()
    assert [line for line in glitches.lines() if line not in page] == []
