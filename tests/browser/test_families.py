"""The part "Families" of a report: a map of results and the margins of golden runs over the parameters."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from mutator.report import family_results, report_builder
from mutator.report.panels import figures_panel
from mutator.statistics.fault_free_drive_tables import JudgedDrive
from mutator.store.golden_verdicts import GoldenVerdict
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from conftest import BuildRun, Page

FAMILY = """\
schema: family/1
name: follow
title: The lead ahead brakes gently
source: A test
parameters:
  ego_mps: {from: 14, to: 20, step: 1}
  gap_m: [30, 40]
  road: [dry, wet]
template: |
  steps: 120
  speed: {{ ego_mps }}
  gap: {{ gap_m }}
  lead_speed: {% if road == "wet" %}19{% else %}20{% endif %}
  lead_brakes: 0
"""


def golden_runs(folder: RunFolder) -> tuple[JudgedDrive, ...]:
    """Synthetic verdicts: the first golden run has a hazard, the others have margins."""
    return tuple(
        JudgedDrive(
            golden_run=golden,
            concrete=None,
            verdict=GoldenVerdict(
                duration_s=6.0,
                t_end=None,
                hazards=(("H3", 2.0),) if number == 0 else (),
                alerts=(),
                metrics=(("smallest_gap", number + 0.5),),
            ),
        )
        for number, golden in enumerate(g for g in folder.golden_runs if g.scenario.startswith("follow-"))
    )


@pytest.fixture(scope="module")
def run_of_family(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    build_run: "BuildRun",
) -> Path:
    folder = tmp_path_factory.mktemp("families")
    workspace = copy_toycar(folder)
    with (workspace.library / "targets" / "toycar.yaml").open("a") as manifest:
        manifest.write("metrics: {smallest_gap: {min: gap, unit: m, worse: lower, about: smallest gap}}\n")
    (workspace.library / "families").mkdir()
    (workspace.library / "families" / "follow.yaml").write_text(FAMILY)
    campaign = workspace.library / "campaigns" / "toy.yaml"
    campaign.write_text(campaign.read_text().replace("[A, B]", "[A, {family: follow, sample: 6}]"))
    _, out = build_run(workspace, folder / "run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        patch.setattr(family_results, "load_judged_drives", golden_runs)
        report_builder.write_report(out.path, None)
    return out.path


@pytest.fixture
def page(open_report: Callable[[Path], "Page"], run_of_family: Path) -> "Page":
    opened = open_report(run_of_family)
    opened.page.evaluate("document.querySelector('#family-plots').scrollIntoView()")
    opened.page.wait_for_selector("#map-x")
    return opened


def test_a_mark_of_the_map_opens_the_worst_experiment_of_its_scenario(page: "Page") -> None:
    """Each concrete scenario is a mark, whose words name its values; Enter opens its worst experiment."""
    about = page.page.locator(".map-of-family .point")
    page.page.focus(".map-of-family .stage-of-values")
    page.page.keyboard.press("End")
    assert about.inner_text().startswith("follow, ego 1")
    assert "hazard" in page.texts(".map-of-family .marks li")[0]
    page.page.keyboard.press("Enter")
    page.page.wait_for_selector("#experiment .under")
    assert page.fragment.startswith("e=")
    assert ", gap " in page.page.inner_text("#experiment .under")
    assert "--scenario follow:ego_mps=1" in page.page.inner_text("#experiment .again")
    page.page.keyboard.press("Escape")
    assert page.page.evaluate("document.activeElement.className").startswith("stage-of-values")


def test_each_parameter_can_be_an_axis(page: "Page") -> None:
    """Parameters with texts and the number of hazards, as the campaign is an even sample, can be chosen; the
    same points are a table.
    """
    page.page.select_option("#map-x", "road")
    page.page.select_option("#map-y", "hazards")
    page.page.click(".map-of-family summary")
    page.page.wait_for_selector(".map-of-family th")  # the browser opens the table after the click
    heads = page.texts(".map-of-family th")
    assert heads[:2] == ["road", "experiments with a hazard"]
    rows = page.texts(".map-of-family tbody tr")
    assert f"{len(rows)} concrete scenarios" in page.page.inner_text("#family-plots")


def test_margins_of_golden_runs_are_drawn_over_a_parameter(page: "Page") -> None:
    """A golden run with a hazard is another mark, and its words say so."""
    assert page.page.input_value("#margin-shown") == "smallest_gap"
    page.page.focus(".margins-of-family .stage-of-values")
    page.page.keyboard.press("Home")
    assert "without a fault" in page.page.inner_text(".margins-of-family .point")
    assert "golden runs." in page.page.inner_text("#family-plots")


def test_scenarios_of_a_family_are_one_column_and_one_filter(page: "Page") -> None:
    """Maps and filters have the family; a search finds values of its parameters."""
    heads = page.texts("#heat thead th")
    assert heads == ["A", "follow", "all"]
    page.page.fill("#search", "ego_mps>=14 scenario=follow")
    page.page.wait_for_function("document.querySelector('#found').textContent.includes(' of ')")
    assert not page.found.startswith("0 of")


def test_axe_finds_no_serious_fault(page: "Page", serious_faults: Callable[[Any], list[str]]) -> None:
    for scheme in ("light", "dark"):
        page.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert serious_faults(page.page) == []
