"""Checks of the published numbers in a library."""

import re
import shutil
from pathlib import Path

import pytest

from mutator.checks.library_check import library_problems
from mutator.paper.published_numbers import PUBLISHED_FILE_NAMES
from mutator.paper.published_numbers_check import check_published_numbers
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    library = tmp_path / "fault_library"
    shutil.copytree(CLONE / "fault_library", library)
    return Workspace(library=library, templates=CLONE / "templates")


def test_the_shipped_numbers_are_valid(workspace: Workspace) -> None:
    assert list(check_published_numbers(workspace)) == []


def test_missing_numbers_are_reported_with_a_remedy(workspace: Workspace) -> None:
    references = workspace.library / "references"
    shutil.rmtree(references)
    [problem] = check_published_numbers(workspace)
    assert problem.where == str(references)
    for file in PUBLISHED_FILE_NAMES:
        assert file in problem.got
        assert file in str(problem.expected)
    assert "copy them" in str(problem.remedy)


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        (
            "coverage",
            "fault_type: fog, injected",
            "fault_type: fog, injectd",
            r"coverage\.yaml:13: .*injectd",
        ),
        ("coverage", "fault_type: fog", "fault_type: mist", r"coverage\.yaml:13: .*'vision_input/mist'"),
        ("coverage", "fault_type: fog", "fault_type: rain", r"coverage\.yaml:13: .*/rain is listed twice"),
        ("coverage", "guided_hazards: 154", "guided_hazards: 155", r"coverage\.yaml:\d: 1317 guided hazards"),
        ("coverage", "guided_hazards: 154", "guided_hazards: 433", r"coverage\.yaml:6: .*contradict"),
        (
            "summary",
            "method: random, scenario: S5",
            "method: random, scenario: S6x",
            r"summary\.yaml:14: .*S6x",
        ),
        (
            "summary",
            "method: random, scenario: S5",
            "method: blind, scenario: S5",
            r"summary\.yaml:14: .*blind",
        ),
        (
            "summary",
            "scenario: S5, injected",
            "scenario: S4, injected",
            r"summary\.yaml:9: .*in S4 is listed twice",
        ),
        ("times", "driver_reaction_s: 1.8", "driver_reaction_s: -1", r"times\.yaml:4: "),
    ],
)
def test_a_wrong_number_is_reported_with_its_line(
    workspace: Workspace, file: str, old: str, new: str, told: str
) -> None:
    path = workspace.library / "references" / f"paper_{file}.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    problems = "\n".join(str(problem).replace("\n", " ") for problem in check_published_numbers(workspace))
    assert re.search(told, problems), problems


def test_a_missing_file_is_reported_if_a_campaign_requests_the_study(toycar: Workspace) -> None:
    references = toycar.library / "references"
    references.mkdir()
    shutil.copy(CLONE / "fault_library" / "references" / "paper_coverage.yaml", references)
    told = [str(problem) for problem in library_problems(toycar, "toycar")]
    assert not any("paper_summary.yaml" in problem for problem in told)
    campaign = toycar.library / "campaigns" / "small.yaml"
    campaign.write_text(f"{campaign.read_text()}study: driving_agent_resilience\n")
    asked = [str(problem) for problem in library_problems(toycar, "toycar")]
    [new] = [problem for problem in asked if problem not in told]
    assert new.startswith(str(references))
    assert "no paper_summary.yaml, paper_times.yaml" in new


def test_a_library_needs_no_numbers_if_no_campaign_requests_the_study(toycar: Workspace) -> None:
    told = [str(problem) for problem in library_problems(toycar, "toycar")]
    assert not any("references" in problem for problem in told)
    campaign = toycar.library / "campaigns" / "small.yaml"
    campaign.write_text(f"{campaign.read_text()}study: driving_agent_resilience\n")
    asked = [str(problem) for problem in library_problems(toycar, "toycar")]
    [new] = [problem for problem in asked if problem not in told]
    assert new.startswith(f"{toycar.library / 'references'}: the published numbers are not in this library")
