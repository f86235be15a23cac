"""The ledger of digests, also after kills."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator._common import files
from mutator._common.files import write_atomic
from mutator.errors import MutatorError, UnsafePath
from mutator.store import file_digests
from mutator.store.checksummed_lines import LineWriter
from mutator.store.file_digests import DigestLedger, FileDigest

NAMES = FIRST, SECOND = "plan.csv", "checks.json"


class Killed(BaseException):
    """Raised instead of killing the process."""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    for name in NAMES:
        (tmp_path / name).write_text(f"old {name}")
    known = {name: FileDigest.of_bytes((tmp_path / name).read_bytes()) for name in NAMES}
    file_digests.save_ledger(tmp_path, DigestLedger(files=known))
    return tmp_path


def accepted(run: Path) -> bool:
    ledger = file_digests.load_ledger(run)
    return all(ledger.accepts(name, FileDigest.of_file(run / name)) for name in ledger.names)


def segment(run: Path, name: str, *values: int) -> Path:
    writer = LineWriter(run / name, {"schema": "records/2"})
    for value in values:
        writer.append({"value": value})
    writer.close()
    return writer.path


def test_a_ledger_is_read_as_written(run: Path) -> None:
    one = FileDigest(size=3, sha256="ab" * 32, lines=2)
    ledger = DigestLedger(
        files={"records/x.jsonl": one}, rewriting={"checks.json": one, "plan.csv": None}, finished=True
    )
    file_digests.save_ledger(run, ledger)
    assert file_digests.load_ledger(run) == ledger


def test_every_changed_byte_is_found(run: Path) -> None:
    path = run / file_digests.DIGESTS_FILE
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        with pytest.raises(MutatorError, match=r"digests\.json"):
            file_digests.load_ledger(run)


@pytest.mark.parametrize("content", ["{}", '{"schema": "digests/1"}', "[]", "", '{"schema": "digests/9"}'])
def test_a_file_that_is_not_a_ledger_is_refused(run: Path, content: str) -> None:
    (run / file_digests.DIGESTS_FILE).write_text(content)
    with pytest.raises(MutatorError, match=r"digests\.json"):
        file_digests.load_ledger(run)
    (run / file_digests.DIGESTS_FILE).unlink()
    with pytest.raises(MutatorError, match=r"digests\.json: missing"):
        file_digests.load_ledger(run)


def test_a_forged_ledger_is_refused(run: Path) -> None:
    """The checksum is valid, but the content is not that of a ledger."""
    data = {"schema": file_digests.DIGESTS_SCHEMA, "finished": True, "files": [], "rewriting": {}}
    files.write_json(run / file_digests.DIGESTS_FILE, data | {"sum": file_digests.digest(data)})
    with pytest.raises(MutatorError, match="not a list of digests"):
        file_digests.load_ledger(run)


@pytest.mark.parametrize("key", ["files", "rewriting"])
@pytest.mark.parametrize(
    "name",
    [
        *("../setup.py", "/etc/passwd", "golden/../../x/y", "plan/./faults.jsonl", "", "golden//x", "a\0b"),
        *("setup.py", "records/x/y.jsonl", "records/x.py", "golden/x", "work/base/x", "series/index.js"),
    ],
)
def test_a_ledger_names_only_files_that_a_run_writes(run: Path, key: str, name: str) -> None:
    one = FileDigest.of_bytes(b"")
    file_digests.save_ledger(run, DigestLedger(**{"files": {}, "rewriting": {}} | {key: {name: one}}))  # type: ignore[arg-type]
    with pytest.raises(UnsafePath, match=r"digests\.json"):
        file_digests.load_ledger(run)


def test_a_segment_with_a_second_name_is_not_cut_in_place(run: Path) -> None:
    path = segment(run, "records/0001-gw0.jsonl", 1)
    path.write_bytes(torn := path.read_bytes() + b'{"sum"')
    (run.parent / "mine").hardlink_to(path)
    file_digests.add_segments_to_ledger(run)
    assert (run.parent / "mine").read_bytes() == torn != path.read_bytes()


def kills(run: Path, work: Callable[[], Any], monkeypatch: pytest.MonkeyPatch) -> int:
    """Repeat `work` with a kill before its first, second, ... write, until it completes. Check the folder
    after each kill. Return the number of kills."""
    for survived in range(100):
        left = survived

        def write(path: Path, data: bytes) -> None:
            nonlocal left
            if left == 0:
                raise Killed
            left -= 1
            write_atomic(path, data)

        def write_below(run: Path, name: str, data: bytes) -> None:
            write(run / name, data)

        with monkeypatch.context() as patch:
            patch.setattr(files, "write_atomic", write)
            patch.setattr(file_digests, "write_below", write_below)
            try:
                work()
                return survived
            except Killed:
                assert accepted(run)
    raise AssertionError("the work never completes")


def test_a_kill_during_a_rewrite_leaves_a_valid_folder(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert kills(run, lambda: file_digests.rewrite_file(run, FIRST, b"new"), monkeypatch) == 3
    assert accepted(run) and (run / FIRST).read_text() == "new"
    assert file_digests.load_ledger(run).rewriting == {}


def test_after_a_kill_a_file_is_old_or_new(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch, pytest.raises(Killed):
        patch.setattr(file_digests, "write_below", lambda run, name, data: (_ for _ in ()).throw(Killed))
        file_digests.rewrite_file(run, FIRST, b"new")
    assert accepted(run)
    (run / FIRST).write_text("mine")
    assert not accepted(run)


def test_a_file_announced_for_deletion_can_be_missing(run: Path) -> None:
    with file_digests.announcing_rewrites(run, {FIRST: None}):
        assert accepted(run)
        (run / FIRST).unlink()
        assert accepted(run)
    assert file_digests.load_ledger(run).names == [SECOND] and accepted(run)


def test_a_closed_segment_is_in_the_ledger(run: Path) -> None:
    path = segment(run, "records/0001-gw0.jsonl", 1, 2)
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"sum":"0123')
    file_digests.add_segments_to_ledger(run)
    known = file_digests.load_ledger(run).files["records/0001-gw0.jsonl"]
    assert (path.read_bytes(), known) == (whole, FileDigest.of_bytes(whole, lines=3))
    assert not file_digests.load_ledger(run).finished
    with path.open("ab") as file:
        file.write(b"{}\n")
    assert not accepted(run)


def test_a_damaged_segment_cannot_be_closed(run: Path) -> None:
    path = segment(run, "proof/0001-gw0.jsonl", 1, 2)
    path.write_bytes(path.read_bytes().replace(b'"value":1', b'"value":3'))
    with pytest.raises(MutatorError, match=r"0001-gw0\.jsonl:2: a damaged line"):
        file_digests.add_segments_to_ledger(run)


def test_closing_twice_writes_once(run: Path) -> None:
    segment(run, "records/0001-gw0.jsonl", 1)
    file_digests.add_segments_to_ledger(run, finished=True)
    before = (run / file_digests.DIGESTS_FILE).stat().st_mtime_ns
    file_digests.add_segments_to_ledger(run)
    assert (run / file_digests.DIGESTS_FILE).stat().st_mtime_ns == before
    assert json.loads((run / file_digests.DIGESTS_FILE).read_text())["finished"] is True
