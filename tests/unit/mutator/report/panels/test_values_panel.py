"""The panel of value and margin says how soon hazards come, and is left out of runs without values."""

from types import SimpleNamespace
from typing import Any

import pandas as pd

from mutator.report.panels.values_panel import build_values_panel

NAN = float("nan")


def run(values: list[float], times: list[float]) -> Any:
    return SimpleNamespace(frame=pd.DataFrame({"value": values, "time_to_hazard": times}))


def test_the_text_has_the_share_of_hazards_by_time() -> None:
    panel = build_values_panel(run([1.0, 2.0, NAN], [0.7, NAN, 1.8]))
    assert panel is not None
    assert "| 0.5 s | 0.0 % (0/2;" in panel.markdown
    assert "| 1 s | 50.0 % (1/2;" in panel.markdown
    assert "| 1.8 s | 100.0 % (2/2;" in panel.markdown
    assert 'id="value-plots"' in panel.html


def test_a_run_without_hazards_says_so() -> None:
    panel = build_values_panel(run([1.0], [NAN]))
    assert panel is not None and "| 5 s | no hazard |" in panel.markdown


def test_a_run_without_values_has_no_such_panel() -> None:
    assert build_values_panel(run([NAN], [0.7])) is None
