"""Studies are found by their entry points, wherever they come from."""

import re
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from mutator.campaigns import studies
from mutator.campaigns.studies import find_study, study_names
from mutator.errors import MutatorError
from mutator.report import building
from mutator.workspace import Workspace

from ..report.made_run import make_run

CLONE = Path(__file__).parents[4]
PAGE = CLONE / "docs" / "how-to" / "add-a-study.md"


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The study of the how-to page, and one whose package is broken."""
    package = tmp_path / "site" / "crash_tests"
    package.mkdir(parents=True)
    [code] = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
    (package / "study.py").write_text(code)
    monkeypatch.syspath_prepend(package.parent)
    [name, value] = re.findall(r"(?m)^(crash_tests) = \"(.*)\"$", PAGE.read_text())[0]
    points = EntryPoints(
        EntryPoint(name, value, studies.GROUP)
        for name, value in ((name, value), ("broken", "crash_tests.study:MISSING"))
    )
    monkeypatch.setattr(studies, "entry_points", points.select)


def test_the_study_that_ships_is_installed() -> None:
    """The package's metadata names it, so an old installation is noticed here."""
    assert "driving_agent_resilience" in study_names(), "install again: pip install -e . --no-deps"
    assert list(find_study("driving_agent_resilience").check(Workspace.find(root=CLONE))) == []


def test_a_study_from_another_package_is_in_the_report(installed: None, tmp_path: Path) -> None:
    """The example of the how-to page works as it stands: its panel is in both forms, with its source."""
    run = tmp_path / "run"
    run.mkdir()
    written = building.write(make_run(run, study="crash_tests"), Workspace.find(root=CLONE))
    for text in (written.markdown.read_text(), written.page.read_text()):
        assert "Crashed runs: 1 here, 12 in the published tests." in text
        assert "crash_tests (A. Author: Crash tests, 2026)" in text
    assert '<a href="#crash-tests">Crash tests</a>' in written.page.read_text()


def test_what_is_not_there_is_refused_with_what_is(installed: None) -> None:
    """An unknown name lists the known ones; a broken package is named with what is wrong with it."""
    with pytest.raises(MutatorError, match="'moon_landing' is not installed; expected one of broken, crash"):
        find_study("moon_landing")
    with pytest.raises(MutatorError, match=r"'broken' cannot be loaded: .*MISSING"):
        find_study("broken")
