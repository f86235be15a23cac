"""The page of a run with more experiments than the page lists."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from mutator.report import experiment_list_data, report_builder
from mutator.report.panels import figures_panel

if TYPE_CHECKING:
    from conftest import Page

LISTED = 10


@pytest.fixture
def large(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(run, tmp_path / "run")
    monkeypatch.setattr(experiment_list_data, "MOST_LISTED_EXPERIMENTS", LISTED)
    monkeypatch.setattr(figures_panel, "draw_figures", lambda frame: ())
    report_builder.write_report(tmp_path / "run", None)
    return tmp_path / "run"


def test_the_page_lists_the_worst_and_counts_all(
    run: Path, large: Path, open_report: "Callable[[Path], Page]"
) -> None:
    whole, page = open_report(run), open_report(large)
    assert page.found == "10 experiments listed, the worst of 24"
    told = page.page.inner_text(".listed")
    assert "the 10 worst of 24 experiments" in told and "mutator show ID --run run" in told
    assert page.column("kind") == whole.column("kind")[:LISTED]
    assert page.texts(".tiles b") == whole.texts(".tiles b")
    measures = page.texts("#measure option")
    assert measures == whole.texts("#measure option") and len(measures) > 5
    for value in page.page.eval_on_selector_all("#measure option", "all => all.map((o) => o.value)"):
        for one in (page, whole):
            one.page.select_option("#measure", value)
        assert page.texts("#heat th") == whole.texts("#heat th")
        assert page.texts("#heat .cell") == whole.texts("#heat .cell")
    page.open("q=zz")
    assert page.found.startswith('0 of 10 experiments listed, the worst of 24. No experiment has "zz" in ')


def test_the_page_says_that_an_experiment_is_not_listed(
    run: Path, large: Path, open_report: "Callable[[Path], Page]"
) -> None:
    ids = open_report(run).page.evaluate(
        "Packed.read('table').then((t) => t.columns.find((c) => c.name === 'experiment_id').texts)"
    )
    page = open_report(large)
    listed = page.page.evaluate(
        "Packed.read('table').then((t) => t.columns.find((c) => c.name === 'experiment_id').texts)"
    )
    other = next(name for name in ids if name not in listed)
    page.open(f"e={other}")
    assert f"Experiment {other} is not listed here. Run mutator show {other} --run" in page.found
