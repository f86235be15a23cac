"""A run from the command line: its files, its bytes and the user's mistakes."""

import errno
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from selfdrive.sim.run import main


@pytest.fixture
def run(scenarios, tmp_path):
    def go(name, *arguments, scenario="S1", steps=150):
        folder = tmp_path / name
        path = str(scenarios / f"{scenario}.yaml")
        code = main(["--scenario", path, "--out", str(folder), "--max-steps", str(steps), *arguments])
        assert code == 0
        return folder

    return go


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_a_run_writes_a_trace_and_a_record(run, scenarios):
    folder = run("a", "--seed", "5")
    trace = np.load(folder / "trace.npz")
    record = json.loads((folder / "record.json").read_text())
    assert len(trace["t"]) == 150
    assert record["schema"] == "sim-record/1"
    assert (record["scenario"], record["seed"], record["steps"], record["no_lead"]) == ("S1", 5, 150, False)
    assert record["scenario_digest"] == hashlib.sha256((scenarios / "S1.yaml").read_bytes()).hexdigest()
    assert record["trace_digest"] == hashlib.sha256((folder / "trace.npz").read_bytes()).hexdigest()
    assert record["engaged_from"] == pytest.approx(1.31, abs=0.02)
    assert record["engaged_to"] == 1.49
    assert record["hazards"] == {"H1": None, "H2": None, "H3": None, "H4": None}
    assert record["alerts"] == []


def test_a_run_has_the_same_bytes_after_another_run(run):
    first = contents(run("a"))
    run("other", "--no-lead", scenario="S2")
    assert contents(run("b")) == first


def test_an_incomplete_run_has_no_record(run, scenarios, monkeypatch, capsys):
    folder = run("a")
    opened = Path.open

    def full_disk(path, mode="r", *more, **options):
        if mode != "wb":
            return opened(path, mode, *more, **options)
        with opened(path, mode) as file:
            file.write(b"PK")
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "open", full_disk)
        arguments = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(folder), "--max-steps", "1"]
        assert main(arguments) == 2
    assert f"error: {folder}: No space left on device" in capsys.readouterr().err
    assert set(contents(folder)) == {"trace.npz"}
    assert contents(run("a")) == contents(run("b"))


def test_without_a_lead_the_road_is_free(run):
    folder = run("a", "--no-lead")
    assert set(np.load(folder / "trace.npz")["d_rel"]) == {200.0}
    assert json.loads((folder / "record.json").read_text())["no_lead"] is True


def test_a_wrong_scenario_exits_with_code_2(tmp_path, capsys):
    bad = tmp_path / "bad.yaml"
    bad.write_text("schema: scenario/1\nnmae: x\n")
    assert main(["--scenario", str(bad), "--out", str(tmp_path / "out")]) == 2
    shown = capsys.readouterr()
    assert shown.err.startswith(f"error: {bad}:2: unknown key 'nmae', expected one of schema, name")
    assert "did you mean 'name'?" in shown.err
    assert shown.out == ""
    assert not (tmp_path / "out").exists()


def test_an_unwritable_folder_exits_with_code_2(scenarios, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    arguments = ["--scenario", str(scenarios / "S1.yaml"), "--max-steps", "1"]
    assert main([*arguments, "--out", str(tmp_path / "file" / "out")]) == 2
    assert "choose another --out" in capsys.readouterr().err


def test_the_option_frames_needs_the_option_pictures(scenarios, tmp_path, capsys):
    arguments = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(tmp_path / "o"), "--max-steps", "1"]
    assert main([*arguments, "--frames", "mine"]) == 2
    assert "--frames mine, expected --pictures" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    "arguments",
    [[], ["--max-steps", "0"], ["--seed", "x"], ["--seed", "-1"], ["--max-steps", "many"]],
)
def test_a_wrong_argument_exits_with_code_2(scenarios, tmp_path, arguments, capsys):
    full = ["--scenario", str(scenarios / "S1.yaml"), "--out", str(tmp_path / "o"), *arguments]
    with pytest.raises(SystemExit) as caught:
        main(full if arguments else [])
    assert caught.value.code == 2
    error = capsys.readouterr().err.rsplit("error: ", 1)[1]
    assert repr(arguments[-1]) in error if arguments else "required" in error
    assert "_positive" not in error and "_seed" not in error
