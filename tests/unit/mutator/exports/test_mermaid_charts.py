"""Charts in Markdown."""

import re
from typing import Any

import numpy as np
import pytest

from mutator.exports.deciding_channels import ChannelHistory
from mutator.exports.mermaid_charts import chart_markdown

T = np.linspace(2.0, 6.0, 5)


def history(**given: Any) -> ChannelHistory:
    fields: dict[str, Any] = {"name": "d_rel", "unit": "m", "t": T, "golden": None, "before": None}
    return ChannelHistory(**fields | {"faulty": np.array([40.0, 30.0, 20.0, 10.0, -0.5])} | given)


def test_a_chart_has_its_axes_and_a_line_for_each_run() -> None:
    text = chart_markdown(history(golden=np.full(5, 40.0), before=np.full(5, 39.0)))
    assert text.startswith(
        "`d_rel` over time. Grey: without the fault, blue: with the fault, before the change, "
        "red: with the fault.\n\n```mermaid\n"
    )
    assert '    x-axis "time [s]" 2.00 --> 6.00\n' in text
    assert '    y-axis "d_rel [m]" -2.5 --> 42.0\n' in text
    assert text.count("    line [") == text.count("#") == 3
    assert text.endswith("    line [40.0, 30.0, 20.0, 10.0, -0.5]\n```")


def test_a_run_that_is_not_known_has_no_line_and_no_colour() -> None:
    text = chart_markdown(history())
    assert text.startswith("`d_rel` over time. Red: with the fault.")
    assert text.count("    line [") == text.count("#") == 1


@pytest.mark.parametrize("scale", [1e-7, 0.013, 1.0, 12345.6, 1e9])
def test_numbers_have_no_exponent_and_differ(scale: float) -> None:
    """Mermaid cannot read exponents, and draws nothing if both ends of an axis are equal."""
    text = chart_markdown(history(faulty=scale * np.array([0.0, 1.0, 2.0, 3.0, 3.5])))
    [line] = re.findall(r"line \[(.*)\]", text)
    numbers = line.split(", ")
    assert all(re.fullmatch(r"-?\d+(\.\d+)?", number) for number in numbers)
    assert len({*map(float, numbers)}) == 5


@pytest.mark.parametrize("value", [0.0, 3e-8, -2.0])
def test_a_constant_channel_has_an_axis(value: float) -> None:
    low, high = re.findall(r'y-axis ".*" (\S+) --> (\S+)', chart_markdown(history(faulty=np.full(5, value))))[
        0
    ]
    assert float(low) < value < float(high)


def test_a_name_cannot_end_its_text_or_the_block() -> None:
    text = chart_markdown(history(name='a"b\n```c', unit='"'))
    assert text.count("```") == 2
    assert "y-axis \"a'b '''c [']\" " in text
