"""`digests.json`: size and SHA-256 of every verified file of a run folder, used to detect changes.

Only the folder's owner writes it. Before a file is rewritten, its old and new digests are announced;
afterwards the new one is confirmed. If the process is killed in between, each file matches one of the two.
"""

import hashlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO

from mutator._common.bounded_reading import (
    MOST_EXPERIMENT_DATA_BYTES,
    MOST_RUN_JSON_BYTES,
    check_file_size,
    open_regular,
    read_bounded,
    read_open_file,
)
from mutator._common.confined_files import checked_relative_path, open_below, path_below, write_below
from mutator._common.cpu_cores import usable_cores
from mutator._common.files import is_no_file_error, json_bytes, read_json, write_json
from mutator._common.hashing import digest
from mutator.errors import MutatorError, UnsafePath
from mutator.store.checksummed_lines import read_segment

DIGESTS_SCHEMA, DIGESTS_FILE = "digests/1", "digests.json"
_MIN_BYTES_FOR_THREADS = 20_000_000  # the least number of bytes for which threads save time
# folders of append-only files; digests are added when the files are closed
SEGMENT_FOLDERS = ("records", "proof")
_LEDGER_NAME_PATTERN = re.compile(  # what the ledger may name
    r"(run\.json|campaign\.yaml|plan\.csv|plan/(experiments|faults|batches|scenarios|strata)\.jsonl|(checks|reviewed)\.json"
    r"|golden/(.+/.+|[^/]+\.packed)|(records|proof)/[^/]+\.jsonl)"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FileDigest:
    """The size and hash of a file when it was written; `lines` for segments only."""

    size: int  # bytes
    sha256: str
    lines: int | None = None

    @classmethod
    def of_bytes(cls, data: bytes, lines: int | None = None) -> "FileDigest":
        return cls(size=len(data), sha256=digest(data), lines=lines)

    @classmethod
    def of_file(cls, path: Path) -> "FileDigest | None":
        """Compute the digest of a file; None if it is missing."""
        try:
            with open_regular(path) as file:
                return cls._of_open_file(file, path)
        except OSError as err:
            if not is_no_file_error(err):
                raise
            return None

    @classmethod
    def of_file_below(cls, run: Path, name: str) -> "FileDigest | None":
        """Compute the digest of a file below `run`; None if it is missing, or not a plain file."""
        try:
            with open_below(run, name) as file:
                return cls._of_open_file(file, path_below(run, name))
        except UnsafePath:
            return None
        except OSError as err:
            if not is_no_file_error(err):
                raise
            return None

    @classmethod
    def _of_open_file(cls, file: BufferedReader, where: Path) -> "FileDigest":
        check_file_size(file, where)
        return cls(
            sha256=hashlib.file_digest(file, "sha256").hexdigest(), size=os.fstat(file.fileno()).st_size
        )

    def has_same_bytes(self, other: "FileDigest | None") -> bool:
        return other is not None and (other.size, other.sha256) == (self.size, self.sha256)


def digests_of_files(run: Path, names: Sequence[str]) -> dict[str, FileDigest | None]:
    """Compute the digests of files of a run folder, in parallel: hashing releases the interpreter lock."""
    sizes = {name: _size_or_zero(path_below(run, name)) for name in names}
    if sum(sizes.values()) < _MIN_BYTES_FOR_THREADS:
        return {name: FileDigest.of_file_below(run, name) for name in names}
    # a large file that begins last would keep one thread busy while the others wait
    largest_first = sorted(names, key=lambda name: -sizes[name])
    with ThreadPoolExecutor(usable_cores()) as pool:
        largest_digests = pool.map(partial(FileDigest.of_file_below, run), largest_first)
        digest_by_name = dict(zip(largest_first, largest_digests, strict=True))
    return {name: digest_by_name[name] for name in names}


def _size_or_zero(path: Path) -> int:
    try:
        return path.lstat().st_size
    except OSError:
        return 0


class DigestingFile:
    """Write to a file and compute its digest."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._hash, self._size = file, hashlib.sha256(), 0

    def write(self, data: bytes) -> None:
        self._file.write(data)
        self._hash.update(data)
        self._size += len(data)

    @property
    def digest(self) -> FileDigest:
        return FileDigest(size=self._size, sha256=self._hash.hexdigest())


def sha256_of_file(path: Path) -> str:
    """Return the SHA-256 of a file, which can be larger than memory; '' if it is missing."""
    file_digest = FileDigest.of_file(path)
    return file_digest.sha256 if file_digest else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DigestLedger:
    """The content of `digests.json`.

    `files`: digests by name in the run folder; `rewriting`: files that are being rewritten, with their
    new digests (None: deleted); `finished`: whether every experiment has a final record.
    """

    files: Mapping[str, FileDigest]
    rewriting: Mapping[str, FileDigest | None] = field(default_factory=dict)
    finished: bool = False

    def accepts(self, name: str, current: FileDigest | None) -> bool:
        """Return whether a digest of a file is valid. A file being rewritten can be old, new or missing."""
        before = self.files.get(name)
        if name not in self.rewriting:
            return before.has_same_bytes(current) if before else current is None
        after = self.rewriting[name]
        return current is None or any(
            valid is not None and valid.has_same_bytes(current) for valid in (before, after)
        )

    @property
    def names(self) -> list[str]:
        return [*self.files, *(name for name in self.rewriting if name not in self.files)]


def load_ledger(run: Path) -> DigestLedger:
    """Read the ledger of a run folder; MutatorError if it is missing or changed."""
    path = run / DIGESTS_FILE
    remedy = "restore it from a copy of the run folder; without it, changed results cannot be detected"
    if not path.is_file():
        raise MutatorError("missing", where=path, expected="the digests of all files", remedy=remedy)
    data = read_json(path, DIGESTS_SCHEMA)
    as_written = read_bounded(path, MOST_RUN_JSON_BYTES) == json_bytes(data)
    if data.pop("sum", None) != digest(data) or not as_written:
        raise MutatorError(
            "changed since it was written",
            where=path,
            expected="content that matches its checksum",
            remedy=remedy,
        )
    try:
        for name in (*data["files"], *data["rewriting"]):
            if not can_be_in_ledger(checked_relative_path(name, path)):
                raise UnsafePath(f"names {name!a}", where=path, expected="files of a run", remedy=remedy)
        return DigestLedger(
            files={name: FileDigest(**value) for name, value in data["files"].items()},
            rewriting={name: value and FileDigest(**value) for name, value in data["rewriting"].items()},
            finished=data["finished"],
        )
    except (KeyError, TypeError, AttributeError) as err:
        raise MutatorError(f"not a list of digests ({err})", where=path, remedy=remedy) from None


def can_be_in_ledger(name: str) -> bool:
    """Whether the ledger has the digest of the file of this name in a run folder."""
    return bool(_LEDGER_NAME_PATTERN.fullmatch(name))


def is_ledger_unchanged(run: Path, ledger: DigestLedger) -> bool:
    """Whether the ledger of a run folder is this one, and intact."""
    try:
        return load_ledger(run) == ledger
    except MutatorError:
        return False


def save_ledger(run: Path, ledger: DigestLedger) -> None:
    data: dict[str, Any] = {
        "schema": DIGESTS_SCHEMA,
        "finished": ledger.finished,
        "files": {name: _as_json(ledger.files[name]) for name in sorted(ledger.files)},
        "rewriting": {
            name: new_digest and _as_json(new_digest) for name, new_digest in sorted(ledger.rewriting.items())
        },
    }
    write_json(run / DIGESTS_FILE, {"schema": DIGESTS_SCHEMA, "sum": digest(data), **data})


def _as_json(file_digest: FileDigest) -> dict[str, Any]:
    return {key: value for key, value in asdict(file_digest).items() if value is not None}


@contextmanager
def announcing_rewrites(
    run: Path, new_digests: Mapping[str, FileDigest | None], *, finished: bool | None = None
) -> Iterator[None]:
    """Announce that the `with` block changes files (None: deletes them); confirm the changes at its end.

    If the process is killed within the block, the folder can still be opened, and the files rewritten.
    `finished` is as in `add_segments_to_ledger`, but applies from the start of the block.
    """
    before = settled_ledger(run)
    before = replace(before, finished=before.finished if finished is None else finished)
    save_ledger(run, replace(before, rewriting=new_digests))
    yield
    files = {name: file_digest for name, file_digest in before.files.items() if name not in new_digests}
    save_ledger(
        run,
        replace(
            before, files=files | {name: new_digest for name, new_digest in new_digests.items() if new_digest}
        ),
    )


def rewrite_file(run: Path, name: str, data: bytes) -> None:
    with announcing_rewrites(run, {name: FileDigest.of_bytes(data)}):
        write_below(run, name, data)


def settled_ledger(run: Path) -> DigestLedger:
    """Return the ledger without announcements. Files are accepted as a killed command left them."""
    ledger = load_ledger(run)
    files = dict(ledger.files)
    for name, new_digest in ledger.rewriting.items():
        current = FileDigest.of_file_below(run, name)
        if current is None:
            files.pop(name, None)
        elif new_digest is not None and new_digest.has_same_bytes(current):
            files[name] = new_digest
    return replace(ledger, files=files, rewriting={})


def add_segments_to_ledger(run: Path, *, finished: bool | None = None) -> None:
    """Cut a torn last line off each new segment, and add the segment's digest to the ledger.

    `finished`: whether the run is now finished (None: unchanged). MutatorError for a damaged line.
    """
    before = settled_ledger(run)
    files = dict(before.files)
    for name in list_segments(run):
        if name not in files:
            files[name] = _trim_segment(run, name)
    after = replace(before, files=files, finished=before.finished if finished is None else finished)
    if after != load_ledger(run):
        save_ledger(run, after)


def list_segments(run: Path) -> list[str]:
    return sorted(f"{kind}/{path.name}" for kind in SEGMENT_FOLDERS for path in (run / kind).glob("*.jsonl"))


def _trim_segment(run: Path, name: str) -> FileDigest:
    with open_below(run, name) as file:
        data = read_open_file(file, path_below(run, name), MOST_EXPERIMENT_DATA_BYTES)
        os.fsync(file.fileno())  # the ledger must not name bytes that a power cut can still take
    segment = read_segment(path_below(run, name), data)
    if segment.damaged_line_numbers:
        raise segment.damage_error(segment.damaged_line_numbers[0])
    if segment.complete_lines_end < len(data):  # not cut in place: the file can have a second name elsewhere
        write_below(run, name, data[: segment.complete_lines_end])
    return FileDigest.of_bytes(data[: segment.complete_lines_end], lines=len(segment.lines))
