"""Pack the workers' series into chunks, the most valuable series first, up to the run's budget.

The packed files do not depend on the number of workers or their order.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import raising_disk_full
from mutator.errors import MutatorError
from mutator.store.checksummed_blocks import BlockWriter, intact_blocks, read_blocks
from mutator.store.series_script import script_name_of, size_in_script, write_script
from mutator.store.time_series_folder import (
    INDEX_NAME,
    SERIES_FOLDER,
    SeriesIndex,
    TimeSeriesFolder,
    save_index,
)

WORKER_FILE_SUFFIX = ".blocks"  # suffix of the workers' files in series/
GOLDEN_BLOCK, EXPERIMENT_BLOCK = 0, 1  # kinds of blocks
CHUNK_BYTES = 256_000  # size at which a chunk is complete; a page loads it in about 30 ms
_MB = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedSeries:
    """The bytes of an experiment's series, and of the series of its golden run `golden_key`."""

    golden_key: str
    golden_bytes: bytes
    faulty_bytes: bytes


class SeriesWriter:
    """Append a worker's series, and each golden run once."""

    def __init__(self, run: Path, worker: str) -> None:
        self._path = path_below(run / SERIES_FOLDER, f"{worker}{WORKER_FILE_SUFFIX}")
        self._blocks: BlockWriter | None = None  # nothing appended yet
        self._written_golden_keys: set[str] = set()

    def append(self, experiment_id: str, series: EncodedSeries) -> None:
        self.add_golden(series.golden_key, lambda: series.golden_bytes)
        self._writer().append(*series_block(experiment_id, series))

    def add_golden(self, key: str, golden: Callable[[], bytes]) -> None:
        """Append the series that `golden` returns for a golden run, unless it was appended before."""
        if key not in self._written_golden_keys:
            self._writer().append(GOLDEN_BLOCK, key, golden())
            self._written_golden_keys.add(key)

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


def series_block(experiment_id: str, series: EncodedSeries) -> tuple[int, str, bytes]:
    """Return the kind, key and content of the block for an experiment's series."""
    return EXPERIMENT_BLOCK, f"{experiment_id} {series.golden_key}", series.faulty_bytes


ReadBytes = Callable[[], bytes]
RankByExperiment = Mapping[str, Any]  # experiment -> sort key, best first


@dataclass(frozen=True, slots=True, kw_only=True)
class _EntryToPack:
    digest: str
    size: int
    read: ReadBytes


@dataclass(frozen=True, slots=True)
class _SeriesToPack:
    """The entries to pack: those of golden runs, and those of experiments with their golden runs."""

    goldens: dict[str, _EntryToPack]
    experiments: dict[str, tuple[str, _EntryToPack]]

    def add(self, other: "_SeriesToPack") -> None:
        self.goldens.update(other.goldens)
        self.experiments.update(other.experiments)


def list_unpacked_worker_files(run: Path) -> list[Path]:
    """Return the workers' files that are not packed yet."""
    return [path for path in sorted((run / SERIES_FOLDER).glob(f"*{WORKER_FILE_SUFFIX}")) if path.is_file()]


def pack_series(
    run: Path, plan: str, ranks: RankByExperiment, budget_mb: int, *, other_runs: tuple[Path, ...] = ()
) -> None:
    """Pack the series of a run folder, and those of the run folders `other_runs`.

    `ranks` ranks all experiments that ended normally. Damaged series are left out. Packing can be repeated
    after a kill.
    """
    appended = list_unpacked_worker_files(run)
    if not appended and not other_runs:
        return
    to_pack = _SeriesToPack({}, {})
    for folder in (run, *other_runs):
        to_pack.add(_packed_series(TimeSeriesFolder(folder)))
        for path in list_unpacked_worker_files(folder):
            to_pack.add(_worker_series(path))
    with raising_disk_full(run):
        (run / SERIES_FOLDER).mkdir(exist_ok=True)
    index = _write_packed_files(run / SERIES_FOLDER, plan, to_pack, ranks, budget_mb, len(ranks))
    _remove_unindexed_files(run, index)
    for path in appended:
        path.unlink()


def repack_series(run: Path, index: SeriesIndex) -> None:
    """Repack the content of `index`, without damaged and missing parts. The workers' files are kept."""
    ranks = {name: place for place, name in enumerate(index.entry_number_by_experiment)}
    to_pack = _packed_series(TimeSeriesFolder(run))
    ended = len(ranks) + index.left_out_count
    _remove_unindexed_files(
        run, _write_packed_files(run / SERIES_FOLDER, index.plan, to_pack, ranks, index.budget_mb, ended)
    )


def _remove_unindexed_files(run: Path, index: SeriesIndex) -> None:
    indexed = {name for name, _ in index.chunk_entry_counts} | {INDEX_NAME}
    for path in (run / SERIES_FOLDER).glob("*.js"):
        if path.stem not in indexed:
            path.unlink()


def _packed_series(folder: TimeSeriesFolder) -> _SeriesToPack:
    to_pack = _SeriesToPack({}, {})
    try:
        index = folder.index
    except MutatorError:
        return to_pack
    if index is None:
        return to_pack
    goldens = _names_by_entry(index.entry_number_by_golden)
    users = _names_by_entry(index.entry_number_by_experiment)
    for number in range(len(index.entry_sizes)):
        try:
            entry = _build_entry(folder.read_entry(number), lambda number=number: folder.read_entry(number))  # type: ignore[misc]
        except MutatorError:
            continue
        for name in goldens.get(number, ()):
            to_pack.goldens[name] = entry
        for name in users.get(number, ()):
            to_pack.experiments[name] = (index.golden_by_experiment[name], entry)
    return to_pack


def _names_by_entry(entries: Mapping[str, int]) -> dict[int, list[str]]:
    """Return the keys of each entry number. Runs with equal bytes share an entry."""
    names: dict[int, list[str]] = {}
    for name, number in entries.items():
        names.setdefault(number, []).append(name)
    return names


def _worker_series(path: Path) -> _SeriesToPack:
    to_pack = _SeriesToPack({}, {})
    for block in read_blocks(path).blocks:
        read = _part_reader(path, block.offset, len(block.data))
        entry = _build_entry(block.data, read)
        if block.kind == GOLDEN_BLOCK:
            to_pack.goldens[block.key] = entry
        else:
            name, _, golden = block.key.partition(" ")
            to_pack.experiments[name] = (golden, entry)
    return to_pack


def unpacked_series(run: Path, experiment_id: str) -> tuple[bytes, bytes] | None:
    """Return the encoded golden and faulty series of an experiment from the files of workers, which can still
    be growing; None if they are not there.
    """
    for path in list_unpacked_worker_files(run):
        goldens: dict[str, bytes] = {}
        for block in intact_blocks(path):
            name, _, golden_key = block.key.partition(" ")
            if block.kind == GOLDEN_BLOCK:
                goldens[block.key] = block.data
            elif name == experiment_id and golden_key in goldens:
                return goldens[golden_key], block.data
    return None


def _build_entry(data: bytes, read: ReadBytes) -> _EntryToPack:
    return _EntryToPack(digest=script_name_of(data), size=size_in_script(data), read=read)


def _part_reader(path: Path, offset: int, length: int) -> ReadBytes:
    def read() -> bytes:
        with path.open("rb") as file:
            file.seek(offset)
            return file.read(length)

    return read


def _write_packed_files(
    folder: Path, plan: str, to_pack: _SeriesToPack, ranks: RankByExperiment, budget_mb: int, ended_count: int
) -> SeriesIndex:
    """Write the chunks, then the index; `ended_count` is the number of experiments that ended normally."""
    chosen = _choose_within_budget(to_pack, ranks, budget_mb * _MB)
    golden_of = {name: to_pack.experiments[name][0] for name in chosen}
    goldens = {name: to_pack.goldens[name] for name in sorted({*golden_of.values()})}
    golden_entries, experiment_entries = (
        _entry_by_digest(goldens.values()),
        _entry_by_digest(to_pack.experiments[name][1] for name in chosen),
    )
    chunks = [
        *_write_chunks(folder, golden_entries.values()),
        *_write_chunks(folder, experiment_entries.values()),
    ]
    golden_numbers = {digest: number for number, digest in enumerate(golden_entries)}
    experiment_numbers = {
        digest: number for number, digest in enumerate(experiment_entries, start=len(golden_entries))
    }
    index = SeriesIndex(
        plan=plan,
        chunk_entry_counts=tuple((name, len(sizes)) for name, sizes in chunks),
        entry_sizes=tuple(size for _, sizes in chunks for size in sizes),
        entry_number_by_golden={name: golden_numbers[entry.digest] for name, entry in goldens.items()},
        entry_number_by_experiment={
            name: experiment_numbers[to_pack.experiments[name][1].digest] for name in chosen
        },
        golden_by_experiment=golden_of,
        left_out_count=ended_count - len(chosen),
        budget_mb=budget_mb,
    )
    save_index(folder / f"{INDEX_NAME}.js", index)
    return index


def _choose_within_budget(to_pack: _SeriesToPack, ranks: RankByExperiment, budget_bytes: int) -> list[str]:
    """Return the experiments, best first, that fit into `budget_bytes` together with their golden runs.

    The others would not fit in a later session, either, so they can be dropped.
    """
    planned = [name for name in to_pack.experiments if name in ranks]
    chosen: list[str] = []
    counted: set[str] = set()
    for name in sorted(planned, key=lambda name: (ranks[name], name)):
        golden, entry = to_pack.experiments[name]
        if golden not in to_pack.goldens:  # its block is damaged
            continue
        new_sizes = {
            new_entry.digest: new_entry.size
            for new_entry in (entry, to_pack.goldens[golden])
            if new_entry.digest not in counted
        }
        budget_bytes -= sum(new_sizes.values())
        if budget_bytes < 0:
            break
        counted |= {*new_sizes}
        chosen.append(name)
    return chosen


def _entry_by_digest(entries: Iterable[_EntryToPack]) -> dict[str, _EntryToPack]:
    unique: dict[str, _EntryToPack] = {}
    for entry in entries:
        unique.setdefault(entry.digest, entry)
    return unique


def _write_chunks(folder: Path, entries: Iterable[_EntryToPack]) -> Iterator[tuple[str, list[int]]]:
    parts: list[bytes] = []
    for entry in entries:
        parts.append(entry.read())
        if sum(map(len, parts)) >= CHUNK_BYTES:
            yield _write_chunk(folder, parts)
            parts = []
    if parts:
        yield _write_chunk(folder, parts)


def _write_chunk(folder: Path, parts: list[bytes]) -> tuple[str, list[int]]:
    data = b"".join(parts)
    path = path_below(folder, f"{script_name_of(data)}.js")
    write_script(path, data)
    return path.stem, [len(part) for part in parts]
