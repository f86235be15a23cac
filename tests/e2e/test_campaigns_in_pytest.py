"""Campaigns as tests, in a fresh project with a controller of its own."""

import csv
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from mutator.cli.app import main
from mutator.execution.campaign_running import run_campaign
from mutator.workspace import Workspace

CopyToycar = Callable[[Path], Workspace]
Pytest = Callable[..., tuple[int, str]]

PLAIN = ("-p", "no:hypothesispytest", "--assert=plain")
SMALL = "fault_library/campaigns/small.yaml"
NAME = re.compile(rf"^{re.escape(SMALL)}::sensor/[A-Za-z0-9.+_-]+-[0-9a-f]{{8}}$", re.ASCII | re.MULTILINE)
SETTINGS = f'[tool.mutator]\nlibrary = "fault_library"\ncampaigns = ["{SMALL}"]\n'


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> Path:
    root = copy_toycar(tmp_path_factory.mktemp("project")).library.parent
    (root / "pyproject.toml").write_text(SETTINGS)
    (root / "test_of_the_project.py").write_text("def test_something() -> None:\n    pass\n")
    return root


@pytest.fixture
def in_pytest(project: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Pytest:
    """Call pytest in the project, whose cache all tests share; return its exit code and what it printed."""
    monkeypatch.chdir(project)
    monkeypatch.setenv("XDG_CACHE_HOME", str(project / "cache"))

    def call(*words: object) -> tuple[int, str]:
        capfd.readouterr()
        code = int(pytest.main([*PLAIN, *map(str, words)]))
        printed = "".join(capfd.readouterr())
        return code, printed

    return call


@pytest.fixture
def no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*words: object, **more: object) -> None:
        raise AssertionError(f"started a process: {words}")

    monkeypatch.setattr(subprocess.Popen, "__init__", refuse)
    monkeypatch.setattr(os, "posix_spawn", refuse)
    monkeypatch.setattr(os, "fork", refuse)


def run_folders(project: Path) -> list[Path]:
    return sorted((project / "cache" / "mutator" / "campaigns").glob("small-*"))


def counts(printed: str) -> tuple[int, int]:
    """Return how many experiments are done, and how many ran now."""
    [(done, now)] = re.findall(r"(\d+) of 12 experiments done, (\d+) now", printed)
    return int(done), int(now)


def node_ids(printed: str) -> list[str]:
    return NAME.findall(printed)


@pytest.mark.parametrize("place", [(), (".",), ("fault_library",)], ids=["plain", "root", "folder"])
def test_a_symbolic_link_to_a_campaign_is_no_second_one(
    project: Path, in_pytest: Pytest, place: tuple[str, ...]
) -> None:
    """Wherever pytest looks, it collects each experiment once."""
    link = project / "fault_library" / "campaigns" / "z.yaml"
    link.symlink_to("small.yaml")
    try:
        code, printed = in_pytest("--collect-only", "-q", *place)
    finally:
        link.unlink()
    assert code == 0, printed
    assert (len(node_ids(printed)), printed.count("::sensor/")) == (12, 12)


def test_collecting_runs_nothing(project: Path, in_pytest: Pytest, no_process: None) -> None:
    """Plain `pytest` lists the project's campaign and its tests. Each experiment has a name of its own."""
    code, printed = in_pytest("--collect-only", "-q")
    assert code == 0, printed
    assert "test_of_the_project.py::test_something" in printed
    assert len(set(node_ids(printed))) == 12, printed
    assert run_folders(project) == []


def test_an_item_is_where_its_spec_is(project: Path, in_pytest: Pytest) -> None:
    """An editor goes to the line of the variant."""
    places = {}

    class Noting:
        def pytest_collection_finish(self, session: pytest.Session) -> None:
            places.update({item.name: item.location for item in session.items})

    pytest.main([*PLAIN, SMALL, "--collect-only", "-q"], plugins=[Noting()])
    (file, line, _) = next(place for name, place in places.items() if "silence" in name)
    spec = project / "fault_library" / "faults" / "sensor" / "silence.yaml"
    assert (project / file).samefile(spec)
    assert line is not None and "no_data:" in spec.read_text().splitlines()[line]


@pytest.mark.parametrize("words", [("-k", "nosuchname"), ("-m", "nosuchmarker"), ("-n", "2", "-k", "nosuch")])
def test_a_selection_of_nothing_runs_nothing(
    project: Path, in_pytest: Pytest, words: tuple[str, ...]
) -> None:
    code, printed = in_pytest(SMALL, *words)
    assert code == pytest.ExitCode.NO_TESTS_COLLECTED, printed
    assert run_folders(project) == []


def test_options_that_select_tests_select_experiments(in_pytest: Pytest) -> None:
    """Markers are fault type, scenario, method and context. A node id names one experiment."""
    _, printed = in_pytest(SMALL, "--collect-only", "-q")
    every = node_ids(printed)
    silence = [name for name in every if "silence" in name]
    far_silence = [name for name in silence if "-far-" in name]
    assert 0 < len(far_silence) < len(silence) < len(every)
    for words, expected in (
        ((SMALL, "-k", "silence"), silence),
        ((SMALL, "-k", "no_data"), silence),  # the variant
        ((SMALL, "-m", "silence and A"), silence),
        ((SMALL, "-m", "not guided and not random"), []),
        ((SMALL, *(f"--deselect={name}" for name in every if name not in silence)), silence),
        ((far_silence[0],), far_silence[:1]),
        ((".", "-k", "sensor"), every),
    ):
        _, printed = in_pytest(*words, "--collect-only", "-q")
        assert node_ids(printed) == expected, words


def test_a_selection_is_an_unfinished_run(project: Path, in_pytest: Pytest) -> None:
    """Its checks come with its first item, and their remarks are no errors, even if warnings are. Its records
    count for the next call, which repeats none."""
    code, printed = in_pytest(SMALL, "-k", "silence", "-v", "-W", "error")
    assert code == 0, printed
    assert "4 passed" in printed and counts(printed) == (4, 4)
    assert "no golden run reaches the trigger" in printed
    assert "the other 8 have a result" in printed
    [run] = run_folders(project)
    assert not (run / "results.csv").exists()
    stages = re.findall("^(planning|checks|golden runs|tables)", printed, re.MULTILINE)
    assert stages[:3] == ["planning", "checks", "golden runs"]
    code, printed = in_pytest(SMALL, "-k", "silence or distance", "-n", "2", "--dist", "load")
    assert code == 0, printed
    assert "8 passed" in printed and counts(printed) == (8, 4)


def test_all_items_give_what_mutator_run_gives(
    project: Path, in_pytest: Pytest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers run what earlier selections left. Tables and seal come then."""
    code, printed = in_pytest("-n", "2")  # plain: the project's tests and campaign
    assert code == 0, printed
    assert "13 passed" in printed and counts(printed) == (12, 4)
    assert "proof: 3 of 3" in printed
    [run] = run_folders(project)
    workspace = Workspace(library=project / "fault_library", templates=project / "templates")
    summary = run_campaign(workspace, "small", tmp_path / "run", workers=2, reuse=False)
    assert (tmp_path / "run" / "results.csv").read_bytes() == (run / "results.csv").read_bytes()
    assert f"seal: {summary.seal}" in printed


@pytest.mark.parametrize(
    "words",
    [
        ("-n", "2", "--dist", "loadgroup"),
        pytest.param(("-n", "1"), marks=pytest.mark.slow),
        ("-p", "no:xdist"),
    ],
)
def test_what_has_a_result_passes_without_a_run(in_pytest: Pytest, words: tuple[str, ...]) -> None:
    code, printed = in_pytest(SMALL, *words, "--durations", "3")
    assert code == 0, printed
    assert "12 passed" in printed and counts(printed) == (12, 0)


def test_a_hazard_can_fail_a_test(project: Path, in_pytest: Pytest, tmp_path: Path) -> None:
    """Its message is the sentence, the injected change and the command that replays it. Options for failed
    tests then work as for any test."""
    junit = tmp_path / "junit.xml"
    code, printed = in_pytest(SMALL, "--hazard-fails", f"--junitxml={junit}")
    assert code == 1, printed
    assert "3 failed, 9 passed" in printed
    assert "hazard H3, allowed: none" in printed
    assert "\n+" in printed and "new file mode" not in printed  # the diff, without the probe
    [run] = run_folders(project)
    assert re.search(rf"replay: mutator show [0-9a-f]{{8}} --run {run} --drive", printed)
    cases = ElementTree.parse(junit).getroot().findall(".//testcase")
    assert len(cases) == 12
    assert sum(case.find("failure") is not None for case in cases) == 3
    assert "small" in (cases[0].get("classname") or "")
    code, printed = in_pytest(SMALL, "--hazard-fails", "--lf", "-x")
    assert code == 1, printed
    assert "1 failed" in printed and "passed" not in printed
    code, printed = in_pytest(SMALL, "--ff", "-q", "--collect-only")
    lane = [name for name in node_ids(printed) if "lane" in name]
    assert len(lane) == 4 and set(node_ids(printed)[:3]) < set(lane)


def test_a_campaign_says_which_hazards_are_expected(project: Path, in_pytest: Pytest) -> None:
    """The results of the other campaign count, because an expectation changes no run."""
    text = (project / SMALL).read_text()
    for name, expectation, code in (("strict", "{hazards: [H1]}", 1), ("lax", "{hazards: [H3]}", 0)):
        path = project / "fault_library" / "campaigns" / f"{name}.yaml"
        path.write_text(text + f"expect: {expectation}\n")
        answer, printed = in_pytest(path)
        assert answer == code, printed
        assert "12 of 12 reused" in printed


def test_an_edit_of_the_target_begins_a_new_run(project: Path, in_pytest: Pytest) -> None:
    file = next(path for path in (project / "tree").rglob("*.py") if path.stat().st_size)
    before = file.read_text()
    earlier = run_folders(project)
    file.write_text(before + "\n# edited\n")
    try:
        code, printed = in_pytest(SMALL, "-k", "silence and far and guided")
    finally:
        file.write_text(before)
    assert code == 0, printed
    assert counts(printed) == (1, 1)
    assert len(run_folders(project)) == len(earlier) + 1


def test_items_of_a_frozen_plan(project: Path, in_pytest: Pytest, tmp_path: Path) -> None:
    """A folder that `mutator plan` has written has its own choice of experiments."""
    command = [sys.executable, "-m", "mutator", "plan", "small", "--out", tmp_path / "run", "--limit", "2"]
    subprocess.run(command, check=True, capture_output=True, env=os.environ | {"MUTATOR_ROOT": str(project)})
    code, printed = in_pytest("--campaign", "small", f"--campaign-out={tmp_path / 'run'}", "-n", "2")
    assert code == 0, printed
    assert "2 passed" in printed  # and none of the project's tests
    outside = ["-c", os.devnull, "--rootdir", tmp_path, f"--campaign-out={tmp_path / 'run'}"]
    for words in ((), ("-n", "1")):
        code, printed = in_pytest("--campaign", "small", *outside, *words)
        assert code == 0, printed
        assert "2 passed" in printed
    assert "2 of 2 experiments done" in printed


def test_saved_experiments_are_tests_of_the_project(
    project: Path, in_pytest: Pytest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever reaches another hazard than when it was saved fails. What a campaign ran is not repeated."""
    run = next(folder for folder in run_folders(project) if (folder / "results.csv").exists())
    with (run / "results.csv").open() as file:
        lane = next(row for row in csv.DictReader(file) if row["outcome"] == "hazard")["experiment_id"]
    monkeypatch.setenv("MUTATOR_ROOT", str(project))
    assert main(["show", lane, "--run", str(run), "--save", "regressions/lane.yaml"]) == 0
    code, printed = in_pytest("-k", "regressions", "-n", "2")
    assert code == 0, printed
    assert "1 passed" in printed and "1 of 1 reused" in printed
    saved = project / "regressions" / "lane.yaml"
    saved.write_text(saved.read_text().replace('{"hazards": ["H3"]}', '{"hazards": []}'))
    code, printed = in_pytest("regressions/lane.yaml")
    assert code == 1, printed
    assert "regressions/lane.yaml::sensor/lane" in printed and "hazard H3, allowed: none" in printed


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["--campaign-out", "out"], 4, "--campaign-out without a campaign"),
        (["--require-reviewed"], 4, "--require-reviewed without a campaign"),
        (["--hazard-fails"], 4, "--hazard-fails without a campaign"),
        (["--campaign", "small", "--campaign-out=out", "--require-reviewed"], 1, "not approved"),
        (["--campaign", "small", "--dist", "each", "--tx", "popen"], 4, "--dist each with a campaign"),
        (["--campaign", "nosuch", "--campaign-out=out"], 4, "no campaign 'nosuch'"),
        (["--campaign", "small", "--campaign-out=tree"], 2, "has no run.json and is not empty (toycar)"),
        (["--campaign", "small", "--campaign-out=newer"], 2, "use a newer version of mutator"),
        (["--campaign", "unarmed", "--campaign-out=out", "-n", "1"], 1, "canary: did not reach H3"),
    ],
)
def test_mistakes_under_pytest_have_clear_errors(
    toy: Workspace,
    words: list[str],
    code: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    root = toy.library.parent
    monkeypatch.chdir(root)
    (root / "newer").mkdir()
    (root / "newer" / "run.json").write_text(json.dumps({"schema": "run/99"}))
    text = toy.campaign("small").read_text().replace("at_s: 1.0", "at_s: 5.9")
    (toy.library / "campaigns" / "unarmed.yaml").write_text(text)
    assert pytest.main([*PLAIN, "--tb=short", "-rN", *words]) == code
    printed = "".join(capfd.readouterr())
    assert told in printed
    assert "Traceback" not in printed


def test_the_plugin_does_nothing_without_a_campaign(toy: Workspace) -> None:
    """The plugin imports no other part of the harness that takes time. Settings with its options
    are no mistake."""
    (toy.library.parent / "pytest.ini").write_text("[pytest]\naddopts = --hazard-fails\n")
    test = "import sys\n\ndef test_it():\n    assert 'mutator.execution.session' not in sys.modules\n"
    (toy.library.parent / "test_it.py").write_text(test)
    answer = subprocess.run(
        [sys.executable, "-m", "pytest", *PLAIN, "test_it.py"],
        cwd=toy.library.parent,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert "1 passed" in answer.stdout
    assert "experiments" not in answer.stdout
