"""Find and read the time series (channels over time) of a run folder, `series/1`."""

import gzip
import json
import re
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import decompress_bounded
from mutator._common.confined_files import checked_relative_path, path_below
from mutator._common.hashing import canonical_json
from mutator.errors import MutatorError
from mutator.model import Record
from mutator.store.series_format import Series, decode_series
from mutator.store.series_record_check import check_deviations
from mutator.store.series_script import read_script, script_name_of, write_script

SERIES_SCHEMA, SERIES_FOLDER, RERUN_SERIES_FOLDER = "series/1", "series", "kept"
INDEX_NAME = "index"
# An index unpacks to at most this many times its size, and bytes: a forged one could fill the memory.
_MOST_INDEX_RATIO, _MOST_INDEX_BYTES = 30, 1_000_000
_ID_DIGITS = 16  # hex digits of an experiment id
_LENGTH_STRUCT = struct.Struct("<I")


@dataclass(frozen=True, kw_only=True)
class SeriesIndex:
    """The content of `series/index.js`.

    * `chunk_entry_counts`: (name, number of entries); `entry_sizes`: the bytes of each entry, in order
    * `entry_number_by_golden`, `entry_number_by_experiment`: the number of the entry of each golden run and
      each experiment
    * `left_out_count`: how many experiments ended normally but have no series, mostly because of `budget_mb`
    """

    plan: str
    chunk_entry_counts: tuple[tuple[str, int], ...]
    entry_sizes: tuple[int, ...]
    entry_number_by_golden: Mapping[str, int]
    entry_number_by_experiment: Mapping[str, int]
    golden_by_experiment: Mapping[str, str]
    left_out_count: int
    budget_mb: int

    def as_json(self) -> dict[str, Any]:
        """Convert to JSON types: ids joined into one text; entries as differences from the previous one."""
        names, numbers = list(self.entry_number_by_golden), [*self.entry_number_by_experiment.values()]
        return {
            "schema": SERIES_SCHEMA,
            "plan": self.plan,
            "budget_mb": self.budget_mb,
            "left_out": self.left_out_count,
            "chunks": [list(chunk) for chunk in self.chunk_entry_counts],
            "sizes": self.entry_sizes,
            "goldens": self.entry_number_by_golden,
            "ids": "".join(self.entry_number_by_experiment),
            "entries": [b - a for a, b in zip([0, *numbers], numbers, strict=False)],
            "golden_of": [
                names.index(self.golden_by_experiment[name]) for name in self.entry_number_by_experiment
            ],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "SeriesIndex":
        text, names = data["ids"], list(data["goldens"])
        if not re.fullmatch("[0-9a-f]*", text):
            raise ValueError("ids that are not hexadecimal")
        ids = [text[i : i + _ID_DIGITS] for i in range(0, len(text), _ID_DIGITS)]
        golden_of = (names[code] for code in data["golden_of"])
        return cls(
            plan=data["plan"],
            chunk_entry_counts=tuple((str(name), int(count)) for name, count in data["chunks"]),
            entry_sizes=tuple(data["sizes"]),
            entry_number_by_golden=dict(data["goldens"]),
            entry_number_by_experiment=dict(zip(ids, accumulate(data["entries"]), strict=True)),
            golden_by_experiment=dict(zip(ids, golden_of, strict=True)),
            left_out_count=data["left_out"],
            budget_mb=data["budget_mb"],
        )

    @cached_property
    def entry_places(self) -> list[tuple[str, int]]:
        """The chunk of each entry, and the offset of the entry in it."""
        places, number = [], 0
        for name, count in self.chunk_entry_counts:
            sizes = self.entry_sizes[number : number + count]
            places += [(name, at) for at in accumulate(sizes[:-1], initial=0)]
            number += count
        return places


class TimeSeriesFolder:
    """The folder `series/` of a run: recorded channels over time, of golden runs and of faulty ones.

    It holds the packed series, by an index, and those that reruns have written.
    """

    def __init__(self, run: Path) -> None:
        self.path = run / SERIES_FOLDER
        self._chunk: tuple[str, bytes] = ("", b"")
        self._goldens: dict[str, Series] = {}

    @cached_property
    def index(self) -> SeriesIndex | None:
        """The index of series; None if no series were packed. MutatorError if it is damaged."""
        return load_index(self.path / f"{INDEX_NAME}.js") if self.is_packed else None

    @property
    def is_packed(self) -> bool:
        return (self.path / f"{INDEX_NAME}.js").is_file()

    def has_series(self, experiment_id: str) -> bool:
        if self.rerun_series_path(experiment_id).is_file():
            return True
        return self.index is not None and experiment_id in self.index.entry_number_by_experiment

    def is_readable(self, experiment_id: str, record: Record) -> bool:
        try:
            return self.load_series(experiment_id, record) is not None
        except MutatorError:
            return False

    def rerun_ids(self) -> list[str]:
        return sorted(path.stem for path in (self.path / RERUN_SERIES_FOLDER).glob("*.js"))

    def load_series(self, experiment_id: str, record: Record) -> tuple[Series, Series] | None:
        """Return the golden and the faulty series of an experiment with this record, or None.

        MutatorError for damage, and for the series of another run.
        """
        try:
            series = self._load_series(experiment_id)
            if series is not None:
                check_same_run(series[1].facts, record)
                check_deviations(*series, record)
            return series
        except MutatorError as err:
            remedy = f"rerun the experiment: {rerun_command(self.path.parent, experiment_id)}"
            where = err.where or self.path
            raise MutatorError(err.got, where=where, expected=err.expected, remedy=remedy) from None

    def _load_series(self, experiment_id: str) -> tuple[Series, Series] | None:
        if (
            path := self.rerun_series_path(experiment_id)
        ).exists():  # from a rerun; the packed series might be damaged
            return load_rerun_series(path)
        index = self.index
        if index is None or experiment_id not in index.entry_number_by_experiment:
            return None
        return self.load_packed_series(index, experiment_id)

    def read_encoded(self, experiment_id: str) -> tuple[bytes, bytes] | None:
        """Return the encoded golden and faulty series that `load_series` decodes; MutatorError for damage."""
        if (path := self.rerun_series_path(experiment_id)).exists():
            return read_rerun_series(path)
        index = self.index
        if index is None or experiment_id not in index.entry_number_by_experiment:
            return None
        golden = index.entry_number_by_golden[index.golden_by_experiment[experiment_id]]
        return self.read_entry(golden), self.read_entry(index.entry_number_by_experiment[experiment_id])

    def load_packed_series(self, index: SeriesIndex, experiment_id: str) -> tuple[Series, Series]:
        """Return the golden and the faulty series in the chunks; MutatorError for damage."""
        key = index.golden_by_experiment[experiment_id]
        if key not in self._goldens:
            self._goldens[key] = decode_series(self.read_entry(index.entry_number_by_golden[key]))
        golden = self._goldens[key]
        return golden, decode_series(self.read_entry(index.entry_number_by_experiment[experiment_id]), golden)

    def read_entry(self, number: int) -> bytes:
        """Return the bytes of an entry of the index; MutatorError if its chunk is damaged."""
        assert self.index is not None
        name, at = self.index.entry_places[number]
        if self._chunk[0] != name:
            self._chunk = (name, self.read_chunk(name))
        return self._chunk[1][at : at + self.index.entry_sizes[number]]

    def read_chunk(self, name: str) -> bytes:
        """Return the bytes of a chunk; MutatorError if it is missing or damaged."""
        path = path_below(self.path, f"{name}.js")
        data = read_script(path)
        if script_name_of(data) != name:
            raise MutatorError("damaged", where=path, expected="content that matches its name")
        return data

    def rerun_series_path(self, experiment_id: str) -> Path:
        return path_below(self.path / RERUN_SERIES_FOLDER, f"{experiment_id}.js")


def run_facts_for_series(record: Record) -> dict[str, Any]:
    """Return what a faulty series says about its run: the digest of its trace, and its events."""
    active = record.activation
    defences = [[activity.name, activity.first] for activity in record.defences]
    return {
        "trace": record.trace_digest,
        "active": [active.first, active.last] if active else None,
        "manifest": record.t_manifest,
        "alerts": [list(event) for event in record.alerts],
        "hazards": [list(event) for event in record.hazards],
        "t_end": record.t_end,
        **({"defences": defences} if defences else {}),
    }


def check_same_run(series_facts: Mapping[str, Any], record: Record, where: Path | None = None) -> None:
    """Raise MutatorError if a faulty series belongs to another run than the record."""
    for name, value in run_facts_for_series(record).items():
        if series_facts.get(name) != value:
            raise MutatorError(
                f"the series of another run: {name} {series_facts.get(name)}",
                where=where,
                expected=f"{value}, as in the record of {record.experiment_id}",
            )


def rerun_command(run: Path, experiment_id: str = "ID") -> str:
    """Return the command that recreates the series of an experiment."""
    return f"`mutator rerun {experiment_id} --trace --run {run}`"


def repair_remedy(run: Path) -> str:
    """Return the remedy for a damaged file of series."""
    aside = f"`mutator verify {run} --repair` sets the file aside"
    return f"{aside}; {rerun_command(run)} recreates the series of an experiment"


def load_index(path: Path) -> SeriesIndex:
    remedy = repair_remedy(path.parent.parent)
    try:
        packed = read_script(path)
        data = json.loads(
            decompress_bounded(packed, _MOST_INDEX_RATIO * len(packed) + _MOST_INDEX_BYTES, gzip=True)
        )
        if data["schema"] != SERIES_SCHEMA:
            raise MutatorError(
                f"schema {data['schema']!r}", where=path, expected=SERIES_SCHEMA, remedy=remedy
            )
        index = SeriesIndex.from_json(data)
        for name in (*(name for name, _ in index.chunk_entry_counts), *index.entry_number_by_golden):
            checked_relative_path(name, path)
        for number in (*index.entry_number_by_golden.values(), *index.entry_number_by_experiment.values()):
            if number not in range(len(index.entry_places)):
                raise ValueError(f"no entry {number}")
        return index
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError, zlib.error) as err:
        raise MutatorError(f"a damaged index ({err})", where=path, remedy=remedy) from None


def save_index(path: Path, index: SeriesIndex) -> None:
    text = canonical_json(index.as_json()).encode()
    write_script(path, gzip.compress(text, compresslevel=9, mtime=0))  # with a time, equal runs would differ


def write_rerun_series(path: Path, golden: bytes, faulty: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_script(path, b"".join((_LENGTH_STRUCT.pack(len(golden)), golden, faulty)))


def read_rerun_series(path: Path) -> tuple[bytes, bytes]:
    """Read the encoded golden and faulty series of a rerun; MutatorError if the file is damaged."""
    data, at = read_script(path), _LENGTH_STRUCT.size
    try:
        (length,) = _LENGTH_STRUCT.unpack_from(data)
    except struct.error:
        raise _damaged_rerun_error(path) from None
    return data[at : at + length], data[at + length :]


def load_rerun_series(path: Path) -> tuple[Series, Series]:
    """Read the golden and the faulty series of a rerun; MutatorError if the file is damaged."""
    encoded_golden, encoded_faulty = read_rerun_series(path)
    try:
        golden = decode_series(encoded_golden)
        return golden, decode_series(encoded_faulty, golden)
    except MutatorError:
        raise _damaged_rerun_error(path) from None


def _damaged_rerun_error(path: Path) -> MutatorError:
    return MutatorError("damaged", where=path, expected="the series of two runs")
