"""Pack the workers' series into chunks, the most valuable series first, up to the run's budget.

The packed files do not depend on the number of workers or their order.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.confined_files import inside
from mutator._common.files import raising_disk_full
from mutator.errors import MutatorError
from mutator.store.checksummed_blocks import BlockWriter, read_blocks
from mutator.store.series_folder import FOLDER, INDEX, Index, SeriesFolder, write_index
from mutator.store.series_script import name_of, size_in_script, write_script

SUFFIX = ".blocks"  # suffix of the workers' files in series/
GOLDEN, EXPERIMENT = 0, 1  # kinds of blocks
CHUNK_BYTES = 256_000  # size at which a chunk is complete; a page loads it in about 30 ms
_MB = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedSeries:
    """The bytes of an experiment's series, and of the series of its golden run `key`."""

    key: str
    golden: bytes
    faulty: bytes


class SeriesWriter:
    """Append a worker's series, and each golden run once."""

    def __init__(self, run: Path, worker: str) -> None:
        self._path = inside(run / FOLDER, f"{worker}{SUFFIX}")
        self._blocks: BlockWriter | None = None  # nothing appended yet
        self._known: set[str] = set()

    def append(self, experiment_id: str, one: EncodedSeries) -> None:
        self.add_golden(one.key, lambda: one.golden)
        self._writer().append(*series_block(experiment_id, one))

    def add_golden(self, key: str, golden: Callable[[], bytes]) -> None:
        """Append the series that `golden` returns for a golden run, unless it was appended before."""
        if key not in self._known:
            self._writer().append(GOLDEN, key, golden())
            self._known.add(key)

    def extend(self, blocks: bytes) -> None:
        """Append blocks that `series_block` built elsewhere, after the golden runs that they need."""
        self._writer().extend(blocks)

    def sync(self) -> None:
        if self._blocks is not None:
            self._blocks.sync()

    def close(self) -> None:
        if self._blocks is not None:
            self._blocks.close()

    def _writer(self) -> BlockWriter:
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        return self._blocks


def series_block(experiment_id: str, one: EncodedSeries) -> tuple[int, str, bytes]:
    """Return the kind, key and content of the block for an experiment's series."""
    return EXPERIMENT, f"{experiment_id} {one.key}", one.faulty


Read = Callable[[], bytes]
Worth = Mapping[str, Any]  # experiment -> sort key, best first


@dataclass(frozen=True, slots=True, kw_only=True)
class _Entry:
    digest: str
    size: int
    read: Read


@dataclass(frozen=True, slots=True)
class _Found:
    """The entries to pack: those of golden runs, and those of experiments with their golden runs."""

    goldens: dict[str, _Entry]
    experiments: dict[str, tuple[str, _Entry]]

    def add(self, other: "_Found") -> None:
        self.goldens.update(other.goldens)
        self.experiments.update(other.experiments)


def segments(run: Path) -> list[Path]:
    """Return the workers' files that are not packed yet."""
    return [path for path in sorted((run / FOLDER).glob(f"*{SUFFIX}")) if path.is_file()]


def pack(run: Path, plan: str, worth: Worth, budget_mb: int, *, others: tuple[Path, ...] = ()) -> None:
    """Pack the series of a run folder, and those of the run folders `others`.

    `worth` ranks all experiments that ended normally. Damaged series are left out. Packing can be repeated
    after a kill.
    """
    appended = segments(run)
    if not appended and not others:
        return
    found = _Found({}, {})
    for folder in (run, *others):
        found.add(_packed(SeriesFolder(folder)))
        for path in segments(folder):
            found.add(_appended(path))
    with raising_disk_full(run):
        (run / FOLDER).mkdir(exist_ok=True)
    index = _written(run / FOLDER, plan, found, worth, budget_mb, len(worth))
    _remove_others(run, index)
    for path in appended:
        path.unlink()


def pack_again(run: Path, index: Index) -> None:
    """Repack the content of `index`, without damaged and missing parts. The workers' files are kept."""
    worth = {name: place for place, name in enumerate(index.entries)}
    found = _packed(SeriesFolder(run))
    ended = len(worth) + index.left_out
    _remove_others(run, _written(run / FOLDER, index.plan, found, worth, index.budget_mb, ended))


def _remove_others(run: Path, index: Index) -> None:
    known = {name for name, _ in index.chunks} | {INDEX}
    for path in (run / FOLDER).glob("*.js"):
        if path.stem not in known:
            path.unlink()


def _packed(folder: SeriesFolder) -> _Found:
    found = _Found({}, {})
    try:
        index = folder.index
    except MutatorError:
        return found
    if index is None:
        return found
    goldens = _by_entry(index.goldens)
    users = _by_entry(index.entries)
    for number in range(len(index.sizes)):
        try:
            entry = _entry(folder.entry(number), lambda number=number: folder.entry(number))  # type: ignore[misc]
        except MutatorError:
            continue
        for name in goldens.get(number, ()):
            found.goldens[name] = entry
        for name in users.get(number, ()):
            found.experiments[name] = (index.golden_of[name], entry)
    return found


def _by_entry(entries: Mapping[str, int]) -> dict[int, list[str]]:
    """Return the keys of each entry number. Runs with equal bytes share an entry."""
    found: dict[int, list[str]] = {}
    for name, number in entries.items():
        found.setdefault(number, []).append(name)
    return found


def _appended(path: Path) -> _Found:
    found = _Found({}, {})
    for block in read_blocks(path).blocks:
        read = _reader(path, block.offset, len(block.data))
        entry = _entry(block.data, read)
        if block.kind == GOLDEN:
            found.goldens[block.key] = entry
        else:
            name, _, golden = block.key.partition(" ")
            found.experiments[name] = (golden, entry)
    return found


def _entry(data: bytes, read: Read) -> _Entry:
    return _Entry(digest=name_of(data), size=size_in_script(data), read=read)


def _reader(path: Path, offset: int, length: int) -> Read:
    def read() -> bytes:
        with path.open("rb") as file:
            file.seek(offset)
            return file.read(length)

    return read


def _written(folder: Path, plan: str, found: _Found, worth: Worth, budget_mb: int, ended: int) -> Index:
    """Write the chunks, then the index; `ended` is the number of experiments that ended normally."""
    kept = _kept(found, worth, budget_mb * _MB)
    golden_of = {name: found.experiments[name][0] for name in kept}
    goldens = {name: found.goldens[name] for name in sorted({*golden_of.values()})}
    first, then = _once(goldens.values()), _once(found.experiments[name][1] for name in kept)
    chunks = [*_chunks(folder, first.values()), *_chunks(folder, then.values())]
    numbers = {digest: number for number, digest in enumerate(first)}
    later = {digest: number for number, digest in enumerate(then, start=len(first))}
    index = Index(
        plan=plan,
        chunks=tuple((name, len(sizes)) for name, sizes in chunks),
        sizes=tuple(size for _, sizes in chunks for size in sizes),
        goldens={name: numbers[entry.digest] for name, entry in goldens.items()},
        entries={name: later[found.experiments[name][1].digest] for name in kept},
        golden_of=golden_of,
        left_out=ended - len(kept),
        budget_mb=budget_mb,
    )
    write_index(folder / f"{INDEX}.js", index)
    return index


def _kept(found: _Found, worth: Worth, budget: int) -> list[str]:
    """Return the experiments, best first, that fit into `budget` bytes together with their golden runs.

    The others would not fit in a later session, either, so they can be dropped.
    """
    there = [name for name in found.experiments if name in worth]
    kept: list[str] = []
    counted: set[str] = set()
    for name in sorted(there, key=lambda name: (worth[name], name)):
        golden, entry = found.experiments[name]
        if golden not in found.goldens:  # its block is damaged
            continue
        new = {one.digest: one.size for one in (entry, found.goldens[golden]) if one.digest not in counted}
        budget -= sum(new.values())
        if budget < 0:
            break
        counted |= {*new}
        kept.append(name)
    return kept


def _once(entries: Iterable[_Entry]) -> dict[str, _Entry]:
    found: dict[str, _Entry] = {}
    for entry in entries:
        found.setdefault(entry.digest, entry)
    return found


def _chunks(folder: Path, entries: Iterable[_Entry]) -> Iterator[tuple[str, list[int]]]:
    parts: list[bytes] = []
    for entry in entries:
        parts.append(entry.read())
        if sum(map(len, parts)) >= CHUNK_BYTES:
            yield _chunk(folder, parts)
            parts = []
    if parts:
        yield _chunk(folder, parts)


def _chunk(folder: Path, parts: list[bytes]) -> tuple[str, list[int]]:
    data = b"".join(parts)
    path = inside(folder, f"{name_of(data)}.js")
    write_script(path, data)
    return path.stem, [len(part) for part in parts]
