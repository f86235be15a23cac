"""The neural net that tells windows with a lane mark from those without: one hidden layer of ten nodes."""

from pathlib import Path

import numpy as np

WEIGHTS = Path(__file__).with_name("lane_net.npz")
HIDDEN = 10


class LaneNet:
    """Weights `hidden` (features x 10), `hidden_bias` (10), `out` (10) and `out_bias` (1), float32."""

    def __init__(
        self, hidden: np.ndarray, hidden_bias: np.ndarray, out: np.ndarray, out_bias: np.ndarray
    ) -> None:
        self._hidden, self._hidden_bias = hidden, hidden_bias
        self._out, self._out_bias = out, out_bias

    @classmethod
    def load(cls, path: Path = WEIGHTS) -> "LaneNet":
        """The net that `python -m selfdrive.visiond.train` wrote."""
        with np.load(path) as stored:
            return cls(stored["hidden"], stored["hidden_bias"], stored["out"], stored["out_bias"])

    def save(self, path: Path) -> None:
        """Write the weights; equal weights give equal bytes."""
        np.savez_compressed(
            path,
            hidden=self._hidden,
            hidden_bias=self._hidden_bias,
            out=self._out,
            out_bias=self._out_bias,
        )

    def score(self, features: np.ndarray) -> np.ndarray:
        """Log odds that there is a mark, for `features` (..., windows, features) in float32.

        A stack of few windows each is multiplied without further threads, and so alike on any machine.
        """
        return np.tanh(features @ self._hidden + self._hidden_bias) @ self._out + self._out_bias
