"""The ledger of digests: which ledgers are valid, and that the folder can be opened after any kill."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator._common import files
from mutator._common.files import write_atomic
from mutator.errors import MutatorError
from mutator.store import digests
from mutator.store.digests import Digest, Ledger
from mutator.store.lines import LineWriter


class Killed(BaseException):
    """Raised in place of a kill of the process."""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A folder with a ledger that lists two files."""
    for name in ("a", "b"):
        (tmp_path / name).write_text(f"old {name}")
    known = {name: Digest.of((tmp_path / name).read_bytes()) for name in ("a", "b")}
    digests.write(tmp_path, Ledger(files=known))
    return tmp_path


def accepted(run: Path) -> bool:
    ledger = digests.read(run)
    return all(ledger.accepts(name, Digest.of_file(run / name)) for name in ledger.names)


def segment(run: Path, name: str, *values: int) -> Path:
    writer = LineWriter(run / name, {"schema": "records/2"})
    for value in values:
        writer.append({"value": value})
    writer.close()
    return writer.path


def test_the_ledger_comes_back(run: Path) -> None:
    """Files, announcements and the finished flag are read as they were written."""
    one = Digest(size=3, sha256="ab" * 32, lines=2)
    ledger = Ledger(files={"records/x.jsonl": one}, rewriting={"a": one, "b": None}, finished=True)
    digests.write(run, ledger)
    assert digests.read(run) == ledger


def test_every_change_of_the_ledger_is_found(run: Path) -> None:
    """Any changed byte is refused with a clear error, because the checksum does not match or the file is
    not JSON."""
    path = run / digests.FILE
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        with pytest.raises(MutatorError, match=r"digests\.json"):
            digests.read(run)


@pytest.mark.parametrize("content", ["{}", '{"schema": "digests/1"}', "[]", "", '{"schema": "digests/9"}'])
def test_what_is_no_ledger_is_told(run: Path, content: str) -> None:
    """A truncated file, a file of another kind, and one with a newer schema are user's errors."""
    (run / digests.FILE).write_text(content)
    with pytest.raises(MutatorError, match=r"digests\.json"):
        digests.read(run)
    (run / digests.FILE).unlink()
    with pytest.raises(MutatorError, match=r"digests\.json: missing"):
        digests.read(run)


def test_a_ledger_that_somebody_made_up_is_told(run: Path) -> None:
    """A file with a valid checksum is refused if its content is not a ledger."""
    data = {"schema": digests.SCHEMA, "finished": True, "files": [], "rewriting": {}}
    files.write_json(run / digests.FILE, data | {"sum": digests.digest(data)})
    with pytest.raises(MutatorError, match="not a ledger"):
        digests.read(run)


def kills(run: Path, work: Callable[[], Any], monkeypatch: pytest.MonkeyPatch) -> int:
    """Repeat `work` with a kill before its first, second, ... write, until it completes. After each kill,
    check that the folder is valid. Return the number of kills."""
    for survived in range(100):
        left = survived

        def write(path: Path, data: bytes) -> None:
            nonlocal left
            if left == 0:
                raise Killed
            left -= 1
            write_atomic(path, data)

        with monkeypatch.context() as patch:
            patch.setattr(files, "write_atomic", write)
            patch.setattr(digests, "write_atomic", write)
            try:
                work()
                return survived
            except Killed:
                assert accepted(run)
    raise AssertionError("no end")


def test_a_kill_while_a_file_is_rewritten(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert kills(run, lambda: digests.rewrite(run, "a", b"new a"), monkeypatch) == 3
    assert accepted(run) and (run / "a").read_text() == "new a"
    assert digests.read(run).rewriting == {}


def test_what_is_neither_old_nor_new_is_refused(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a kill, a file may be either of two versions, and no other one."""
    with monkeypatch.context() as patch, pytest.raises(Killed):
        patch.setattr(digests, "write_atomic", lambda path, data: (_ for _ in ()).throw(Killed))
        digests.rewrite(run, "a", b"new a")
    assert accepted(run)
    (run / "a").write_text("mine")
    assert not accepted(run)


def test_files_may_go(run: Path) -> None:
    """A file that is announced for deletion may exist or not. After that, it is unknown."""
    with digests.rewriting(run, {"a": None}):
        assert accepted(run)
        (run / "a").unlink()
        assert accepted(run)
    assert digests.read(run).names == ["b"] and accepted(run)


def test_segments_are_entered_when_they_are_closed(run: Path) -> None:
    """The entry covers the valid bytes. An incomplete last line is cut, and later additions are found."""
    path = segment(run, "records/0001-gw0.jsonl", 1, 2)
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"sum":"0123')
    digests.close_segments(run)
    known = digests.read(run).files["records/0001-gw0.jsonl"]
    assert (path.read_bytes(), known) == (whole, Digest.of(whole, lines=3))
    assert not digests.read(run).finished
    with path.open("ab") as file:
        file.write(b"{}\n")
    assert not accepted(run)


def test_a_damaged_segment_is_not_entered(run: Path) -> None:
    """If a line differs from what was written, its file is not entered."""
    path = segment(run, "proof/0001-gw0.jsonl", 1, 2)
    path.write_bytes(path.read_bytes().replace(b'"value":1', b'"value":3'))
    with pytest.raises(MutatorError, match=r"0001-gw0\.jsonl:2: a damaged line"):
        digests.close_segments(run)


def test_closing_twice_writes_once(run: Path) -> None:
    """A complete ledger is not written again."""
    segment(run, "records/0001-gw0.jsonl", 1)
    digests.close_segments(run, finished=True)
    before = (run / digests.FILE).stat().st_mtime_ns
    digests.close_segments(run)
    assert (run / digests.FILE).stat().st_mtime_ns == before
    assert json.loads((run / digests.FILE).read_text())["finished"] is True
