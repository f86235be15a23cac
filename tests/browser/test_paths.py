"""Fault paths in the report page."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from mutator.model import Experiment, ObservedActivation, Outcome
from mutator.report import report_builder
from mutator.report.panels import figures_panel
from mutator.results import table_building
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from .conftest import Page

STRUCTURE = """\
schema: control_structure/1
about: A toy.
components:
  sensing: {kind: sensor, label: Sensing, about: sees, modules: [toycar/sensing.py], drawn: [1, 1, 1]}
  control: {kind: controller, label: Control, about: drives, modules: [toycar/driver.py], drawn: [0, 0, 2]}
  pedals: {kind: actuator, label: Pedals, about: push, drawn: [1, 0, 1]}
  world: {kind: process, label: World, about: moves, drawn: [2, 0, 2]}
control_actions: {}
links:
  readings: {from: sensing, to: control, label: readings}
  commands: {from: control, to: pedals, label: commands}
  force: {from: pedals, to: world, label: force}
  echo: {from: world, to: sensing, label: echo}
"""
COMPONENTS = {"gas": "pedals", "brake": "pedals", "gap": "world", "speed": "world"}
ACTIVE = {"activation": ObservedActivation(first=1.5, last=5.0, count=9)}
CHANGED = {
    **ACTIVE,
    "outcome": Outcome.SDC,
    "t_manifest": 1.6,
    "left": (("gas", 1.6, 0.25), ("gap", 1.7, 3.0)),
}
MASKED = {**ACTIVE, "outcome": Outcome.MASKED}
QUIET = {"activation": None, "outcome": Outcome.NOT_ACTIVATED}


def result_of(experiment: Experiment) -> dict[str, Any]:
    return {"lane": CHANGED, "distance": MASKED}.get(experiment.fault.fault_type, QUIET)


@pytest.fixture(scope="module")
def report(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Path:
    folder = tmp_path_factory.mktemp("paths")
    workspace = copy_toycar(folder)
    manifest = workspace.library / "targets" / "toycar.yaml"
    text = manifest.read_text()
    for channel, component in COMPONENTS.items():
        text = text.replace(f"  {channel}: {{unit: ", f"  {channel}: {{component: {component}, unit: ")
    manifest.write_text(text)
    (workspace.library / "stpa" / "control_structure.yaml").write_text(STRUCTURE)
    run = write_run(workspace, folder / "run", result_of)
    table_building.build_tables(run)
    with pytest.MonkeyPatch.context() as patch:  # figures take seconds and are tested elsewhere
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        report_builder.write_report(run, None)
    return run


@pytest.fixture
def opened(open_report: "Callable[[Path], Page]", report: Path) -> "Page":
    return open_report(report)


def test_an_experiment_opens_with_its_path(opened: "Page") -> None:
    opened.choose("kind", "sensor/lane")
    opened.page.click("#grid tr[data-at] >> nth=0")
    opened.page.wait_for_selector(".path-strip")
    boxes = opened.page.locator(".path-strip .path-box")
    assert [text.split("\n") for text in boxes.all_inner_texts()] == [
        ["Sensing", "⚡ injected", "1.50 s"],
        ["Control", "? not recorded"],
        ["Pedals", "● reached", "1.60 s +0.10 s"],
        ["World", "● reached", "1.70 s +0.20 s"],
    ]
    assert "gas: first at 1.60 s, largest difference 0.25" in boxes.nth(2).get_attribute("title")
    opened.page.evaluate(
        "document.querySelector('section.replay').dispatchEvent("
        "new CustomEvent('replay-time', {bubbles: true, detail: {t: 1.65}}))"
    )
    assert opened.texts(".path-box.is-lit strong") == ["Sensing", "Pedals"]
    assert opened.texts(".path-box.is-ahead strong") == ["World"]


def test_the_path_names_the_component_that_stopped_a_masked_fault(opened: "Page") -> None:
    opened.choose("kind", "sensor/distance")
    opened.page.click("#grid tr[data-at] >> nth=0")
    opened.page.wait_for_selector(".path-box.is-held")
    assert "It was stopped at Pedals." in opened.page.inner_text("section.path")
    opened.open("kind=sensor%2Fsilence")
    opened.page.click("#grid tr[data-at] >> nth=0")
    opened.page.wait_for_selector("section.path p:has-text('never active')")


def test_the_control_structure_shows_counts_and_filters_the_list(opened: "Page") -> None:
    count = "#path-counts [data-link='commands'] .count"
    opened.choose("kind", "sensor/lane")
    lanes = int(opened.found.split()[0])
    opened.open("kind=sensor%2Fdistance")
    held = int(opened.found.split()[0])
    opened.open()
    share = f"{lanes} of {lanes + held}"  # without a rate, because the run is a sample
    assert opened.page.text_content(count) == share
    assert opened.page.locator("#path-counts [data-component='pedals'] .count").all_text_contents() == [
        f"{held} stopped",
        f"{held} masked",
    ]
    cell = opened.page.text_content("#path-counts-table [data-link='commands'] td:last-child")
    assert cell.replace("\u00a0", " ").startswith(f"{share}; of those that ran")
    opened.page.select_option("#path-counts-kind", "sensor/distance")
    assert opened.page.text_content(count) == f"0 of {held}"
    title = opened.page.text_content("#path-counts [data-link='commands'] title")
    assert title.endswith("\nof those that ran")
    opened.page.click("#path-counts [data-component='pedals']")
    assert opened.fragment == "stopped_at=pedals&kind=sensor%2Fdistance"
    assert "Stopped at: Pedals" in opened.page.inner_text("body").replace("stopped at", "Stopped at")
    assert opened.found.startswith(f"{held} of ")
    opened.page.select_option("#path-counts-kind", "all fault types")
    opened.page.click("#path-counts [data-link='force'] .count")
    assert opened.fragment == "through=pedals%E2%86%92world"
    assert opened.found.startswith(f"{lanes} of ")
