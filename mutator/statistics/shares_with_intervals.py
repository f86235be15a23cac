"""Shares with their intervals."""

import math
from dataclasses import dataclass

CONFIDENCE_LEVEL = 0.95
_INTERVAL_DECIMALS = 12
_Z = 1.959963984540054  # the normal distribution's quantile for CONFIDENCE_LEVEL


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """The share `count`/`of`. The rate's interval is `low` to `high`; both are NaN if there is none.

    `weighted_rate` replaces the rate if the runs are a sample (NaN: it cannot be estimated).
    """

    count: int
    of: int
    low: float
    high: float
    weighted_rate: float | None = None

    @property
    def rate(self) -> float:
        if self.weighted_rate is not None:
            return self.weighted_rate
        return self.count / self.of if self.of else math.nan

    def __str__(self) -> str:
        """Text such as `35.8 % (1316/3678; 34.2 to 37.3)`, or `- (0/0)` without data. Of a sample,
        the rate is weighted, and the counts are those of the drawn runs.
        """
        if not self.of:
            return "- (0/0)"
        if math.isnan(self.rate):
            return f"- ({self.count}/{self.of})"
        if math.isnan(self.low):
            return f"{100 * self.rate:.1f} % ({self.count}/{self.of})"
        interval = f"{100 * self.low:.1f} to {100 * self.high:.1f}"
        return f"{100 * self.rate:.1f} % ({self.count}/{self.of}; {interval})"


def share_with_interval(count: int, of: int) -> Share:
    """Return the share `count`/`of`, with its 95 % Wilson interval (E. B. Wilson, 1927).

    statsmodels has it too, but a report would spend much of its time on the import.
    """
    if not of:
        return Share(count=count, of=of, low=math.nan, high=math.nan)
    low, high = wilson_interval(count / of, of)
    return Share(count=count, of=of, low=low, high=high)


def wilson_interval(rate: float, of: float) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a rate among `of` runs, which need not be a whole number."""
    z2 = _Z**2
    centre = (rate + z2 / (2 * of)) / (1 + z2 / of)
    half_width = _Z * math.sqrt(rate * (1 - rate) / of + z2 / (4 * of**2)) / (1 + z2 / of)
    # rounded, because last bits differ between machines, and the interval of 0 of n must begin at exactly 0
    low, high = (round(end, _INTERVAL_DECIMALS) for end in (centre - half_width, centre + half_width))
    return max(0.0, low), min(1.0, high)
