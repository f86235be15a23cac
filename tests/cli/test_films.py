"""`show --video` and `show --still`, with the film commands of the toy's manifest."""

import base64
import gzip
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.api.runs import load_run
from mutator.cli.app import main
from mutator.report import experiment_stills
from mutator.workspace import Workspace

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    root = copy_toycar(tmp_path_factory.mktemp("finished")).library.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        patch.setenv("MUTATOR_ROOT", str(root))
        assert (
            main(
                ["run", "toy", "--out", "runs/a", "--only", 'fault_type == "lane"', "--limit", "4", "-n", "0"]
            )
            == 0
        )
    return root


@pytest.fixture
def name(finished: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(finished)
    monkeypatch.setenv("MUTATOR_ROOT", str(finished))
    lines = Path("runs/a/results.csv").read_text().splitlines()
    return next(line.split(",")[0] for line in lines if ",hazard," in line)


def test_the_film_command_receives_both_runs_and_their_events(cli: Cli, name: str) -> None:
    answer = cli("show", name, "--no-plot", "--video", "out/a.json", "--still", "1.5=b.json", "--json").json
    assert answer["films"] == ["b.json", "out/a.json"]
    video, still = (json.loads(Path(path).read_text()) for path in ("out/a.json", "b.json"))
    assert video["golden"] != video["faulty"]
    assert (video["time"], still["time"]) == ([], ["1.5"])
    events = video["events"]
    assert events["outcome"] == "hazard"
    assert next(mark["label"] for mark in events["marks"]) == "activated"
    assert [mark["t"] for mark in events["marks"] if mark["kind"] == "hazard"] == [
        *answer["hazards_s"].values()
    ]
    assert events["active"] == [answer["activated_s"], answer["active_until_s"]]
    assert set(answer["hazards_s"]) <= set(events["names"])


def test_a_film_adds_no_file_to_the_run(cli: Cli, name: str) -> None:
    before = sorted(Path("runs/a").rglob("*"))
    answer = cli("show", name, "--no-plot", "--video", "a.json")
    assert sorted(Path("runs/a").rglob("*")) == before
    assert answer.code == 0
    assert "film: a.json" in answer.out
    assert "differs" not in answer.err


def test_a_still_without_a_file_name_is_in_the_report(cli: Cli, name: str) -> None:
    answer = cli("show", name, "--no-plot", "--still", "1.5", "--json").json
    assert [Path(path).name for path in answer["films"]] == [f"{name}-1.50s.jpg"]
    page = Path(cli("report", "runs/a", "--json").json["page"])
    [data] = re.findall(r'id="media">([^<]*)</script>', page.read_text())
    [[time, picture]] = json.loads(gzip.decompress(base64.b64decode(data)))[name]["stills"]
    assert time == "1.50"
    kept = Path("runs/a/plots") / f"{name}-1.50s.jpg"
    assert base64.b64decode(picture.partition(",")[2]) == kept.read_bytes()


@pytest.mark.slow
def test_a_run_takes_stills_of_its_worst_experiments(
    cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = root / "fault_library/targets/toycar.yaml"
    manifest.write_text(manifest.read_text().replace("still: [", "pictures: [alone]\n  still: ["))
    monkeypatch.setattr(experiment_stills, "PLANNED_PER_FILMED_EXPERIMENT", 2)
    words = ("run", "toy", "--only", "fault_type == 'distance'", "-n", "0", "--out", "runs/a")
    without = cli(*words, "--no-stills")
    assert without.code == 0 and "pictures" not in without.err
    assert not Path("runs/a/plots").exists()
    assert "pictures 0/" in cli(*words).err
    taken = {path.name: path.stat().st_mtime_ns for path in Path("runs/a/plots").iterdir()}
    run = load_run("runs/a")
    seen = [e for e in run.experiments.values() if "alone" in e.changes and run.records[e.id].t_manifest]
    [*chosen] = {name.partition("-")[0] for name in taken}
    assert 0 < len(chosen) <= run.folder.planned_experiment_count // 2
    assert set(chosen) <= {e.id for e in seen}
    record = run.records[chosen[0]]
    assert f"{chosen[0]}-{record.activation.first:.2f}s.jpg" in taken
    assert "pictures" not in cli(*words).err
    assert {path.name: path.stat().st_mtime_ns for path in Path("runs/a/plots").iterdir()} == taken


def test_an_error_of_the_film_command_is_quoted(cli: Cli, name: str) -> None:
    answer = cli("show", name, "--no-plot", "--video", "a.avi")
    assert answer.code == 2
    assert "a.avi: no .avi here" in answer.err
    assert not list(Path("runs/a").glob("film-*"))


def test_a_target_without_films_is_reported(cli: Cli, root: Path) -> None:
    manifest = root / "fault_library/targets/toycar.yaml"
    before, rest = manifest.read_text().split("film:\n")
    manifest.write_text(before + "trace:" + rest.split("trace:")[1])
    cli("plan", "toy", "--out", "runs/p", "--limit", "1")
    planned = Path("runs/p/plan.csv").read_text().splitlines()[1].split(",")[0]
    answer = cli("show", planned, "--video", "a.json")
    assert answer.code == 2
    assert "cannot be filmed" in answer.err
    assert "`film`" in answer.err


@pytest.mark.parametrize("still", ["early", "early=a.json", "=a.json", "nan=a.json", "1.5="])
def test_an_invalid_time_of_a_still_is_refused(cli: Cli, name: str, still: str) -> None:
    answer = cli("show", name, "--no-plot", "--still", still)
    assert answer.code == 2
    assert "14.5=early.png" in answer.err
