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

from mutator._common.below import check_name, inside, open_below, write_below
from mutator._common.bounded import MOST_DATA, MOST_JSON, check_open, open_regular, read_bounded, read_open
from mutator._common.cores import usable_cores
from mutator._common.files import is_no_file, json_bytes, read_json, write_json
from mutator._common.hashing import digest
from mutator.errors import MutatorError, Outside
from mutator.store.checksummed_lines import read_segment

SCHEMA, FILE = "digests/1", "digests.json"
_WORTH_THREADS = 20_000_000  # the least number of bytes for which threads save time
SEGMENTS = ("records", "proof")  # folders of append-only files; digests are added when the files are closed
_NAMES = re.compile(  # what the ledger may name
    r"(run\.json|campaign\.yaml|plan\.csv|plan/(experiments|faults)\.jsonl|(checks|reviewed)\.json"
    r"|golden/.+/.+|(records|proof)/[^/]+\.jsonl)"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Digest:
    """The size and hash of a file when it was written; `lines` for segments only."""

    size: int  # bytes
    sha256: str
    lines: int | None = None

    @classmethod
    def of(cls, data: bytes, lines: int | None = None) -> "Digest":
        return cls(size=len(data), sha256=digest(data), lines=lines)

    @classmethod
    def of_file(cls, path: Path) -> "Digest | None":
        """Compute the digest of a file; None if it is missing."""
        try:
            with open_regular(path) as file:
                return cls._of_open(file, path)
        except OSError as err:
            if not is_no_file(err):
                raise
            return None

    @classmethod
    def below(cls, run: Path, name: str) -> "Digest | None":
        """Compute the digest of a file below `run`; None if it is missing, or not a plain file."""
        try:
            with open_below(run, name) as file:
                return cls._of_open(file, inside(run, name))
        except Outside:
            return None
        except OSError as err:
            if not is_no_file(err):
                raise
            return None

    @classmethod
    def _of_open(cls, file: BufferedReader, where: Path) -> "Digest":
        check_open(file, where)
        return cls(
            sha256=hashlib.file_digest(file, "sha256").hexdigest(), size=os.fstat(file.fileno()).st_size
        )

    def is_of(self, found: "Digest | None") -> bool:
        return found is not None and (found.size, found.sha256) == (self.size, self.sha256)


def of_files(run: Path, names: Sequence[str]) -> dict[str, Digest | None]:
    """Compute the digests of files of a run folder, in parallel: hashing releases the interpreter lock."""
    sizes = {name: _size(inside(run, name)) for name in names}
    if sum(sizes.values()) < _WORTH_THREADS:
        return {name: Digest.below(run, name) for name in names}
    largest_first = sorted(names, key=lambda name: -sizes[name])
    with ThreadPoolExecutor(usable_cores()) as pool:
        digests = pool.map(partial(Digest.below, run), largest_first)
        found = dict(zip(largest_first, digests, strict=True))
    return {name: found[name] for name in names}


def _size(path: Path) -> int:
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
    def digest(self) -> Digest:
        return Digest(size=self._size, sha256=self._hash.hexdigest())


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, which can be larger than memory; '' if it is missing."""
    found = Digest.of_file(path)
    return found.sha256 if found else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledger:
    """The content of `digests.json`.

    `files`: digests by name in the run folder; `rewriting`: files that are being rewritten, with their
    new digests (None: deleted); `finished`: whether every experiment has a final record.
    """

    files: Mapping[str, Digest]
    rewriting: Mapping[str, Digest | None] = field(default_factory=dict)
    finished: bool = False

    def accepts(self, name: str, found: Digest | None) -> bool:
        """Return whether a digest of a file is valid. A file being rewritten can be old, new or missing."""
        known = self.files.get(name)
        if name not in self.rewriting:
            return known.is_of(found) if known else found is None
        coming = self.rewriting[name]
        return found is None or any(one is not None and one.is_of(found) for one in (known, coming))

    @property
    def names(self) -> list[str]:
        return [*self.files, *(name for name in self.rewriting if name not in self.files)]


def read(run: Path) -> Ledger:
    """Read the ledger of a run folder; MutatorError if it is missing or changed."""
    path = run / FILE
    remedy = "restore it from a copy of the run folder; without it, changed results cannot be detected"
    if not path.is_file():
        raise MutatorError("missing", where=path, expected="the digests of all files", remedy=remedy)
    data = read_json(path, SCHEMA)
    as_written = read_bounded(path, MOST_JSON) == json_bytes(data)
    if data.pop("sum", None) != digest(data) or not as_written:
        raise MutatorError(
            "changed since it was written",
            where=path,
            expected="content that matches its checksum",
            remedy=remedy,
        )
    try:
        for name in (*data["files"], *data["rewriting"]):
            if not may_name(check_name(name, path)):
                raise Outside(f"names {name!a}", where=path, expected="files of a run", remedy=remedy)
        return Ledger(
            files={name: Digest(**value) for name, value in data["files"].items()},
            rewriting={name: value and Digest(**value) for name, value in data["rewriting"].items()},
            finished=data["finished"],
        )
    except (KeyError, TypeError, AttributeError) as err:
        raise MutatorError(f"not a list of digests ({err})", where=path, remedy=remedy) from None


def may_name(name: str) -> bool:
    """Whether the ledger has the digest of the file of this name in a run folder."""
    return bool(_NAMES.fullmatch(name))


def is_as(run: Path, ledger: Ledger) -> bool:
    """Whether the ledger of a run folder is this one, and intact."""
    try:
        return read(run) == ledger
    except MutatorError:
        return False


def write(run: Path, ledger: Ledger) -> None:
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "finished": ledger.finished,
        "files": {name: _plain(ledger.files[name]) for name in sorted(ledger.files)},
        "rewriting": {name: one and _plain(one) for name, one in sorted(ledger.rewriting.items())},
    }
    write_json(run / FILE, {"schema": SCHEMA, "sum": digest(data), **data})


def _plain(one: Digest) -> dict[str, Any]:
    return {key: value for key, value in asdict(one).items() if value is not None}


@contextmanager
def rewriting(
    run: Path, coming: Mapping[str, Digest | None], *, finished: bool | None = None
) -> Iterator[None]:
    """Announce that the `with` block changes files (None: deletes them); confirm the changes at its end.

    If the process is killed within the block, the folder can still be opened, and the files rewritten.
    `finished` is as in `close_segments`, but applies from the start of the block.
    """
    before = settled(run)
    before = replace(before, finished=before.finished if finished is None else finished)
    write(run, replace(before, rewriting=coming))
    yield
    files = {name: one for name, one in before.files.items() if name not in coming}
    write(run, replace(before, files=files | {name: one for name, one in coming.items() if one}))


def rewrite(run: Path, name: str, data: bytes) -> None:
    with rewriting(run, {name: Digest.of(data)}):
        write_below(run, name, data)


def settled(run: Path) -> Ledger:
    """Return the ledger without announcements. Files are accepted as a killed command left them."""
    known = read(run)
    files = dict(known.files)
    for name, coming in known.rewriting.items():
        found = Digest.below(run, name)
        if found is None:
            files.pop(name, None)
        elif coming is not None and coming.is_of(found):
            files[name] = coming
    return replace(known, files=files, rewriting={})


def close_segments(run: Path, *, finished: bool | None = None) -> None:
    """Cut a torn last line off each new segment, and add the segment's digest to the ledger.

    `finished`: whether the run is now finished (None: unchanged). MutatorError for a damaged line.
    """
    before = settled(run)
    files = dict(before.files)
    for name in segments(run):
        if name not in files:
            files[name] = _closed(run, name)
    after = replace(before, files=files, finished=before.finished if finished is None else finished)
    if after != read(run):
        write(run, after)


def segments(run: Path) -> list[str]:
    return sorted(f"{kind}/{path.name}" for kind in SEGMENTS for path in (run / kind).glob("*.jsonl"))


def _closed(run: Path, name: str) -> Digest:
    with open_below(run, name) as file:
        data = read_open(file, inside(run, name), MOST_DATA)
        os.fsync(file.fileno())
    segment = read_segment(inside(run, name), data)
    if segment.damaged:
        raise segment.problem(segment.damaged[0])
    if segment.end < len(data):  # not cut in place: the file can have a second name elsewhere
        write_below(run, name, data[: segment.end])
    return Digest.of(data[: segment.end], lines=len(segment.lines))
