"""A campaign that explores, as tests: an item for each location, and one bench that runs them all."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.workspace import Workspace

Pytest = Callable[..., tuple[int, str]]
FILE = "fault_library/campaigns/explored.yaml"
CAMPAIGN = """\
schema: campaign/1
name: explored
about: How wrong the lane sensor and the distance may be.
target: toycar
scenarios: [A]
faults: [{spec: sensor/lane/shifted}, {spec: sensor/distance/longer}]
explore: {goal: GOAL, starts: [1], points: 3, longest_s: 3, observe_s: 0.5, validation: 3, budget: 6}
seed: 3
canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}
limits: {cpu_s: 20, wall_s: 60, memory_mb: 1024, steps: 200}
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    root = copy_toycar(tmp_path_factory.mktemp("project")).library.parent
    (root / "pyproject.toml").write_text('[tool.mutator]\nlibrary = "fault_library"\n')
    (root / FILE).write_text(CAMPAIGN.replace("GOAL", "envelope"))
    (root / "fault_library/campaigns/searched.yaml").write_text(
        CAMPAIGN.replace("GOAL", "find").replace("explored", "searched")
    )
    return root


@pytest.fixture
def in_pytest(project: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Pytest:
    """Call pytest in the project; return its exit code and what it printed."""
    monkeypatch.chdir(project)
    monkeypatch.setenv("XDG_CACHE_HOME", str(project / "cache"))

    def call(*words: object) -> tuple[int, str]:
        capfd.readouterr()
        code = int(pytest.main(["-p", "no:hypothesispytest", "--assert=plain", *map(str, words)]))
        return code, "".join(capfd.readouterr())

    return call


def seal_in(printed: str) -> str:
    [seal] = re.findall(r"^seal: (\w+)$", printed, re.MULTILINE)
    return str(seal)


def test_each_location_is_an_item(project: Path, in_pytest: Pytest) -> None:
    """Collecting runs nothing; names, markers and keywords select locations."""
    code, printed = in_pytest(FILE, "--collect-only", "-q")
    assert code == 0, printed
    assert printed.count(f"{FILE}::") == 2 and f"{FILE}::sensor/lane/shifted" in printed
    _, selected = in_pytest(FILE, "--collect-only", "-q", "-m", "lane and A")
    assert f"{FILE}::sensor/lane/shifted" in selected and "longer" not in selected
    assert not (project / "cache").exists()


def test_one_bench_runs_all_locations(project: Path, in_pytest: Pytest) -> None:
    """The same seal as `mutator run`; each plane has a sentence; the next call runs nothing."""
    code, printed = in_pytest(FILE)
    assert code == 0, printed
    assert "2 passed" in printed and "sensor/lane/shifted in A from 1 s: " in printed
    run = mutator.run(FILE, project / "runs/same", workers=1, workspace=Workspace.find(root=project))
    assert seal_in(printed) == run.seal
    code, again = in_pytest(FILE, "-k", "longer")
    assert code == 0 and "1 passed" in again, again
    assert "done, 0 now" in again, again


def test_workers_of_xdist_share_one_run_folder(project: Path, in_pytest: Pytest) -> None:
    """The process that deals owns it, and gives each worker the endings of its items."""
    out = project / "runs/dealt"
    code, printed = in_pytest(FILE, "-n", "2", f"--campaign-out={out}")
    assert code == 0, printed
    assert "2 passed" in printed
    run = mutator.load_run(out, workspace=Workspace.find(root=project))
    assert run.seal == seal_in(printed) and len(run.envelopes) == 2
    assert run.verify().differences == ()


@pytest.mark.parametrize("words", [(), ("-n", "2")])
def test_a_location_with_a_hazard_fails_if_a_user_asks(in_pytest: Pytest, words: tuple[str, ...]) -> None:
    """With what is survived, what is not, and a run that shows it."""
    code, printed = in_pytest(FILE, "--hazard-fails", *words)
    assert code == 1, printed
    assert "1 failed, 1 passed" in printed
    assert "is hazardous" in printed and "replay: mutator show " in printed


def test_a_search_has_an_item_for_each_location(in_pytest: Pytest) -> None:
    """It fails for a finding if a user asks."""
    code, printed = in_pytest("--campaign", "searched", "--hazard-fails")
    assert code == 1, printed
    assert re.search(r"sensor/lane/shifted .* in A from 1 for .* s( \(inferred\))?: H3 after ", printed)


@pytest.mark.parametrize("words", [("--require-reviewed",), ("--accept-versions",)])
def test_what_an_exploration_has_not_is_refused(in_pytest: Pytest, words: tuple[str, ...]) -> None:
    """With exit code 2 and the option's name, before anything runs."""
    code, printed = in_pytest(FILE, *words, "--campaign-out=new")
    assert code == 2, printed
    assert f"{words[0]} with a campaign that explores" in printed
    assert not Path("new").exists()


def test_a_mistake_in_the_file_is_named(project: Path, in_pytest: Pytest) -> None:
    """A start that no table has: nothing is collected."""
    wrong = project / "fault_library/campaigns/wrong.yaml"
    wrong.write_text(CAMPAIGN.replace("GOAL", "envelope").replace("starts: [1]", "starts: [nowhere]"))
    code, printed = in_pytest(wrong)
    wrong.unlink()
    assert code == 2 and "nowhere" in printed
