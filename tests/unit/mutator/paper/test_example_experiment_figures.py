"""Figures of single experiments on the toy car: a query finds each one, and its traces confirm it."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.figures.drawings import Drawing, drawing_files
from mutator.paper.example_experiment_figures import build_example_drawings, candidate_rows
from mutator.paper.unsafe_action_detection import ACTION_FIGURES, ActionFigure, RunPair
from mutator.report import report_builder
from mutator.statistics.results_frame import load_usable_results
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from ..statistics.results_frame import results

BRAKE = ActionFigure(
    name="brake",
    title="Brake",
    query='module == "sensor" and t_h3 > t_activation',
    order_column="max_dev_wheel",
    what_it_shows="it is so",
    find_steps=lambda pair: pair.times_s > pair.start_s,
    action_channels=("brake",),
    panels=(("brake", "brake"), ("gap", "distance"), ("d_rel", "not recorded here")),
    hazard="H3",
)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    """A folder of the toy car, with a run whose faults shift the lanes."""
    place = tmp_path_factory.mktemp("driven")
    only = Choices(only='fault_type == "lane"')
    assert run_campaign(copy_toycar(place), "small", place / "run", choices=only).exit_code == 0
    return place


@pytest.fixture
def place(driven: Path, tmp_path: Path) -> Path:
    shutil.copytree(driven, tmp_path / "place")
    return tmp_path / "place"


def drawn(place: Path, wanted: ActionFigure) -> Drawing:
    toy = place / "toy"
    workspace = Workspace(library=toy / "fault_library", templates=toy / "templates")
    run = place / "run"
    [drawing] = build_example_drawings(
        RunFolder.open(run), load_usable_results(run / "results.csv"), workspace, [wanted]
    )
    return drawing


def edit_target(place: Path) -> None:
    with (place / "toy" / "tree" / "toycar" / "sensing.py").open("a") as file:
        file.write("\n# edited\n")


def test_an_experiment_is_found_and_drawn_without_a_run(driven: Path) -> None:
    drawing = drawn(driven, BRAKE)
    [name] = [name for name in RunFolder.open(driven / "run").records() if name in drawing.note]
    assert [code for _, code in drawing.described_code_lines] == [
        BRAKE.query,
        f"mutator show {name} --run DIR",
    ]
    assert not (driven / "run" / "traces").exists()
    assert drawing.figure is not None
    brake, gap = drawing.figure.axes
    assert (brake.get_ylabel(), gap.get_ylabel()) == ("brake [-]", "distance [m]")
    assert {line.get_linestyle() for line in brake.lines[:2]} == {"-", "--"}
    assert any("activated" in text.get_text() for text in brake.texts)
    assert any(text.get_text().startswith("H3 ") for text in brake.texts)
    assert (len(brake.patches), len(gap.patches)) == (1, 0)


def test_rewriting_a_report_starts_no_process(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def start(*words: object, **keywords: object) -> None:
        raise AssertionError("a report started a process")

    monkeypatch.setattr("subprocess.Popen", start)
    monkeypatch.setattr("mutator.execution.single_run.run_single", start)
    workspace = Workspace.find(root=place / "toy")
    report = report_builder.write_report(place / "run", workspace)
    assert '"packed": true' in report.page.read_text()
    assert drawn(place, BRAKE).figure is not None
    assert not (place / "run" / "traces").exists()


def test_a_figure_needs_only_the_stored_series(place: Path) -> None:
    contents = []
    for _ in range(2):
        contents.append(drawing_files([drawn(place, BRAKE)]))
        edit_target(place)
    assert contents[0] == contents[1]
    assert contents[0].keys() == {"figures/brake.svg", "figures/brake.png"}


def test_a_missing_input_is_reported_instead_of_a_figure(place: Path) -> None:
    series = place / "run" / "series"
    for path in series.glob(f"{16 * '[0-9a-f]'}.js"):
        path.write_bytes(path.read_bytes()[:-40])
    assert "damaged" in drawn(place, BRAKE).note
    shutil.rmtree(series)
    without = drawn(place, BRAKE)
    assert "no series of " in without.note
    assert drawing_files([without]) == {}
    shutil.rmtree(place / "toy" / "tree")
    assert drawn(place, BRAKE).note.startswith("No figure: ")
    run = place / "run"
    [nowhere] = build_example_drawings(
        RunFolder.open(run), load_usable_results(run / "results.csv"), None, [BRAKE]
    )
    assert "no fault library" in nowhere.note


def test_matching_experiments_are_tried_until_one_shows_the_action(place: Path) -> None:
    looked_at: list[float] = []

    def second(pair: RunPair) -> np.ndarray | None:
        looked_at.append(pair.start_s)
        return pair.times_s > pair.start_s if len(looked_at) == 2 else None

    assert "this is number 2," in drawn(place, replace(BRAKE, find_steps=second)).note
    none = drawn(place, replace(BRAKE, find_steps=lambda pair: None))
    assert none.figure is None
    assert "none shows it" in none.note


def test_a_query_without_a_match_is_reported(place: Path) -> None:
    assert "no experiment of this run matches" in drawn(place, replace(BRAKE, query='module == "radar"')).note
    assert "records no sail" in drawn(place, replace(BRAKE, action_channels=("sail",))).note


def test_candidates_are_sorted_by_size_and_then_by_id() -> None:
    h1 = {"t_activation": 2, "t_h1": 5, "max_dev_gas": 0}
    frame: pd.DataFrame = results(
        h1 | {"max_dev_brake": 9.0},
        h1 | {"max_dev_brake": 10.0, "experiment_id": "b"},
        h1 | {"max_dev_brake": 10.0, "experiment_id": "a"},
        h1 | {"max_dev_brake": 99.0, "module": "vision_input"},
        h1 | {"max_dev_brake": 99.0, "fault_type": "jamming"},
        {"t_activation": 2, "max_dev_brake": 99.0, "max_dev_gas": 0},
    )
    assert list(candidate_rows(frame, ACTION_FIGURES[0])["experiment_id"]) == ["a", "b", "0"]


def test_every_query_finds_its_experiment() -> None:
    had = {"t_activation": 2, "t_alert": 3, "t_h1": 5, "t_h2": 5, "max_dev_brake": 1, "max_dev_gas": 1}
    frame = results(had, had | {"fault_type": "jamming"})
    assert [list(candidate_rows(frame, one)["experiment_id"]) for one in ACTION_FIGURES] == [
        ["0"],
        ["0"],
        ["0"],
        ["1"],
    ]
