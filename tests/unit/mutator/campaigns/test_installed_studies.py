"""Studies are found through entry points of any installed package."""

import re
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from mutator._common import extension_doors
from mutator._common.extension_doors import STUDY_DOOR
from mutator.campaigns.installed_studies import load_installed_study
from mutator.campaigns.plan import build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.checks.library_check import library_problems
from mutator.errors import MutatorError
from mutator.report import report_builder
from mutator.workspace import Workspace

from ..report.made_run import make_run

CLONE = Path(__file__).parents[4]
PAGE = CLONE / "docs" / "how-to" / "add-a-study.md"


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Install the study of the how-to page and a study with a broken entry point."""
    package = tmp_path / "site" / "crash_tests"
    package.mkdir(parents=True)
    [code] = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
    (package / "study.py").write_text(code)
    monkeypatch.syspath_prepend(package.parent)
    [name, value] = re.findall(r"(?m)^(crash_tests) = \"(.*)\"$", PAGE.read_text())[0]
    points = EntryPoints(
        EntryPoint(name, value, STUDY_DOOR.entry_point_group)
        for name, value in ((name, value), ("broken", "crash_tests.study:MISSING"))
    )
    monkeypatch.setattr(extension_doors, "_entry_points", lambda group: points.select(group=group))


def test_the_shipped_study_is_installed() -> None:
    assert "driving_agent_resilience" in STUDY_DOOR.names(), "install again: pip install -e . --no-deps"
    assert list(load_installed_study("driving_agent_resilience").check(Workspace.find(root=CLONE))) == []


def test_the_report_contains_a_study_from_another_package(installed: None, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    written = report_builder.write_report(make_run(run, study="crash_tests"), Workspace.find(root=CLONE))
    page = written.page.with_name("study.html").read_text()
    for text in (written.markdown.with_name("STUDY.md").read_text(), page):
        assert "Crashed runs: 1 here, 12 in the published tests." in text.replace("\u00a0", " ")
        assert "A. Author: Crash tests, 2026." in text
    for text in (written.markdown.read_text(), written.page.with_name("origin.html").read_text()):
        assert "crash_tests (A. Author: Crash tests, 2026)" in text
    assert '<section class="part" id="crash-tests">' in page
    assert 'href="study.html"' in written.page.read_text()
    assert "(STUDY.md)" in written.markdown.read_text()


def test_an_unknown_or_broken_study_is_refused(installed: None) -> None:
    with pytest.raises(MutatorError, match="no study 'moon_landing'; expected one of broken, crash"):
        load_installed_study("moon_landing")
    with pytest.raises(MutatorError, match=r"'broken' of package .* cannot be loaded: .*MISSING"):
        load_installed_study("broken")


STRANGERS = {
    "gone": ("no_such_package:STUDY", r"ModuleNotFoundError: .*no_such_package"),
    "nameless": ("json:NOPE", "AttributeError: .*NOPE"),
    "raising": ("strange_studies.raising:STUDY", "ZeroDivisionError: division by zero"),
    "unwritten": ("strange_studies.unwritten:STUDY", "SyntaxError"),
    "malformed": ("not an object!", "cannot be loaded"),
    "function": ("json:dumps", "is of type function; expected a mutator.report.reported_run.PublishedWork"),
    "module": ("json", "is of type module; expected a mutator.report.reported_run.PublishedWork"),
    "unmade": (
        "mutator.report.reported_run:PublishedWork",
        "is of type type; expected a mutator.report.reported_run.PublishedWork",
    ),
    "mirror": ("strange_studies.parts:MIRROR", "is of type SimpleNamespace; expected a mutator"),
    "idle": ("strange_studies.idle:STUDY", "cannot be loaded: TypeError: .* check must be a function"),
    "paneless": ("strange_studies.paneless:STUDY", r"cannot be loaded: TypeError: .* panels\[0\] must be"),
}
PARTS = """
from types import SimpleNamespace

from mutator.report.reported_run import PublishedWork

def nothing(*_):
    return ()

PARTS = {"about": "", "check": nothing, "published": nothing, "panels": (), "drawings": nothing}
MIRROR = SimpleNamespace(**PARTS)
FAILING = PublishedWork(**PARTS | {"check": lambda _: 1 / 0})
TALKING = PublishedWork(**PARTS | {"check": lambda _: ["oh"]})
"""
INVALID = "from strange_studies.parts import PARTS, PublishedWork; STUDY = PublishedWork(**PARTS | {change})"
BAD_CHECKS = {
    "failing": ("strange_studies.parts:FAILING", "fails: ZeroDivisionError: division by zero"),
    "talking": ("strange_studies.parts:TALKING", "returned 'oh', which is not a MutatorError"),
}


@pytest.fixture
def strangers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Install a package whose entry points are broken in different ways."""
    package = tmp_path / "site" / "strange_studies"
    package.mkdir(parents=True)
    (package / "raising.py").write_text("STUDY = 1 / 0")
    (package / "unwritten.py").write_text("STUDY = (")
    (package / "parts.py").write_text(PARTS)
    (package / "idle.py").write_text(INVALID.format(change={"check": None}))
    (package / "paneless.py").write_text(INVALID.format(change={"panels": (3,)}))
    info = package.parent / "strange_studies-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: strange-studies\nVersion: 1\n")
    lines = [f"{name} = {value}" for name, (value, _) in (STRANGERS | BAD_CHECKS).items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{STUDY_DOOR.entry_point_group}]", *lines]))
    monkeypatch.syspath_prepend(package.parent)


def asking(toycar: Workspace, study: str) -> Path:
    path = toycar.campaign("small")
    path.write_text(f"{path.read_text()}study: {study}\n")
    return path


@pytest.mark.parametrize("study", STRANGERS)
def test_an_invalid_study_is_reported_at_its_line_in_the_campaign(
    strangers: None, toycar: Workspace, study: str, tmp_path: Path
) -> None:
    before = [str(problem) for problem in library_problems(toycar, "toycar")]
    path = asking(toycar, study)
    line = len(path.read_text().splitlines())
    plan = build_plan(toycar, "small")  # as for a review, which needs no study
    with pytest.raises(MutatorError) as error:
        freeze_plan(plan, tmp_path / "run", toycar)
    assert not (tmp_path / "run").exists()
    told = str(error.value)
    assert told.startswith(f"{path}:{line}: study '{study}' ")
    assert re.search(STRANGERS[study][1], told)
    assert "of package strange-studies 1 (" in told and "; correct, update or uninstall this package" in told
    after = [str(problem) for problem in library_problems(toycar, "toycar")]
    assert [problem for problem in after if problem not in before] == [told]


@pytest.mark.parametrize("study", BAD_CHECKS)
def test_an_error_in_a_studys_check_is_reported_as_a_problem(
    strangers: None, toycar: Workspace, study: str
) -> None:
    path = asking(toycar, study)
    line = len(path.read_text().splitlines())
    problems = [str(problem) for problem in library_problems(toycar, "toycar")]
    said = f"{path}:{line}: the check of study '{study}' {BAD_CHECKS[study][1]}; correct the package"
    assert any(problem.startswith(said) for problem in problems)


def test_a_report_is_written_without_an_invalid_study(strangers: None, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    written = report_builder.write_report(make_run(run, study="function"), Workspace.find(root=CLONE))
    assert "function, which cannot be loaded here" in written.markdown.read_text()


def test_every_campaign_with_a_missing_study_is_reported(toycar: Workspace) -> None:
    for name in ("small", "toy"):
        path = toycar.campaign(name)
        path.write_text(f"{path.read_text()}study: moon_landing\n")
    found = [problem for problem in library_problems(toycar, "toycar") if "moon_landing" in str(problem)]
    assert [Path(str(problem.where)).name for problem in found] == ["small.yaml", "toy.yaml"]


def test_a_run_can_be_opened_without_its_study(
    installed: None, toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asking(toycar, "crash_tests")
    folder = freeze_plan(build_plan(toycar, "small"), tmp_path / "planned", toycar)
    monkeypatch.setattr(extension_doors, "_entry_points", lambda group: EntryPoints())
    assert load_plan(folder).campaign.study == "crash_tests"
    with pytest.raises(
        MutatorError, match="no study 'crash_tests'; expected no study, because none is installed"
    ):
        freeze_plan(build_plan(toycar, "small"), tmp_path / "planned", toycar)
