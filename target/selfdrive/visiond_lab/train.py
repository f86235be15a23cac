"""Trains the neural net of the paper's lane detector: `python -m selfdrive.visiond_lab.train`.

Training uses only rendered roads, drawn from the seed; the accuracy on different roads is printed. It takes
minutes, or seconds with `--small`. Needs scikit-learn.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier
from threadpoolctl import threadpool_limits

from selfdrive.visiond.lane_net import HIDDEN_NODES, PAPER_NET, LaneNet
from selfdrive.visiond_lab.training_windows import draw_labelled_windows

FULL_ROADS, SMALL_ROADS = (600, 60), (12, 4)  # roads for training and testing
EPOCHS = 25  # without early stopping, so that training always takes the same steps
WEIGHT_DECAY = 3e-3  # penalty on large weights


def train_net(features: np.ndarray, labels: np.ndarray, seed: int) -> LaneNet:
    model = MLPClassifier(
        hidden_layer_sizes=(HIDDEN_NODES,),
        activation="tanh",
        alpha=WEIGHT_DECAY,
        batch_size=256,
        max_iter=EPOCHS,
        n_iter_no_change=EPOCHS,
        random_state=seed,
    )
    with threadpool_limits(1), warnings.catch_warnings():  # sums depend on the number of threads
        warnings.simplefilter("ignore", ConvergenceWarning)  # the limited number of iterations is intended
        model.fit(features, labels)
    hidden, out = (weights.astype(np.float32) for weights in model.coefs_)
    hidden_bias, out_bias = (bias.astype(np.float32) for bias in model.intercepts_)
    return LaneNet(hidden, hidden_bias, out[:, 0], out_bias)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m selfdrive.visiond_lab.train", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=PAPER_NET, help="the file to write")
    parser.add_argument("--small", action="store_true", help="few roads, for a trial")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    scenes, others = SMALL_ROADS if options.small else FULL_ROADS
    learn, test = (np.random.default_rng([options.seed, purpose]) for purpose in (0, 1))
    net = train_net(*draw_labelled_windows(scenes, learn), options.seed)
    features, labels = draw_labelled_windows(others, test)
    marked = net.log_odds(features) > 0.0
    net.save(options.out)
    right_share, found_share, mistaken_share = (
        np.mean(part) for part in (marked == labels, marked[labels], marked[~labels])
    )
    print(f"{scenes} roads; {right_share:.1%} of {len(labels)} windows of others are classified correctly")
    print(f"with a mark: {found_share:.1%} found; without: {mistaken_share:.1%} mistaken for marks")
    return 0


if __name__ == "__main__":
    sys.exit(main())
