"""Opening a run folder reports exactly the files that differ from what was written."""

import json
import random
import shutil
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Status
from mutator.store import file_digests, integrity, plan_file
from mutator.store.checksummed_lines import LineWriter
from mutator.store.plan_strata import STRATA_FILE
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import SessionEnvironment
from mutator.workspace import Workspace

Write = Callable[..., Path]
Make = Callable[..., object]


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace], write_finished: Write
) -> Path:
    place = tmp_path_factory.mktemp("made")
    return write_finished(copy_toycar(place), place / "run")


@pytest.fixture
def run(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "run")


def problem(run: Path) -> MutatorError:
    with pytest.raises(MutatorError) as caught:
        RunFolder.open(run)
    return caught.value


SEALED = (
    "run.json",
    "campaign.yaml",
    "plan.csv",
    "checks.json",
    "digests.json",
    *(plan_file.EXPERIMENTS_FILE, plan_file.FAULTS_FILE, STRATA_FILE),
    *("golden/A/log.npz", "golden/A/said.json"),
    *("records/0001-a.jsonl", "proof/0001-a.jsonl"),
)


@pytest.mark.parametrize("name", [name for name in SEALED if name != "run.json"])
@pytest.mark.parametrize("what", ["folder", "loop"])
def test_a_folder_or_link_in_place_of_a_file_is_reported(run: Path, name: str, what: str) -> None:
    (run / name).unlink()
    if what == "folder":
        (run / name).mkdir()
    else:
        (run / name).symlink_to(run / name)
    assert problem(run).where == str(run / name)


def test_these_tests_list_all_sealed_files(run: Path) -> None:
    folder = RunFolder.open(run)
    assert folder.is_finished and folder.problems() == []
    found = {path.relative_to(run).as_posix() for path in run.rglob("*") if path.is_file()}
    others = {name for name in found if name.startswith(("patches/", "timings/", "golden/B", "golden/A+"))}
    assert found - others == {*SEALED, "owner.lock"} and len(others) == 8


@pytest.mark.parametrize("name", SEALED)
def test_every_damaged_file_is_reported(run: Path, name: str) -> None:
    path = run / name
    data, draw = path.read_bytes(), random.Random(name)
    damaged = [data + b"\n", data + data, b"", data[: draw.randrange(len(data))]]
    for _ in range(20):
        place = draw.randrange(len(data))
        damaged.append(data[:place] + bytes([data[place] ^ 1 << draw.randrange(8)]) + data[place + 1 :])
    damaged += [data[:place] + bytes(len(data) - place) for place in (0, len(data) // 2)]
    for content in damaged:
        path.write_bytes(content)
        assert problem(run).where == str(path)
    path.unlink()
    assert "not a run folder" in str(problem(run)) if name == "run.json" else problem(run).where == str(path)


@pytest.mark.parametrize("name", ["records/0001-a.jsonl", plan_file.EXPERIMENTS_FILE, plan_file.FAULTS_FILE])
def test_a_changed_line_is_reported_with_its_number(run: Path, name: str) -> None:
    path = run / name
    lines = path.read_bytes().splitlines(keepends=True)
    lines[2] = lines[2].replace(b"0", b"1", 1)
    path.write_bytes(b"".join(lines))
    assert (problem(run).where, problem(run).line) == (str(path), 3)


def test_missing_lines_are_counted(run: Path) -> None:
    path = run / "records" / "0001-a.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-2]))
    assert f"{len(lines) - 2} lines, all with their checksums; expected {len(lines)} lines" in str(
        problem(run)
    )


@pytest.mark.parametrize("name", ["records/0002-a.jsonl", "proof/x.jsonl", "golden/A/more", "plan/old"])
def test_an_unknown_file_in_a_finished_run_is_reported(run: Path, name: str) -> None:
    (run / name).write_bytes(b"")
    assert str(problem(run)).startswith(f"{run / name}: not named in digests.json")


@pytest.mark.parametrize(
    "name", ["timings/x.jsonl", "traces/a", "plots/a.svg", "report/index.html", "notes.txt"]
)
def test_files_outside_the_seal_are_not_checked(run: Path, name: str) -> None:
    (run / name).parent.mkdir(exist_ok=True)
    (run / name).write_text("anything")
    assert RunFolder.open(run).is_finished


def test_swapped_files_are_reported(run: Path) -> None:
    a, b = run / "golden" / "A" / "log.npz", run / "golden" / "A" / "said.json"
    content = a.read_bytes()
    a.write_bytes(b.read_bytes())
    b.write_bytes(content)
    assert {error.where for error in RunFolder.open_unverified(run).problems()} == {str(a), str(b)}


def unsealed(run: Path, *lines: dict[str, object], plan: str | None = None) -> Path:
    """Turn a finished run into a killed one, with these lines in an unclosed segment."""
    file_digests.add_segments_to_ledger(run, finished=False)
    head = {"schema": RECORDS_SCHEMA, "plan": plan or RunFolder.open_unverified(run).head.plan}
    writer = LineWriter(run / "records" / "0002-a.jsonl", head)
    for line in lines:
        writer.append(line)
    writer.close()
    return writer.path


def test_an_unclosed_segment_is_read(run: Path) -> None:
    again = {"experiment_id": next(plan_file.experiment_ids(run)), "status": "harness_error"}
    path = unsealed(run, again, again)
    path.write_bytes(path.read_bytes() + b'{"sum"')
    assert RunFolder.open(run).problems() == []
    path.write_bytes(path.read_bytes().replace(b"harness", b"hardest", 1))
    assert (problem(run).where, problem(run).line) == (str(path), 2)


def test_a_segment_of_another_run_is_refused(run: Path) -> None:
    path = unsealed(run, plan="0" * 64)
    assert str(problem(run)).startswith(f"{path}:1: records of plan 0000000000000000")


def test_a_record_outside_the_plan_is_reported(run: Path) -> None:
    path = unsealed(run, {"experiment_id": "0" * 16, "status": "ok"})
    assert str(problem(run)).startswith(f"{path}:2: a record of {'0' * 16}, which is not planned")


def test_a_second_record_is_reported(run: Path) -> None:
    """Records of harness errors are exempt, because they are not final."""
    lines = (run / "records" / "0001-a.jsonl").read_text().splitlines()
    one = {k: v for k, v in json.loads(lines[1]).items() if k != "sum"}
    path = unsealed(run, one | {"status": Status.HARNESS_ERROR.value}, one)
    assert str(problem(run)).startswith(f"{path}:3: a second record of experiment {one['experiment_id']}")


def test_a_missing_record_of_a_finished_run_is_reported(run: Path, reseal: Callable[[Path], None]) -> None:
    path = run / "records" / "0001-a.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:4], *lines[5:]]))
    reseal(run)
    assert f"no record of {json.loads(lines[4])['experiment_id']}" in str(problem(run))


def test_a_plan_with_duplicates_or_missing_experiments_is_refused(
    run: Path, reseal: Callable[[Path], None]
) -> None:
    path = run / plan_file.EXPERIMENTS_FILE
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:-1], lines[0]]))
    reseal(run)
    assert f"{path}:24: duplicate experiment {json.loads(lines[0])['id']}" in str(problem(run))
    path.write_text("".join(lines[:-1]))
    reseal(run)
    assert f"{path}: 23 experiments; expected 24" in str(problem(run))


def test_a_folder_that_is_being_written_is_not_damaged(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real, seen = integrity.run_problems, []

    def look(*arguments: object, **more: object) -> list[MutatorError]:
        found = list(real(*arguments, **more))  # type: ignore[arg-type]
        if not seen:
            seen.append("the owner was faster")
            file_digests.rewrite_file(run, "plan.csv", b"other")
            return [MutatorError("plan.csv changed")]
        return found

    monkeypatch.setattr(integrity, "run_problems", look)
    RunFolder.open(run)
    assert seen


@pytest.mark.parametrize("key", ["limits", "goldens", "chunks", "sources", "choices", "provenance", "plan"])
def test_an_invalid_value_in_run_json_is_reported_by_key(run: Path, key: str) -> None:
    data = json.loads((run / "run.json").read_text())
    for value in (3, [3], [[3]], {"a": [None]}):
        (run / "run.json").write_text(json.dumps(data | {key: value}))
        assert f"run.json: damaged at '{key}'" in str(problem(run))
    del data[key]
    (run / "run.json").write_text(json.dumps(data))
    with pytest.raises(MutatorError, match=rf"run\.json: no key '{key}'"):
        RunFolder.open_unverified(run)


@pytest.mark.parametrize("key", [field.name for field in fields(SessionEnvironment)])
def test_a_damaged_stretch_of_work_is_reported(run: Path, key: str) -> None:
    """An audit prints stretches before it verifies anything."""
    data = json.loads((run / "run.json").read_text())
    [stretch] = data["stretches"]
    for value in (3, [3], {"a": [None]}, [{"library": "openblas"}], {"mutator": {"commit": "abc"}}):
        data["stretches"] = [stretch | {key: value}]
        (run / "run.json").write_text(json.dumps(data))
        with pytest.raises(MutatorError, match=r"run\.json: damaged at 'stretches'"):
            RunFolder.open_unverified(run)
    if key == "machines":  # this key is optional
        return
    data["stretches"] = [{name: value for name, value in stretch.items() if name != key}]
    (run / "run.json").write_text(json.dumps(data))
    with pytest.raises(MutatorError, match=r"run\.json: damaged at 'stretches'"):
        RunFolder.open_unverified(run)
