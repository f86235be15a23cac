"""Measures of severity on images with known values, and the page of these measures."""

import re
from math import inf
from pathlib import Path

import numpy as np
import pytest
from selfdrive.sim.effects import effects_page
from selfdrive.sim.effects.degradation import DegradationGauge
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT

REFERENCE = Path(__file__).parents[4] / "docs" / "reference"


@pytest.fixture
def gauge(camera):
    return DegradationGauge(camera, ((1.85, 0.0), (-1.85, 0.0)))


def test_a_clean_image_has_no_error_full_contrast_and_no_false_edges(gauge, road):
    assert gauge.measure(road, road) == pytest.approx((inf, 120.0, 0.0))


def test_contrast_and_psnr_follow_the_levels(gauge, road):
    psnr, contrast, _ = gauge.measure(road, road // 2)
    error = (road.astype(float) - road // 2) ** 2
    assert contrast == pytest.approx(60.0, abs=1.0)
    assert psnr == pytest.approx(10.0 * np.log10(255.0**2 / error.mean()))


def test_only_edges_between_the_lines_are_false_edges(gauge, road, camera):
    inside, outside = road.copy(), road.copy()
    inside[:, 310:330:8] = 215
    outside[:, :40:8] = 215
    assert gauge.measure(road, inside).false_edges > 0.02
    assert gauge.measure(road, outside).false_edges == 0.0


def test_weak_edges_are_false_edges_only_between_weak_lines(gauge, road):
    weak = (road // 3).copy()
    strong = road.copy()
    weak[:, 310:330:8] = 60
    strong[:, 310:330:8] = 120
    assert gauge.measure(road, weak).false_edges > 0.02
    assert gauge.measure(road, strong).false_edges == 0.0


def test_pixels_are_covered_if_an_even_grey_changes_by_8_levels(gauge, road):
    grey = np.full_like(road, 100)
    assert gauge.covered_share(grey // 2) == 0.0
    half = grey.copy()
    half[:, :300] = 107
    assert gauge.covered_share(half) == 0.0
    half[:, :300] = 108
    assert 0.2 < gauge.covered_share(half) < 0.5


def test_the_page_has_every_effect_and_level():
    text = (REFERENCE / "image-effects.md").read_text(encoding="utf-8")
    for effect, amounts in AMOUNTS_BY_EFFECT.items():
        part = re.search(rf"^### {effect.__name__}$(.*?)(?=^##|\Z)", text, re.MULTILINE | re.DOTALL)
        assert part and (REFERENCE / "image-effects" / f"{effect.__name__}.jpg").is_file()
        found = re.findall(r"^\| \d+ \| (\S+) \|", part[1], re.MULTILINE)
        assert [float(amount) for amount in found] == list(map(float, amounts))


@pytest.mark.slow
def test_the_page_is_what_the_command_writes(tmp_path):
    """After a change of effects or detectors, run `python -m selfdrive.sim.effects.effects_page`."""
    effects_page.write_page(tmp_path)
    made, kept = (folder / "image-effects.md" for folder in (tmp_path, REFERENCE))
    assert made.read_text(encoding="utf-8") == kept.read_text(encoding="utf-8")
