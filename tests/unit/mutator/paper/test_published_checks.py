"""Published numbers that are impossible, or that do not match the library, are reported with file and
line."""

import re
import shutil
from pathlib import Path

import pytest

from mutator.paper.published import FILES
from mutator.paper.published_checks import check_paper
from mutator.verification.library import check_library
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """The shipped library with a copy of its references, which a test may break."""
    library = tmp_path / "fault_library"
    library.mkdir()
    for folder in (CLONE / "fault_library").iterdir():
        if folder.name == "references":
            shutil.copytree(folder, library / folder.name)
        else:
            (library / folder.name).symlink_to(folder)
    return Workspace(library=library, templates=CLONE / "templates")


def test_the_cited_numbers_that_ship_are_well(workspace: Workspace) -> None:
    assert list(check_paper(workspace)) == []


def test_a_library_without_them_is_told_what_to_do(workspace: Workspace) -> None:
    """If a campaign needs numbers that are missing, the error names the folder, the files and a remedy."""
    references = workspace.library / "references"
    shutil.rmtree(references)
    [problem] = check_paper(workspace)
    assert problem.where == str(references)
    for file in FILES:
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
        ("coverage", "fault_type: fog", "fault_type: rain", r"coverage\.yaml:13: .*/rain a second time"),
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
        ("summary", "scenario: S5, injected", "scenario: S4, injected", r"summary\.yaml:9: .*in S4 a second"),
        ("times", "driver_reaction_s: 1.8", "driver_reaction_s: -1", r"times\.yaml:4: "),
    ],
)
def test_what_is_wrong_is_told_where_it_stands(
    workspace: Workspace, file: str, old: str, new: str, told: str
) -> None:
    """An unknown key, name or method, a duplicate row, and parts that do not match their sum are reported
    with their line."""
    path = workspace.library / "references" / f"paper_{file}.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    problems = "\n".join(str(problem).replace("\n", " ") for problem in check_paper(workspace))
    assert re.search(told, problems), problems


def test_a_library_is_checked_for_the_studies_that_its_campaigns_ask_for(toycar: Workspace) -> None:
    """If a campaign requests the study and the library has only some of the published numbers, the missing
    file is reported."""
    references = toycar.library / "references"
    references.mkdir()
    shutil.copy(CLONE / "fault_library" / "references" / "paper_coverage.yaml", references)
    told = [str(problem) for problem in check_library(toycar, "toycar")]
    assert not any("paper_summary.yaml" in problem for problem in told)
    campaign = toycar.library / "campaigns" / "small.yaml"
    campaign.write_text(f"{campaign.read_text()}study: driving_agent_resilience\n")
    asked = [str(problem) for problem in check_library(toycar, "toycar")]
    [new] = [problem for problem in asked if problem not in told]
    assert new.startswith(str(references))
    assert "no paper_summary.yaml, paper_times.yaml" in new


def test_a_library_without_any_is_told_only_if_a_campaign_asks(toycar: Workspace) -> None:
    """Without a campaign that requests the study, no published number is needed."""
    told = [str(problem) for problem in check_library(toycar, "toycar")]
    assert not any("references" in problem for problem in told)
    campaign = toycar.library / "campaigns" / "small.yaml"
    campaign.write_text(f"{campaign.read_text()}study: driving_agent_resilience\n")
    asked = [str(problem) for problem in check_library(toycar, "toycar")]
    [new] = [problem for problem in asked if problem not in told]
    assert new.startswith(f"{toycar.library / 'references'}: the published numbers are not in this library")
