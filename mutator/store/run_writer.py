"""Write results into a run folder: the only module that opens files of records, timings and proof."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator.model import Record
from mutator.store.checksummed_lines import LineWriter, verified_lines, write_lines_with_new_head
from mutator.store.executed_code import EXECUTED_FOLDER, EXECUTED_SCHEMA, ExecutedCode, ExecutedCodeLines
from mutator.store.packed_patches import PatchWriter
from mutator.store.records import LINE_SCHEMA_BY_FOLDER, PROOF_FOLDER, RECORDS_FOLDER, record_as_json
from mutator.store.run_folder import RunFolder
from mutator.store.series_packing import EncodedSeries, SeriesWriter
from mutator.store.timings import TIMINGS_FOLDER

_SCHEMA_BY_FOLDER = {**LINE_SCHEMA_BY_FOLDER, EXECUTED_FOLDER: EXECUTED_SCHEMA}


class RunWriter:
    """Append results to files of one worker, whose `name` no earlier worker of the run folder had.

    An experiment's patch and series are appended before its record, and synced before it, because a stored
    record names a patch that must survive a power cut.
    """

    def __init__(self, folder: RunFolder, name: str) -> None:
        self._run, self._plan, self._name = folder.path, folder.head.plan_of_lines, name
        self._patches = PatchWriter(folder.path, name)
        self._series = SeriesWriter(folder.path, name) if folder.series_budget_mb else None
        self._records = self._open_lines(RECORDS_FOLDER, self._sync_blocks)
        self._timings = self._open_lines(TIMINGS_FOLDER)
        self._proof: LineWriter | None = None  # most workers prove nothing
        self._executed: LineWriter | None = None
        self._executed_lines: ExecutedCodeLines | None = None

    def append(
        self, record: Record, timing: Mapping[str, Any], patch: bytes | None, series: EncodedSeries | None
    ) -> None:
        """Append the results of an experiment."""
        if patch is not None:
            self._patches.append(record.experiment_id, patch)
        if self._series is not None and series is not None:
            self._series.append(record.experiment_id, series)
        self._timings.append(timing)
        self.append_record(record)

    def append_executed_code(self, code: ExecutedCode) -> str:
        """Append what a run executed, unless it is in the file already; return its digest, for the timing."""
        if self._executed_lines is None:
            self._executed = self._open_lines(EXECUTED_FOLDER)
            self._executed_lines = ExecutedCodeLines(self._executed.append)
        return self._executed_lines.append(code)

    def append_record(self, record: Record) -> None:
        self._records.append(record_as_json(record))

    def append_proof(self, record: Record) -> None:
        """Append the record of an experiment that the equivalence check ran again."""
        self._proof_file().append(record_as_json(record))

    def extend_results(self, records: Iterable[bytes], timings: Iterable[bytes], patches: bytes) -> None:
        """Append lines and blocks that were built elsewhere."""
        if patches:
            self._patches.extend(patches)
        self._timings.extend(timings)
        self._records.extend(records)

    def extend_series(self, series: bytes, goldens: Mapping[str, Callable[[], bytes]]) -> None:
        """Append blocks of series. `goldens` make the series of their golden runs, which are stored once."""
        if self._series is not None and series:
            for key, golden in goldens.items():
                self._series.add_golden(key, golden)
            self._series.extend(series)

    def extend_proof(self, records: Iterable[bytes]) -> None:
        self._proof_file().extend(records)

    @property
    def sha256_by_segment(self) -> dict[str, str]:
        """The SHA-256 of each file whose lines count, by its name in the run folder."""
        writers = [self._records, *([self._proof] if self._proof else [])]
        return {writer.path.relative_to(self._run).as_posix(): writer.sha256 for writer in writers}

    def close(self) -> None:
        writers = (self._patches, self._series, self._executed, self._records, self._timings, self._proof)
        for writer in writers:
            if writer is not None:
                writer.close()

    def _proof_file(self) -> LineWriter:
        if self._proof is None:
            self._proof = self._open_lines(PROOF_FOLDER)
        return self._proof

    def _open_lines(self, kind: str, before_sync: Callable[[], None] = lambda: None) -> LineWriter:
        path = path_below(self._run, f"{kind}/{self._name}.jsonl")
        return LineWriter(path, {"schema": _SCHEMA_BY_FOLDER[kind], "plan": self._plan}, before_sync)

    def _sync_blocks(self) -> None:
        self._patches.sync()
        if self._series is not None:
            self._series.sync()


def copy_line_files(folder: RunFolder, out: Path, suffix: str) -> None:
    """Copy all files of lines to another run folder of the same plan, with a suffix added to their names."""
    for kind, schema in _SCHEMA_BY_FOLDER.items():
        if (folder.path / kind).is_dir():
            (out / kind).mkdir(exist_ok=True)
        for path in sorted((folder.path / kind).glob("*.jsonl")):
            copy_path = path_below(out / kind, f"{path.stem}{suffix}.jsonl")
            lines = verified_lines(path, schema)
            head = {"schema": schema, "plan": folder.head.plan_of_lines}
            write_lines_with_new_head(copy_path, head, (line for _, _, line in lines))
