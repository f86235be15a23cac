"""Fitting the confidence in lines with the same seed gives the same weights."""

import json

import numpy as np
import pytest
from selfdrive.visiond.edge_lines import EVIDENCE_NAMES
from selfdrive.visiond_lab import fit_confidence
from selfdrive.visiond_lab.fit_confidence import RIGHT_SHARE, draw_evidence, fit_weights


def test_a_line_as_often_right_as_required_has_even_odds():
    """Lines are right with logistic probability of one evidence; another has no influence."""
    rng = np.random.default_rng(3)
    evidence = rng.normal(0.0, 1.0, (20_000, 2))
    is_right = rng.random(20_000) < 1.0 / (1.0 + np.exp(-1.0 - 2.0 * evidence[:, 0]))
    bias, weight, other = fit_weights(evidence, is_right)
    assert weight == pytest.approx(2.0, abs=0.1) and other == pytest.approx(0.0, abs=0.1)
    assert bias == pytest.approx(1.0 - np.log(RIGHT_SHARE / (1.0 - RIGHT_SHARE)), abs=0.1)


def test_weights_are_rounded():
    rng = np.random.default_rng(4)
    evidence = rng.normal(0.0, 1.0, (500, 1))
    weights = fit_weights(evidence, evidence[:, 0] > rng.normal(0.0, 1.0, 500))
    assert weights == [float(f"{weight:.4g}") for weight in weights]


def test_evidence_is_reproducible():
    once, again = (list(draw_evidence(1)) for _ in range(2))
    assert once == again
    assert {len(evidence) for evidence, _ in once} == {len(EVIDENCE_NAMES)}


@pytest.mark.slow
def test_the_command_writes_the_same_bytes_twice(tmp_path, capsys):
    for name in ("a.json", "b.json"):
        assert fit_confidence.main(["--small", "--out", str(tmp_path / name)]) == 0
    assert "lines, of which" in capsys.readouterr().out
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert list(json.loads((tmp_path / "a.json").read_text())) == ["bias", *EVIDENCE_NAMES]
