"""The confidence in a line that may be wrong: a logistic function of evidence, with fitted weights.

`python -m selfdrive.visiond_lab.fit_confidence` fits the weights. A detector abstains from a line of which it
is not confident (probability below MIN_CONFIDENT): the path does not follow it.
"""

import json
from collections.abc import Mapping, Sequence
from math import exp
from pathlib import Path

PAPER_CONFIDENCE = Path(__file__).with_name("paper_confidence.json")
MIN_CONFIDENT = 0.5  # probability of a line that a detector is confident of
MOST_LOG_ODDS = 30.0  # of a certain line


class LineConfidence:
    """`weights` are the bias and that of each evidence, in order."""

    def __init__(self, weights: Sequence[float]) -> None:
        self._bias, *self._weights = weights

    @classmethod
    def load(cls, path: Path) -> "LineConfidence":
        """Load weights by name, the bias first."""
        weights: Mapping[str, float] = json.loads(path.read_text(encoding="utf-8"))
        return cls(list(weights.values()))

    def probability(self, evidence: Sequence[float]) -> float:
        """The probability of a line with this evidence; 0 if it is not a number."""
        log_odds = self._bias
        for weight, value in zip(self._weights, evidence, strict=True):
            log_odds += weight * value
        if not log_odds > -MOST_LOG_ODDS:
            return 0.0
        return 1.0 / (1.0 + exp(-min(log_odds, MOST_LOG_ODDS)))
