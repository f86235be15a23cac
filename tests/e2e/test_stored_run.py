"""A stored run folder is read as it was written, and a run of today has its plan and results.

tests/fixtures/run has the folder, with the library and target that made it. A folder of another schema is
refused."""

import json
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import pytest

from mutator import load_run
from mutator.cli.app import main
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.exports import Format
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import RUN_SCHEMA
from mutator.workspace import Workspace

FIXTURE = Path(__file__).parents[1] / "fixtures" / "run"
EXPERIMENTS = 12
HAZARDS = 3
KEPT = "07bbcc0632ee6107"  # the fixture has its trace

Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shutil.copytree(FIXTURE, tmp_path_factory.mktemp("stored") / "run")


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


def test_it_opens_and_its_ids_still_follow_from_its_content(place: Path) -> None:
    run = load_run(place / "small", workspace=place / "toy")
    assert [*run.experiments] == [*plan_file.experiment_ids(run.path)]
    assert {e.fault.id for e in run.experiments.values()} == {*run.faults}
    assert len(run.results) == EXPERIMENTS == len(run.experiments)
    assert {*run.results.index} == {*run.folder.records()} == {*run.folder.records("proof")}
    assert all("# fi:" in run.experiment(name).patch for name in run.experiments)
    assert len(run.golden("A")) == len(run.experiment(KEPT).traces().faulty) > 100


@pytest.mark.slow
def test_a_fresh_run_has_the_same_plan_and_results(place: Path, fresh: Path) -> None:
    old, new = RunFolder.open(place / "small"), RunFolder.open(fresh)
    assert new.head.plan == old.head.plan
    assert [*plan_file.experiment_ids(new.path)] == [*plan_file.experiment_ids(old.path)]
    assert_results_as_stored(fresh / "results.csv", FIXTURE / "small")
    assert {name: record.trace_digest for name, record in new.records().items()} == {
        name: record.trace_digest for name, record in old.records().items()
    }


@pytest.mark.parametrize("schema", ["run/1", "run/2", "run/4"])
def test_a_folder_of_another_schema_is_refused_in_a_sentence(cli: Cli, place: Path, schema: str) -> None:
    shutil.copytree(place / "small", copy := place / schema.replace("/", "-"))
    head = copy / "run.json"
    head.write_text(head.read_text().replace(RUN_SCHEMA, schema))
    newer = "use a newer version of mutator"
    older = "use the version of mutator that wrote it, or write it anew with this one"
    remedy = newer if schema > RUN_SCHEMA else older
    with pytest.raises(MutatorError) as caught:
        load_run(copy)
    assert str(caught.value) == f"{head}: schema '{schema}'; expected {RUN_SCHEMA}; {remedy}"
    for words in (
        ("show", KEPT, "--run", copy),
        ("compare", place / "small", copy),
        ("report", copy),
        ("export", copy, "--format", "csv"),
        ("verify", copy),
        ("verify", copy, "--repair"),
        ("seal", copy),
        ("merge", copy, "--out", place / "merged"),
        ("plan", "small", "--out", copy),
        ("run", "small", "--out", copy),
    ):
        code, _, err = cli(*words)
        assert code == 2 and f"schema '{schema}'" in err and remedy in err, (words, err)


@pytest.mark.slow
def test_it_compares_with_itself_and_a_fresh_one(cli: Cli, fresh: Path) -> None:
    for one, other in (("small", "small"), ("small", "fresh"), ("fresh", "small")):
        code, out, err = cli("compare", one, other, "--fail-on", "worse,new-hazard,unmatched")
        assert code == 0, err
        assert f"In both runs: {EXPERIMENTS} experiments" in out and "None of them changed" in out


@pytest.mark.parametrize("format", list(Format))
def test_it_exports_in_every_format(cli: Cli, place: Path, format: Format) -> None:
    file = place / f"export-{format.value}"
    code, _, err = cli("export", "small", "--format", format.value, "--out", file)
    assert code == 0, err
    if format is Format.CSV:
        assert_results_as_stored(file, FIXTURE / "small")
    elif format is Format.PARQUET:
        assert len(pd.read_parquet(file)) == EXPERIMENTS
    elif format is Format.JUNIT:
        assert file.read_text().count("<testcase ") == EXPERIMENTS
    elif format is Format.MCAP:
        written = {path.stem for path in file.iterdir()}
        assert KEPT in written and len(written) == EXPERIMENTS
    elif format is Format.SARIF:
        (found,) = json.loads(file.read_text())["runs"]
        assert len(found["results"]) == HAZARDS
    elif format is Format.CODEQUALITY:
        assert len(json.loads(file.read_text())) == HAZARDS
    else:
        mutants = json.loads(file.read_text())["files"]["toycar/sensing.py"]["mutants"]
        assert {mutant["status"] for mutant in mutants} >= {"Killed", "Survived"}


def test_it_is_reported_with_the_same_results(cli: Cli, place: Path) -> None:
    shutil.copytree(place / "small", copy := place / "reported")
    for derived in ("results.csv", "results.parquet", "timings.parquet"):
        (copy / derived).unlink()
    shutil.rmtree(copy / "report")
    code, out, err = cli("report", copy)
    assert code == 0, err
    assert f"hazard {HAZARDS}" in out and (copy / "report" / "index.html").is_file()
    assert_results_as_stored(copy / "results.csv", FIXTURE / "small")


def assert_results_as_stored(table: Path, run: Path) -> None:
    """The table has each cell of the stored results.csv, under the names that its columns have today."""
    stored = pd.read_csv(run / "results.csv", dtype=str, keep_default_na=False)
    stored = stored.rename(columns={"fault_tolerant_time": "time_to_hazard"})
    shown = pd.read_csv(table, dtype=str, keep_default_na=False)
    pd.testing.assert_frame_equal(shown[[*stored]], stored)


def test_a_renamed_column_is_no_damage(cli: Cli, place: Path) -> None:
    """Until the tables are rebuilt, `verify` says why they differ, in one sentence."""
    shutil.copytree(FIXTURE / "small", copy := place / "renamed")
    code, out, _ = cli("verify", copy)
    said = "tables with the columns of another version of mutator (fault_tolerant_time)"
    assert code == 1 and said in " ".join(out.split()) and "1 difference\n" in out
    code, _, err = cli("show", "--run", copy, "--only", "fault_tolerant_time < 2")
    assert code == 2 and "write `time_to_hazard`" in err
    code, _, err = cli("report", copy)
    assert code == 0 and "damage" not in err
    assert cli("verify", copy)[0] == 0
    code, out, err = cli("show", "--run", copy, "--only", "time_to_hazard < 2")
    assert code == 0 and "3 of 3 experiments" in out, err


@pytest.mark.parametrize("words", [("show",), ("export", "--format", "csv")], ids=["show", "export"])
def test_who_rebuilds_tables_of_another_version_says_so_once(
    cli: Cli, place: Path, words: tuple[str, ...]
) -> None:
    """A command that only reads also rebuilds the tables, and says so; the next one has nothing to say."""
    shutil.copytree(FIXTURE / "small", copy := place / f"older-{words[0]}")
    where = ("--run", copy) if words[0] == "show" else (copy, "--out", copy / "written.csv")
    said = (
        f"{copy}: the tables had the columns of another version of mutator (fault_tolerant_time), "
        "so they were rebuilt"
    )
    code, _, err = cli(*words, *where)
    assert code == 0 and " ".join(err.split()).count(said) == 1, err
    assert_results_as_stored(copy / "results.csv", FIXTURE / "small")
    code, _, err = cli(*words, *where)
    assert code == 0 and "another version" not in err


def test_show_runs_no_experiment(cli: Cli, place: Path) -> None:
    code, out, err = cli("show", KEPT, "--run", "small", "--json")
    assert code == 0, err
    shown = json.loads(out)
    assert shown["status"] == "ok" and shown["patch"].count("# fi:") > 2
    assert Path(shown["plot"]).is_file() and not (place / "small" / "work").exists()


def test_approvals_still_apply(cli: Cli, place: Path) -> None:
    code, out, err = cli("review", "list", "--campaign", "small", "--json")
    assert code == 0, err
    assert out.count('"approved"') == 4


def test_it_is_not_resumed_by_another_version(cli: Cli, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(place / "small", copy := place / "resumed")
    shutil.copytree(place / "toy", library := place / "changed")
    before = sorted((path, path.stat().st_mtime_ns) for path in copy.rglob("*") if path.name != "owner.lock")
    head = RunFolder.open(copy).head
    made_by = f"was planned by mutator {head.provenance.mutator} ({head.schema})"
    with monkeypatch.context() as patch:
        patch.setattr("mutator.campaigns.run_provenance.VERSION", "99.0")
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


def test_damage_never_causes_a_traceback(cli: Cli, place: Path) -> None:
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
