"""A channel over time as a Mermaid chart, which Markdown on GitHub and GitLab draws."""

import math

import numpy as np

from mutator.exports.deciding_channels import ChannelHistory

_SIGNIFICANT_DIGITS = 3  # of the range of values
_MOST_DECIMALS = 9
_SHARE_ABOVE_AND_BELOW = 0.05  # of the range of values that stays free
# readable on white and on black
_GOLDEN, _BEFORE, _FAULTY = ("grey", "#8c8c8c"), ("blue", "#3b82d6"), ("red", "#dc4c3e")


def chart_markdown(history: ChannelHistory) -> str:
    """Return a line of text that explains the chart, and the chart."""
    lines = [
        (colour, meaning, values)
        for colour, meaning, values in (
            (_GOLDEN, "without the fault", history.golden),
            (_BEFORE, "with the fault, before the change", history.before),
            (_FAULTY, "with the fault", history.faulty),
        )
        if values is not None
    ]
    legend = ", ".join(f"{name}: {meaning}" for (name, _), meaning, _ in lines)
    palette = ", ".join(code for (_, code), _, _ in lines)
    axis = _chart_text(f"{history.name} [{history.unit}]")
    values = np.concatenate([values for _, _, values in lines])
    decimals = _decimals_for(values)
    return "\n".join(
        [
            f"`{_chart_text(history.name)}` over time. {legend[0].upper()}{legend[1:]}.",
            "",
            "```mermaid",
            f'%%{{init: {{"themeVariables": {{"xyChart": {{"plotColorPalette": "{palette}"}}}}}}}}%%',
            "xychart-beta",
            f'    x-axis "time [s]" {history.t[0]:.2f} --> {history.t[-1]:.2f}',
            f'    y-axis "{axis}" {_limits_text(values, decimals)}',
            *(f"    line [{_numbers_text(line, decimals)}]" for _, _, line in lines),
            "```",
        ]
    )


def _decimals_for(values: np.ndarray) -> int:
    """Return the number of decimals that show the range of values; Mermaid reads no exponents."""
    span = float(np.ptp(values)) or abs(float(values[0])) or 1.0
    return min(max(_SIGNIFICANT_DIGITS - 1 - math.floor(math.log10(span)), 0), _MOST_DECIMALS)


def _limits_text(values: np.ndarray, decimals: int) -> str:
    """Return the limits of the axis, which must differ."""
    low, high = float(values.min()), float(values.max())
    free = _SHARE_ABOVE_AND_BELOW * (high - low) or 1.0
    return f"{low - free:.{decimals}f} --> {high + free:.{decimals}f}"


def _numbers_text(values: np.ndarray, decimals: int) -> str:
    return ", ".join(f"{value:.{decimals}f}" for value in values)


def _chart_text(text: str) -> str:
    """Return a name without the characters that would end a quoted text, its line or the block."""
    return " ".join(text.split()).translate(str.maketrans('"`;', "'' "))
