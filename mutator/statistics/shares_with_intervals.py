"""Shares with their intervals."""

import math
from dataclasses import dataclass

CONFIDENCE_LEVEL = 0.95
_INTERVAL_DECIMALS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """The share `count`/`of`. The rate's interval is `low` to `high`; both are NaN if there is none."""

    count: int
    of: int
    low: float
    high: float

    @property
    def rate(self) -> float:
        return self.count / self.of if self.of else math.nan

    def __str__(self) -> str:
        """Text such as `35.8 % (1316/3678; 34.2 to 37.3)`, or `- (0/0)` without data."""
        if not self.of:
            return "- (0/0)"
        if math.isnan(self.low):
            return f"{100 * self.rate:.1f} % ({self.count}/{self.of})"
        interval = f"{100 * self.low:.1f} to {100 * self.high:.1f}"
        return f"{100 * self.rate:.1f} % ({self.count}/{self.of}; {interval})"


def share_with_interval(count: int, of: int) -> Share:
    """Return the share `count`/`of`, with its 95 % Wilson interval (statsmodels)."""
    from statsmodels.stats.proportion import proportion_confint  # type: ignore[import-untyped]

    if not of:
        return Share(count=count, of=of, low=math.nan, high=math.nan)
    low, high = proportion_confint(count, of, alpha=1 - CONFIDENCE_LEVEL, method="wilson")
    # rounded, because last bits differ between machines, and the interval of 0 of n must begin at exactly 0
    return Share(
        count=count,
        of=of,
        low=round(float(low), _INTERVAL_DECIMALS),
        high=round(float(high), _INTERVAL_DECIMALS),
    )
