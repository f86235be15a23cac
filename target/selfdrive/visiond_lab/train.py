"""Trains the neural nets of the lane detectors: `python -m selfdrive.visiond_lab.train [DETECTOR]`.

Training uses only rendered roads, drawn from the seed; the accuracy on different roads is printed. The net of
the detector as described (`paper`) is trained on pictures with all image effects at all levels, that of the
detector as coded (`as_coded`) on clean pictures. It takes minutes, or seconds with `--small`. Needs
scikit-learn.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier
from threadpoolctl import threadpool_limits

from selfdrive.common import compiled
from selfdrive.sim.compile_helpers import COMPILED_FOLDER
from selfdrive.sim.picture_options import AUTHORS_CODE_DETECTOR
from selfdrive.visiond.lane_net import AUTHORS_CODE_NET, HIDDEN_NODES, PAPER_NET, LaneNet
from selfdrive.visiond_lab.evaluate_on_real_frames import PAPER
from selfdrive.visiond_lab.training_windows import draw_labelled_windows

FULL_ROADS, SMALL_ROADS = (600, 60), (12, 4)  # roads for training and testing


class Training(NamedTuple):
    """How a net is trained. Without early stopping, training always takes the same steps."""

    path: Path
    with_effects: bool
    epochs: int
    weight_decay: float  # penalty on large weights


TRAINING_BY_DETECTOR = {
    PAPER: Training(PAPER_NET, with_effects=True, epochs=12, weight_decay=0.1),
    AUTHORS_CODE_DETECTOR: Training(AUTHORS_CODE_NET, with_effects=False, epochs=25, weight_decay=3e-3),
}


def train_net(features: np.ndarray, labels: np.ndarray, seed: int, training: Training) -> LaneNet:
    model = MLPClassifier(
        hidden_layer_sizes=(HIDDEN_NODES,),
        activation="tanh",
        alpha=training.weight_decay,
        batch_size=256,
        max_iter=training.epochs,
        n_iter_no_change=training.epochs,
        random_state=seed,
    )
    with threadpool_limits(1), warnings.catch_warnings():  # sums depend on the number of threads
        warnings.simplefilter("ignore", ConvergenceWarning)  # the limited number of iterations is intended
        model.fit(features, labels)
    hidden, out = (weights.astype(np.float32) for weights in model.coefs_)
    hidden_bias, out_bias = (bias.astype(np.float32) for bias in model.intercepts_)
    return LaneNet(hidden, hidden_bias, out[:, 0], out_bias)


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse_arguments(arguments)
    cv2.setNumThreads(1)
    compiled.use_libraries_in(COMPILED_FOLDER)
    training = TRAINING_BY_DETECTOR[options.detector]
    with_effects = training.with_effects
    scenes, others = SMALL_ROADS if options.small else FULL_ROADS
    learn, test = (np.random.default_rng([options.seed, purpose]) for purpose in (0, 1))
    windows = draw_labelled_windows(scenes, learn, with_effects=with_effects)
    net = train_net(*windows, options.seed, training)
    features, labels = draw_labelled_windows(others, test, with_effects=with_effects)
    marked = net.log_odds(features) > 0.0
    net.save(options.out or training.path)
    right_share, found_share, mistaken_share = (
        np.mean(part) for part in (marked == labels, marked[labels], marked[~labels])
    )
    print(f"{scenes} roads; {right_share:.1%} of {len(labels)} windows of others are classified correctly")
    print(f"with a mark: {found_share:.1%} found; without: {mistaken_share:.1%} mistaken for marks")
    return 0


def _parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m selfdrive.visiond_lab.train", description="Train the net of a lane detector."
    )
    parser.add_argument(
        "detector", nargs="?", choices=list(TRAINING_BY_DETECTOR), default=PAPER, help="whose net to train"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="the file to write")
    parser.add_argument("--small", action="store_true", help="few roads, for a trial")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
