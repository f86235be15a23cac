"""Repair moves damaged parts aside and keeps intact ones."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator import open_bench
from mutator._common.folder_locks import lock_run_folder
from mutator.audit.run_repair import _set_aside, repair_run
from mutator.errors import MutatorError, UnsafePath
from mutator.store import file_digests, plan_file
from mutator.store.appended_files import AppendedFile
from mutator.store.checksummed_lines import line_file_bytes, read_segment
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.packed_patches import PatchFolder
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import SeriesIndex, save_index
from mutator.workspace import Workspace


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_finished: Callable[..., Path],
) -> Path:
    place = tmp_path_factory.mktemp("made")
    return write_finished(copy_toycar(place), place / "run")


@pytest.fixture
def run(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "run"))


def repaired(run: Path) -> tuple[list[str], RunFolder]:
    said = repair_run(RunFolder.open_unverified(run))
    return said, RunFolder.open(run)


def edit(path: Path, change: Callable[[list[bytes]], list[bytes]]) -> None:
    path.write_bytes(b"".join(change(path.read_bytes().splitlines(keepends=True))))


RECORDS = "records/0001-a.jsonl"
NO_FILES = [RECORDS, "timings/0001-a.jsonl", "golden/A/said.json", "plan.csv", file_digests.DIGESTS_FILE]
LOSSES: dict[str, tuple[Callable[[list[bytes]], list[bytes]], int]] = {
    "a changed line": (lambda x: [*x[:3], x[3].replace(b"ok", b"no"), *x[4:]], 1),
    "a dropped line": (lambda x: [*x[:3], *x[4:]], 2),  # the line after it cannot be verified
    "a doubled line": (lambda x: [*x[:4], *x[3:]], 0),
    "a lost end": (lambda x: x[:-2], 2),
    "a torn end": (lambda x: [*x[:-1], x[-1][:30]], 1),
    "a lost head": (lambda x: x[1:], 1),
    "more lines": (lambda x: [*x, b"{}\n"], 0),
    "an empty file": (lambda x: [], 24),
}


@pytest.mark.parametrize("loss", LOSSES)
def test_only_damaged_lines_of_a_segment_are_lost(run: Path, made: Path, loss: str) -> None:
    change, lost = LOSSES[loss]
    edit(run / RECORDS, change)
    damaged = (run / RECORDS).read_bytes()
    said, folder = repaired(run)
    known = RunFolder.open(made).records()
    assert folder.records().items() <= known.items() and len(folder.records()) == 24 - lost
    assert not folder.is_finished
    assert (run / "damaged" / RECORDS).read_bytes() == damaged
    assert any(text.startswith(f"{RECORDS}: ") for text in said)


def test_a_segment_with_forged_checksums_loses_all_lines(run: Path) -> None:
    head, *lines = [json.loads(line) for line in (run / RECORDS).read_text().splitlines()]
    lines[4]["outcome"] = "sdc"
    values = [{k: v for k, v in line.items() if k != "sum"} for line in lines]
    (run / RECORDS).write_bytes(
        line_file_bytes(run / RECORDS, {k: head[k] for k in ("schema", "plan")}, values)
    )
    _, folder = repaired(run)
    assert folder.records() == {}


def test_added_lines_with_forged_checksums_are_removed(run: Path, made: Path) -> None:
    head, *lines = [json.loads(line) for line in (run / RECORDS).read_text().splitlines()]
    values = [{k: v for k, v in line.items() if k != "sum"} for line in [*lines, lines[0]]]
    (run / RECORDS).write_bytes(
        line_file_bytes(run / RECORDS, {k: head[k] for k in ("schema", "plan")}, values)
    )
    _, folder = repaired(run)
    assert folder.records() == RunFolder.open(made).records()


def test_a_missing_segment_loses_its_records(run: Path) -> None:
    (run / RECORDS).unlink()
    said, folder = repaired(run)
    assert folder.records() == {} and said == [f"{RECORDS} is gone"]


def test_a_lost_patch_removes_its_record(run: Path, put_patches: Callable[..., None]) -> None:
    one, other = list(plan_file.experiment_ids(run))[:2]
    [file] = PatchFolder(run).block_files()
    put_patches(run, {one: b"other", other: None})
    before = file.read_bytes()
    said, folder = repaired(run)
    assert len(folder.records()) == 22 and not {one, other} & folder.records().keys()
    assert (run / "damaged" / file.relative_to(run)).read_bytes() == before
    assert {*PatchFolder(run)} == {*folder.records()}
    assert any(one in text for text in said)


def test_a_damaged_first_block_removes_all_records_of_its_file(run: Path) -> None:
    """The first block is a complete patch, and the others are differences from it."""
    [file] = PatchFolder(run).block_files()
    data = file.read_bytes()
    file.write_bytes(data[:60] + bytes([data[60] ^ 1]) + data[61:])
    _, folder = repaired(run)
    assert folder.records() == {} and [*PatchFolder(run)] == []
    assert (run / "damaged" / file.relative_to(run)).is_file()


@pytest.mark.parametrize("name", ["checks.json", "golden/A/log.npz"])
def test_files_that_run_can_rebuild_are_moved_aside(run: Path, name: str) -> None:
    (run / name).write_bytes(b"other")
    said, folder = repaired(run)
    assert said == [f"{name} set aside: `mutator run` rebuilds it"]
    assert not folder.is_finished and not (run / name).exists()
    assert (run / "damaged" / name).read_bytes() == b"other"
    (run / name).write_bytes(b"again")
    file_digests.add_segments_to_ledger(run, finished=True)
    repaired(run)
    assert (run / "damaged" / f"{name}.2").read_bytes() == b"again"


def test_plan_csv_is_written_again_and_the_run_stays_finished(run: Path, made: Path) -> None:
    (run / "plan.csv").unlink()
    said, folder = repaired(run)
    assert said == ["plan.csv rebuilt from the plan"] and folder.is_finished
    assert (run / "plan.csv").read_bytes() == (made / "plan.csv").read_bytes()


def test_unknown_files_are_moved_aside(run: Path) -> None:
    (run / "records" / "0002-a.jsonl").write_bytes(b"anything\n")
    _, folder = repaired(run)
    assert len(folder.records()) == 24 and not (run / "records" / "0002-a.jsonl").exists()


def test_damaged_timings_are_removed(run: Path) -> None:
    """Timings are not part of the seal."""
    edit(run / "timings" / "0001-a.jsonl", lambda x: [*x[:3], x[3].replace(b"1.0", b"9.0"), *x[4:]])
    with pytest.raises(MutatorError, match=r"0001-a\.jsonl:4: a damaged line"):
        RunFolder.open(run).timings()
    _, folder = repaired(run)
    assert len(folder.timings()) == 23 and len(folder.records()) == 24


@pytest.mark.parametrize("content", [None, b"{", b"{}"])
def test_a_damaged_ledger_is_rebuilt_from_the_files(run: Path, content: bytes | None) -> None:
    path = run / file_digests.DIGESTS_FILE
    path.unlink() if content is None else path.write_bytes(content)
    said, folder = repaired(run)
    assert said == ["digests.json rebuilt from the current files: only an earlier seal can confirm them"]
    assert len(folder.records()) == 24 and not folder.is_finished


def test_a_damaged_campaign_file_or_plan_is_not_repaired(run: Path) -> None:
    """A user can replace the file with a copy."""
    (run / "campaign.yaml").write_text("other")
    assert repair_run(RunFolder.open_unverified(run)) == []
    assert (run / "campaign.yaml").read_text() == "other"
    edit(run / plan_file.EXPERIMENTS_FILE, lambda x: x[:-1])
    with pytest.raises(MutatorError, match="23 experiments"):
        repair_run(RunFolder.open_unverified(run))


def test_an_intact_run_is_not_changed(run: Path) -> None:
    before = (run / file_digests.DIGESTS_FILE).stat().st_mtime_ns
    assert repair_run(RunFolder.open_unverified(run)) == []
    assert (run / file_digests.DIGESTS_FILE).stat().st_mtime_ns == before and not (run / "damaged").exists()


def test_a_run_resumes_after_a_killed_repair(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    edit(run / RECORDS, lambda x: [*x[:3], x[3].replace(b"ok", b"no"), *x[4:]])
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(file_digests, "add_segments_to_ledger", kill)
        repair_run(RunFolder.open_unverified(run))
    folder = RunFolder.open(run)
    assert (len(folder.records()), folder.is_finished) == (23, False)


def kill(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_a_folder_in_use_is_refused(run: Path) -> None:
    with lock_run_folder(run), pytest.raises(MutatorError, match="in use"):
        repair_run(RunFolder.open_unverified(run))


@pytest.mark.parametrize("name", NO_FILES)
def test_a_folder_in_place_of_a_file_is_moved_aside(run: Path, name: str) -> None:
    (run / name).unlink()
    (run / name).mkdir()
    (run / name / "thesis.tex").write_text("mine")
    assert any(name in text for text in repaired(run)[0])
    assert (run / "damaged" / name / "thesis.tex").read_text() == "mine"


@pytest.mark.parametrize("name", [*NO_FILES, "damaged", "damaged/records"])
def test_links_are_not_followed(run: Path, name: str) -> None:
    """A link in a run folder is refused, and one in `damaged/`, where old damage lies, is not used."""
    mine = run.parent / "mine"
    mine.mkdir()
    edit(run / RECORDS, lambda lines: lines[:-1])
    if (run / name).exists():
        shutil.move(run / name, mine / "file")
        (run / name).symlink_to(mine / "file")
    else:
        (run / name).parent.mkdir(exist_ok=True)
        (run / name).symlink_to(mine)
    before = {path: path.read_bytes() for path in mine.iterdir()}
    with pytest.raises(UnsafePath, match="a link, a pipe"):
        repair_run(RunFolder.open_unverified(run))
    assert {path: path.read_bytes() for path in mine.iterdir()} == before


@pytest.mark.parametrize("name", ["../setup.py", "damaged/../../setup.py"])
def test_a_file_outside_that_the_ledger_names_stays(run: Path, name: str) -> None:
    """Verifying prints the remedy `--repair`, which must not move a file that somebody else named."""
    (run.parent / "setup.py").write_text("mine")
    ledger = file_digests.load_ledger(run)
    file_digests.save_ledger(
        run, DigestLedger(files={**ledger.files, name: FileDigest.of_bytes(b"not mine")}, finished=True)
    )
    with pytest.raises(UnsafePath, match=r"digests\.json"):
        repair_run(RunFolder.open_unverified(run))
    assert (run.parent / "setup.py").read_text() == "mine"


def test_a_file_outside_that_a_record_names_stays(run: Path) -> None:
    """The patch of an experiment is, in older folders, in a file of its own that has the experiment's id."""
    name = "/../../../setup"
    mine = run.parent / "setup.patch"
    mine.write_text("mine")
    segment = read_segment(run / RECORDS)
    lines = [segment.parse_line(number) for number in segment.lines if number > 1]
    lines[0] |= {"experiment_id": name, "patch": "ab" * 32}
    plan = RunFolder.open_unverified(run).head.plan
    (run / RECORDS).write_bytes(
        line_file_bytes(run / RECORDS, {"schema": RECORDS_SCHEMA, "plan": plan}, lines)
    )
    repaired(run)
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("name", ["../../mine", "/mine"])
def test_a_file_outside_that_an_index_of_series_names_stays(run: Path, name: str) -> None:
    mine = run.parent / "mine.js"
    mine.write_text("mine")
    (run / "series").mkdir()
    index = SeriesIndex(
        plan=RunFolder.open_unverified(run).head.plan,
        chunk_entry_counts=((name, 1),),
        entry_sizes=(4,),
        entry_number_by_golden={},
        entry_number_by_experiment={},
        golden_by_experiment={},
        left_out_count=0,
        budget_mb=1,
    )
    save_index(run / "series" / "index.js", index)
    repaired(run)
    assert mine.read_text() == "mine"


def test_a_file_with_holes_is_moved_and_not_copied(run: Path) -> None:
    """A copy of a few bytes on the disk could fill it."""
    name = "series/0001-a.blocks"
    (run / "series").mkdir()
    with (run / name).open("wb") as file:
        file.truncate(1 << 40)
    _set_aside(run, name)
    aside = run / "damaged" / name
    assert not (run / name).exists() and aside.stat().st_size == 1 << 40 and aside.stat().st_blocks < 100


@pytest.fixture
def bench_run(toycar: Workspace, tmp_path: Path, kept_checks: None) -> Path:
    """The run folder of a bench with one experiment."""
    with open_bench(toycar, tmp_path / "bench", campaign="small") as bench:
        bench.run([bench.build_experiment("sensor/distance/longer", "A", 1.0, value=5)], "first")
    return bench.path


def test_a_benchs_unfinished_batch_is_cut_off(bench_run: Path) -> None:
    """After a kill in a batch, the repaired folder has the batches before it."""
    ledger = file_digests.load_ledger(bench_run)
    files = [AppendedFile(bench_run, name) for name in (plan_file.EXPERIMENTS_FILE, "plan.csv")]
    for file in files:
        file.add(b"a line\n")
    announced = {file.name: file.digest for file in files}
    file_digests.save_ledger(bench_run, replace(ledger, finished=False, rewriting=announced))
    for file in files:
        file.write_added()
    with pytest.raises(MutatorError, match=r"had begun to plan a batch.*open the bench again"):
        RunFolder.open(bench_run)
    sentences = repair_run(RunFolder(bench_run))
    assert [sentence.split(":")[0] for sentence in sentences] == [plan_file.EXPERIMENTS_FILE, "plan.csv"]
    assert RunFolder.open(bench_run).planned_experiment_count == 1


def test_a_benchs_damaged_batches_stay(bench_run: Path) -> None:
    """Nothing can rebuild the reasons of batches, so they are left for a copy to replace."""
    path = bench_run / plan_file.BATCHES_FILE
    path.write_text(path.read_text().replace("first", "other"))
    assert repair_run(RunFolder(bench_run)) == []
    assert "other" in path.read_text()
    with pytest.raises(MutatorError, match=r"batches\.jsonl.*restore it from a copy"):
        RunFolder.open(bench_run)
