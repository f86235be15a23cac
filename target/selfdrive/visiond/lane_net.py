"""The neural net that recognises windows with a lane mark."""

from math import tanh
from pathlib import Path

import numpy as np

from selfdrive.common.array_math import each

# the net of the detector as the paper describes it, and that of the detector as its authors coded it
PAPER_NET, AUTHORS_CODE_NET = (
    Path(__file__).with_name(f"{name}_net.npz") for name in ("paper", "authors_code")
)
HIDDEN_NODES = 10  # as in the paper
FEATURE_STEPS, WEIGHT_STEPS = 2**12, 2**20  # per unit of features and weights
WINDOWS_AT_ONCE = 32  # windows; for more, allocating memory takes longer than the sums


class LaneNet:
    """Weights `hidden` (features x 10), `hidden_bias` (10), `out` (10) and `out_bias` (1), float32.

    `whole` is `hidden` in integer steps, as float64.
    """

    def __init__(
        self, hidden: np.ndarray, hidden_bias: np.ndarray, out: np.ndarray, out_bias: np.ndarray
    ) -> None:
        self.hidden, self.hidden_bias = hidden, hidden_bias
        self.out, self.out_bias = out, out_bias
        self.hidden_steps = np.rint(hidden * float(WEIGHT_STEPS)).astype(float)

    @classmethod
    def load(cls, path: Path) -> "LaneNet":
        """Load a net that `python -m selfdrive.visiond_lab.train` wrote."""
        with np.load(path) as stored:
            return cls(stored["hidden"], stored["hidden_bias"], stored["out"], stored["out_bias"])

    def save(self, path: Path) -> None:
        """Write the weights; equal weights give equal bytes."""
        np.savez_compressed(
            path,
            hidden=self.hidden,
            hidden_bias=self.hidden_bias,
            out=self.out,
            out_bias=self.out_bias,
        )

    def log_odds(self, features: np.ndarray) -> np.ndarray:
        """Log odds of a mark, for `features` (windows, features) in float32.

        Features and weights are rounded to integer steps, so that doubles hold each sum exactly and the order
        of additions does not matter.
        """
        steps = np.empty((len(features), self.hidden_steps.shape[1]))
        for k in range(0, len(features), WINDOWS_AT_ONCE):
            some = np.rint(features[k : k + WINDOWS_AT_ONCE] * np.float32(FEATURE_STEPS)).astype(float)
            np.matmul(some, self.hidden_steps, out=steps[k : k + WINDOWS_AT_ONCE])
        hidden = each(tanh, steps / (FEATURE_STEPS * WEIGHT_STEPS) + self.hidden_bias)
        return (hidden * self.out).sum(axis=-1) + self.out_bias
