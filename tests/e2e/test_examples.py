"""The examples: third-party controllers, each from its installed package (extra `examples`)."""

import csv
import re
import sys
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import pytest

import mutator
from mutator.campaigns.plan import build_plan
from mutator.engines.engine_jobs import RunMode
from mutator.execution.campaign_running import run_campaign
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "examples"
INSTALLED = {"cartpole": "simple_pid", "highway": "highway_env", "opendbc": "opendbc"}
ALSO = {"cartpole": "gymnasium"}
MOST_GLUE, MOST_YAML, MOST_SCENE = 25, 40, 10  # lines
FORKED = 0.95


@pytest.fixture(scope="module", params=INSTALLED)
def example(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    for package in (INSTALLED[name], ALSO.get(name, "numpy")):
        if find_spec(package) is None:
            pytest.skip(f"no {package} here: pip install 'mutator-fi[examples]'")
    return name


@pytest.fixture(scope="module")
def workspace(example: str) -> Workspace:
    return Workspace.find(library=EXAMPLES / example / "fault_library")


@pytest.fixture(scope="module")
def run(workspace: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("examples") / "run"
    assert run_campaign(workspace, "first", out, workers=2).exit_code == 0
    return out


def rows(run: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((run / "results.csv").open()))


def test_check_finds_nothing_to_fix(workspace: Workspace) -> None:
    assert mutator.check_library(workspace) == []


def test_every_experiment_ends_well(run: Path) -> None:
    """A crash of the controller is a result."""
    statuses = Counter(row["status"] for row in rows(run))
    assert sum(statuses.values()) >= 40
    assert set(statuses) <= {"ok", "crashed"}
    assert len({row["outcome"] for row in rows(run)} & {"hazard", "sdc"}) == 2


def test_only_a_contact_has_a_contact_speed(run: Path) -> None:
    contacts = [(row.get("contact_speed", ""), row.get("delta_v", "")) for row in rows(run)]
    assert all(bool(speed) == bool(delta_v) for speed, delta_v in contacts)


def test_a_bench_tells_the_same_figures(run: Path, workspace: Workspace, tmp_path: Path) -> None:
    """Asked in batches, two of them in flight, the campaign's experiments have the same rows."""
    planned = build_plan(workspace, "first").experiments
    with mutator.open_bench(workspace, tmp_path / "bench", campaign="first", workers=2) as bench:
        for begin in range(0, len(planned), 10):
            bench.submit(planned[begin : begin + 10])
            if begin:
                results = bench.results()
                assert all(next(results).experiment_id for _ in range(10))
    by_id = [{row["experiment_id"]: row for row in rows(folder)} for folder in (run, tmp_path / "bench")]
    for row in (row for table in by_id for row in table.values()):
        row.pop("seed", None)  # a campaign of one seed has no such column
    assert by_id[0] == by_id[1]


def test_nearly_all_experiments_are_forked(run: Path) -> None:
    ended = {row["experiment_id"] for row in rows(run) if row["status"] == "ok"}
    timings = RunFolder.open(run).timings()
    forked = {name for name in ended if timings[name]["engine"] == RunMode.FORK}
    assert len(forked) >= FORKED * len(ended)


def test_engines_agree(run: Path, workspace: Workspace, tmp_path: Path) -> None:
    assert run_campaign(workspace, "first", tmp_path / "run", workers=2, engine="reference").exit_code == 0
    for name in ("results.csv", "plan.csv"):
        assert (tmp_path / "run" / name).read_bytes() == (run / name).read_bytes()


def own_lines(folder: Path, suffix: str) -> Counter[str]:
    """Return the lines for a first campaign. The campaigns `operators` and `defended` are further ones."""
    further = ("operators.yaml", "defended.yaml")
    paths = (p for p in folder.rglob(f"*{suffix}") if p.name not in further and p.parent.name != "defences")
    text = "\n".join(path.read_text() for path in sorted(paths))
    return counted(re.sub(r"(?m)^actuation:.*\n(?:[ #].*\n)+", "", text))


def scene_lines(folder: Path) -> Counter[str]:
    (manifest,) = folder.glob("fault_library/targets/*.yaml")
    (scene,) = re.findall(r"(?m)^scene:.*\n(?:[ #].*\n?)+", manifest.read_text())
    return counted(scene)


def counted(text: str) -> Counter[str]:
    lines = map(str.strip, text.splitlines())
    return Counter(line for line in lines if line and not line.startswith("#"))


@pytest.mark.parametrize(("suffix", "most"), [(".py", MOST_GLUE), (".yaml", MOST_YAML)])
def test_an_example_needs_few_handwritten_lines(example: str, suffix: str, most: int, tmp_path: Path) -> None:
    mutator.init_library(tmp_path / "new", target=f"installed:{INSTALLED[example]}")
    own = own_lines(EXAMPLES / example, suffix) - own_lines(tmp_path / "new", suffix)
    if suffix == ".yaml":
        scene = scene_lines(EXAMPLES / example)
        assert 0 < scene.total() <= MOST_SCENE, f"{scene.total()} lines of the scene"
        own -= scene
    assert 0 < own.total() <= most, f"{own.total()} lines"


def test_the_extra_has_what_the_examples_need() -> None:
    """The extra needs a Python that opendbc supports."""
    text = (EXAMPLES.parent / "pyproject.toml").read_text(encoding="utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith("examples = ")]
    for package in ("gymnasium", "highway-env", "opendbc", "simple-pid"):
        assert f'"{package}>=' in line
    assert sys.version_info < (3, 13) or "python_version < '3.13'" in line


def test_defences_need_only_yaml(workspace: Workspace, tmp_path: Path) -> None:
    """Each set runs the plan with its own golden runs, the audit passes, and a defence acts in some run."""
    run = tmp_path / "run"
    choices = mutator.Choices(limit=12)
    summary = run_campaign(workspace, "defended", run, workers=2, choices=choices)
    assert summary.exit_code == 0
    assert len(summary.defended) == 3
    records = [RunFolder.open(run / "defended" / name).records() for name in summary.defended]
    assert any(record.defences for of_set in records for record in of_set.values())
    assert mutator.verify(run, workspace=workspace).passed
