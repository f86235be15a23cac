"""Fits how sure the paper's detector is of a line: `python -m selfdrive.visiond_lab.fit_confidence`.

The detector examines rendered roads, drawn from the seed, behind all image effects at all levels. A logistic
function of its evidence is fitted to whether each line is right, and moved so that of the lines with
probability MIN_CONFIDENT, RIGHT_SHARE are right. Weights are rounded, so that they do not depend on the
processor. Needs scikit-learn; fit again after a change of the net, the effects, or the renderer.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from math import log
from pathlib import Path

import cv2
import numpy as np
from sklearn.linear_model import LogisticRegression
from threadpoolctl import threadpool_limits

from selfdrive.common import compiled
from selfdrive.messages import CameraView
from selfdrive.sim.compile_helpers import COMPILED_FOLDER
from selfdrive.visiond.compiled_paper import build_paper_detector
from selfdrive.visiond.edge_lines import EVIDENCE_NAMES, line_evidence
from selfdrive.visiond.line_confidence import PAPER_CONFIDENCE
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond_lab.judged_frames import SIDES, JudgedFrame, render_frames
from selfdrive.visiond_lab.random_effects import random_effect, random_moment
from selfdrive.visiond_lab.real_picture_features import degrade_like_bad_camera

FITTED_SEED = 47, 2  # of roads; judged roads have another
FITTED_POSE_SIGMAS = 0.6, 0.02  # m, rad: faults take the car further than usual
ROADS, SMALL_ROADS, PICTURES_PER_ROAD = 300, 20, 10
CLEAN_SHARE, BAD_CAMERA_SHARE = 0.1, 0.3  # of the pictures: without effect, from a bad camera
RIGHT_SHARE = 0.75  # of lines whose probability is MIN_CONFIDENT
WEIGHT_DIGITS = 4  # of the fitted weights
LEAST_PENALTY = 100.0  # inverse strength of the penalty on large weights
Evidence = tuple[tuple[float, ...], bool]  # of a line, and whether it is right


def draw_evidence(roads: int) -> Iterator[Evidence]:
    """Examine each road in several pictures; a line that the detector does not report is left out."""
    for number, frame in enumerate(render_frames(roads, FITTED_SEED, FITTED_POSE_SIGMAS)):
        rng = np.random.default_rng([*FITTED_SEED, number, PICTURES_PER_ROAD])
        detector = build_paper_detector(frame.model)
        for _ in range(PICTURES_PER_ROAD):
            picture = frame.picture
            if rng.random() < BAD_CAMERA_SHARE:
                picture = degrade_like_bad_camera(picture, rng)
            effect, moment = random_effect(frame.model, rng, CLEAN_SHARE), random_moment(rng)
            if effect:
                picture = np.asarray(effect.apply(picture, moment))
            yield from _lines_evidence(detector, frame, picture)


def _lines_evidence(detector: PaperDetector, frame: JudgedFrame, picture: np.ndarray) -> Iterator[Evidence]:
    lines = detector.fit_lines(_view_of(picture))
    for side in SIDES:
        line, other = lines[side], lines[1 - side]
        if line is not None:
            evidence = line_evidence(line, 1.0 - 2.0 * side, other)
            yield evidence, frame.is_right(side, line)


def _view_of(picture: np.ndarray) -> CameraView:
    return CameraView(left_lane_y=0.0, right_lane_y=0.0, path_y=0.0, bend=(), lead_d_rel=0.0, picture=picture)


def fit_weights(evidence: np.ndarray, is_right: np.ndarray) -> list[float]:
    """The bias, and the weight of each column of `evidence`."""
    mean, spread = evidence.mean(axis=0), evidence.std(axis=0)
    model = LogisticRegression(C=LEAST_PENALTY, max_iter=10_000, tol=1e-8)
    with threadpool_limits(1):
        model.fit((evidence - mean) / spread, is_right)
    weights = model.coef_[0] / spread
    bias = float(model.intercept_[0] - (weights * mean).sum()) - log(RIGHT_SHARE / (1.0 - RIGHT_SHARE))
    return [float(f"{weight:.{WEIGHT_DIGITS}g}") for weight in (bias, *weights.tolist())]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="selfdrive.visiond_lab.fit_confidence",
        description="Fit the paper's detector's confidence in its lines on rendered roads.",
    )
    parser.add_argument("--out", type=Path, default=PAPER_CONFIDENCE, help="the file to write")
    parser.add_argument("--small", action="store_true", help="few roads, for a trial")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    compiled.use_libraries_in(COMPILED_FOLDER)
    roads = SMALL_ROADS if options.small else ROADS
    evidence, is_right = zip(*draw_evidence(roads), strict=True)
    weights = fit_weights(np.array(evidence), np.array(is_right))
    text = json.dumps(dict(zip(("bias", *EVIDENCE_NAMES), weights, strict=True)), indent=1)
    options.out.write_text(text + "\n", encoding="utf-8")
    print(f"{roads} roads, {len(is_right)} lines, of which {np.mean(is_right):.1%} are right")
    return 0


if __name__ == "__main__":
    sys.exit(main())
