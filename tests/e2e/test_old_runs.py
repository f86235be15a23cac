"""Run folders of earlier versions can be read but not resumed. tests/fixtures/ has one for each run-folder
schema, with the library and target that made it."""

import json
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import pytest

from mutator import load_run
from mutator.cli.app import main
from mutator.execution.running import run_campaign
from mutator.exports import Format
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import SCHEMA
from mutator.workspace import Workspace

FIXTURES = sorted((Path(__file__).parents[1] / "fixtures").glob("run-*"))
EXPERIMENTS = 12
KEPT = "07bbcc0632ee6107"  # every fixture has its trace

Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module", params=FIXTURES, ids=lambda path: path.name)
def fixture(request: pytest.FixtureRequest) -> Path:
    path: Path = request.param
    return path


@pytest.fixture(scope="module")
def place(fixture: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shutil.copytree(fixture, tmp_path_factory.mktemp("old") / fixture.name)


@pytest.fixture(scope="module")
def fresh(place: Path) -> Path:
    workspace = Workspace.find(root=place / "toy")
    out = place / "fresh"
    assert run_campaign(workspace, "small", out, engine="reference").exit_code == 0
    return out


@pytest.fixture
def cli(place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Cli:
    monkeypatch.chdir(place)
    monkeypatch.setenv("MUTATOR_ROOT", str(place / "toy"))

    def run(*words: object) -> tuple[int, str, str]:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return (code, *capfd.readouterr())

    return run


LATER = {"fault_tolerant_time", "manifest_to_hazard"}  # columns that old runs lack


def assert_same_cells(new: Path, old: Path) -> None:
    """Ignore newer columns, and the car columns that version 0.1 left empty for this target."""
    today, then = (pd.read_csv(path, dtype=str, keep_default_na=False) for path in (new, old))
    assert {*today.columns} - {*then.columns} <= LATER
    shared = [column for column in today.columns if column in then.columns or column not in LATER]
    assert (then[shared] == today[shared]).all(axis=None)
    gone = then.drop(columns=shared)
    assert {*gone.columns} <= {"h2", "t_h2", "max_dev_steer"} and (gone == "").all(axis=None)


def test_there_is_a_fixture_for_each_schema() -> None:
    schemas = [RunFolder.open(path / "small").head["schema"] for path in FIXTURES]
    assert [path.name.replace("-", "/") for path in FIXTURES] == schemas
    assert schemas == [f"run/{number}" for number in range(1, len(schemas) + 1)] and schemas[-1] == SCHEMA


def test_an_old_run_opens_and_its_ids_still_follow_from_its_content(place: Path) -> None:
    run = load_run(place / "small", workspace=place / "toy")
    assert [*run.experiments] == [*plan_file.ids(run.path)]
    assert {e.fault.id for e in run.experiments.values()} == {*run.faults}
    assert len(run.results) == EXPERIMENTS == len(run.experiments)
    assert {*run.results.index} == {*run.folder.records()} == {*run.folder.records("proof")}
    assert all("# fi:" in run.experiment(name).patch for name in run.experiments)
    assert len(run.golden("A")) == len(run.experiment(KEPT).traces().faulty) > 100


@pytest.mark.slow
def test_a_fresh_run_has_the_same_plan_and_results(place: Path, fresh: Path) -> None:
    old, new = RunFolder.open(place / "small"), RunFolder.open(fresh)
    assert new.head["plan"] == old.head["plan"]
    assert [*plan_file.ids(new.path)] == [*plan_file.ids(old.path)]
    assert_same_cells(fresh / "results.csv", old.path / "results.csv")
    assert {name: record.trace_digest for name, record in new.records().items()} == {
        name: record.trace_digest for name, record in old.records().items()
    }


def test_runs_without_digests_are_marked_as_not_verifiable(cli: Cli, place: Path) -> None:
    old = is_old(place / "small")
    run = load_run(place / "small")
    assert (run.verifiable, run.seal is None, "not verifiable" in repr(run)) == (not old, old, old)
    shutil.copytree(place / "small", copy := place / "told")
    for words in (("show", KEPT, "--run", copy), ("compare", copy, copy), ("verify", copy)):
        code, out, err = cli(*words)
        assert (code == 1) == (old and words[0] == "verify"), err
        assert ("not verifiable" in out) == old
    assert cli("report", copy)[0] == 0
    told = (copy / "report" / "REPORT.md").read_text()
    assert f"| seal | {'none: not verifiable, because run/1 has no digests' if old else run.seal} |" in told


def is_old(run: Path) -> bool:
    return json.loads((run / "run.json").read_text())["schema"] == "run/1"


@pytest.mark.slow
def test_an_old_run_compares_with_itself_and_a_fresh_one(cli: Cli, fresh: Path) -> None:
    for one, other in (("small", "small"), ("small", "fresh"), ("fresh", "small")):
        code, out, err = cli("compare", one, other, "--fail-on", "worse,new-hazard,unmatched")
        assert code == 0, err
        assert f"In both runs: {EXPERIMENTS} experiments" in out and "None of them changed" in out


@pytest.mark.parametrize("format", list(Format))
def test_an_old_run_exports_in_every_format(cli: Cli, place: Path, fixture: Path, format: Format) -> None:
    file = place / f"export-{format.value}"
    code, _, err = cli("export", "small", "--format", format.value, "--out", file)
    assert code == 0, err
    if format is Format.CSV:
        assert file.read_bytes() == (place / "small" / "results.csv").read_bytes()
    elif format is Format.PARQUET:
        assert len(pd.read_parquet(file)) == EXPERIMENTS
    elif format is Format.JUNIT:
        assert file.read_text().count("<testcase ") == EXPERIMENTS
    elif format is Format.MCAP:
        written = {path.stem for path in file.iterdir()}
        has_series = (fixture / "small" / "series").is_dir()  # other tests might have made some in `place`
        assert KEPT in written and len(written) == (EXPERIMENTS if has_series else 1)
    else:
        mutants = json.loads(file.read_text())["files"]["toycar/sensing.py"]["mutants"]
        assert {mutant["status"] for mutant in mutants} >= {"Killed", "Survived"}


def test_an_old_run_is_reported_with_the_same_results(cli: Cli, place: Path, fixture: Path) -> None:
    shutil.copytree(place / "small", copy := place / "reported")
    for derived in ("results.csv", "results.parquet", "timings.parquet"):
        (copy / derived).unlink()
    shutil.rmtree(copy / "report")
    code, out, err = cli("report", copy)
    assert code == 0, err
    assert "hazard 3" in out and (copy / "report" / "index.html").is_file()
    assert_same_cells(copy / "results.csv", fixture / "small" / "results.csv")


def test_show_runs_no_experiment_of_an_old_run(cli: Cli, place: Path) -> None:
    code, out, err = cli("show", KEPT, "--run", "small", "--json")
    assert code == 0, err
    shown = json.loads(out)
    assert shown["status"] == "ok" and shown["patch"].count("# fi:") > 2
    assert Path(shown["plot"]).is_file() and not (place / "small" / "work").exists()


def test_approvals_of_an_old_run_still_apply(cli: Cli, place: Path) -> None:
    """Three of the four decisions apply to two groups each."""
    code, out, err = cli("review", "list", "--campaign", "small", "--json")
    assert code == 0, err
    approved = json.loads((place / "small" / "reviewed.json").read_text())["groups"]
    assert (out.count('"approved"'), len(approved)) == (4, 7)


def test_an_old_run_is_not_resumed(cli: Cli, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(place / "small", copy := place / "resumed")
    shutil.copytree(place / "toy", library := place / "changed")
    before = sorted((path, path.stat().st_mtime_ns) for path in copy.rglob("*") if path.name != "owner.lock")
    head = RunFolder.open(copy).head
    made_by = f"was planned by mutator {head['provenance']['mutator']} ({head['schema']})"
    with monkeypatch.context() as patch:
        patch.setattr("mutator.campaigns.provenance.VERSION", "99.0")
        for words in (("run",), ("plan",)):
            code, _, err = cli(*words, "small", "--out", copy)
            assert code == 2 and made_by in err and "can still be read" in err
    with (library / "tree" / "toycar" / "driver.py").open("a") as file:
        file.write("\n")
    with (library / "fault_library" / "targets" / "toycar.yaml").open("a") as file:
        file.write("\n")
    code, _, err = cli("run", "small", "--out", copy, "-n", "0", "--root", library)
    assert code == 2
    assert made_by in err or "changed since this run was planned: target, manifest" in err
    after = sorted((path, path.stat().st_mtime_ns) for path in copy.rglob("*") if path.name != "owner.lock")
    assert [entry for entry in after if entry[0].name != "workers"] == before


def damages(data: bytes, draw: random.Random) -> Iterator[bytes]:
    place = draw.randrange(len(data) or 1)
    yield data[:place] + bytes([(data[place] if data else 0) ^ 1 << draw.randrange(8)]) + data[place + 1 :]
    yield data[:place]
    yield data[:place] + bytes(min(64, len(data) - place)) + data[place + 64 :]
    lines = data.splitlines(keepends=True)
    i, j = draw.randrange(len(lines) or 1), draw.randrange(len(lines) or 1)
    yield b"".join([*lines[:i], *lines[i + 1 :]])
    yield b"".join([*lines[:i], *lines[i : i + 1], *lines[i:]])
    if lines:
        lines[i], lines[j] = lines[j], lines[i]
    yield b"".join(lines)


READ = ("*.json", "*.jsonl", "*.yaml", "*.csv", "*.parquet", "*.npz", "*.patch", "*.blocks")


def test_damage_to_an_old_run_never_causes_a_traceback(cli: Cli, place: Path) -> None:
    shutil.copytree(place / "small", copy := place / "damaged")
    draw = random.Random(place.name)
    files = sorted({path for pattern in READ for path in copy.rglob(pattern) if "report" not in path.parts})
    for path in draw.sample(files, len(files) // 3):
        data = path.read_bytes()
        for damaged in draw.sample([*damages(data, draw)], 2):
            path.write_bytes(damaged)
            for words in (("show", KEPT, "--run", copy, "--no-plot"), ("export", copy, "--format", "junit")):
                code, _, err = cli(*words)
                assert code in (0, 1, 2) and "Traceback" not in err, (path, err)
                assert code == 0 or err.startswith("error: "), (path, err)
            path.write_bytes(data)
