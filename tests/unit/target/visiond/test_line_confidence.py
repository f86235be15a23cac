"""How sure detectors are of their lines."""

import json
from math import exp, nan

import pytest
from selfdrive.visiond.edge_lines import EVIDENCE_NAMES, FittedLine, line_evidence
from selfdrive.visiond.line_confidence import MIN_CONFIDENT, PAPER_CONFIDENCE, LineConfidence
from selfdrive.visiond.paper_detector import complete_lane


def test_the_probability_is_a_logistic_function_of_the_evidence():
    confidence = LineConfidence([0.5, 2.0, -1.0])
    assert confidence.probability((1.0, 3.0)) == pytest.approx(1.0 / (1.0 + exp(0.5)))
    assert confidence.probability((1e9, 0.0)) == pytest.approx(1.0)
    assert confidence.probability((0.0, 1e9)) == 0.0


def test_evidence_that_is_not_a_number_gives_no_confidence():
    assert LineConfidence([0.0, 1.0]).probability((nan,)) == 0.0


def test_the_shipped_weights_name_their_evidence():
    assert tuple(json.loads(PAPER_CONFIDENCE.read_text())) == ("bias", *EVIDENCE_NAMES)


def test_more_edges_make_a_line_surer_and_a_lane_of_strange_width_less_sure():
    confidence = LineConfidence.load(PAPER_CONFIDENCE)
    usual = FittedLine(1.85, 0.0, 150.0, 20.0, 0.01, 0.45, 0.12)
    right = usual._replace(y=-1.85)

    def probability(line: FittedLine, other: FittedLine | None = right) -> float:
        return confidence.probability(line_evidence(line, 1.0, other))

    assert probability(usual._replace(pixels=30.0)) < probability(usual) > MIN_CONFIDENT
    assert probability(usual._replace(y=4.5)) < MIN_CONFIDENT
    assert probability(usual, right._replace(y=-4.0)) < probability(usual)


def test_the_path_is_led_only_by_lines_of_which_the_detector_is_confident():
    confidence = LineConfidence.load(PAPER_CONFIDENCE)
    line = FittedLine(1.95, 0.0, 150.0, 20.0, 0.01, 0.45, 0.12)
    doubtful = FittedLine(-5.5, 0.05, 24.0, 4.0, 0.02, 0.13, 0.4)
    lines = complete_lane(line, doubtful, confidence)
    assert lines.right.y == -5.5 and 0.0 < lines.right.prob < MIN_CONFIDENT < lines.left.prob
    assert lines.path.y == pytest.approx(1.95 - 1.85)
    assert complete_lane(None, doubtful, confidence).path.prob == 0.0
