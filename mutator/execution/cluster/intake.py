"""Write the results of workers into the run folder."""

import json
from pathlib import Path

from mutator._common.below import inside
from mutator._common.hashing import canonical
from mutator.errors import MutatorError
from mutator.execution.cluster.pieces import Kind, Piece, Result
from mutator.execution.runner import without_outcome
from mutator.execution.written_files import Sums
from mutator.model import Status
from mutator.outcomes.judging import load_channels
from mutator.outcomes.sampling import Sampler
from mutator.preflight import equivalence
from mutator.store.lines import LineWriter
from mutator.store.patches import PatchWriter
from mutator.store.records import SCHEMA, TIMINGS_SCHEMA, line_of
from mutator.store.run_folder import RunFolder
from mutator.store.series_packing import SeriesWriter
from mutator.targets.manifest import TargetManifest


class Intake:
    """Appends results to the run folder, like a worker on this machine.

    Results are trusted, because a worker that might compute differently gets no work.
    """

    def __init__(self, folder: RunFolder, manifest: TargetManifest, name: str) -> None:
        self._folder, self._manifest, self._name = folder, manifest, name
        plan = folder.head["plan"]
        self._head = {"schema": SCHEMA, "plan": plan}
        self._patches = PatchWriter(folder.path, name)
        self._series = SeriesWriter(folder.path, name) if folder.series_mb else None
        self._records = LineWriter(self._file("records"), self._head, self._sync_blocks)
        self._timings = LineWriter(self._file("timings"), {"schema": TIMINGS_SCHEMA, "plan": plan})
        self._proofs: LineWriter | None = None

    def take(self, piece: Piece, result: Result) -> None:
        """Append the result of a piece. MutatorError if it belongs to other experiments."""
        names = [json.loads(line)["experiment_id"] for line in result.records]
        if sorted(names) != sorted(piece.lines):
            raise MutatorError(
                f"a worker's records ({len(names)}) do not match its piece (experiments: {len(piece.lines)})",
                where=self._folder.path,
                expected="one record per experiment",
                remedy="this is a defect of the harness; please report it",
            )
        if piece.kind is Kind.PROVE:
            self._proof_writer().extend(result.records)
            return
        if result.patches:
            self._patches.extend(result.patches)
        if self._series is not None and result.series:
            for key in result.series_of:
                self._series.add_golden(key, lambda key=key: self._golden_series(key))  # type: ignore[misc]
            self._series.extend(result.series)
        self._timings.extend(result.timings)
        self._records.extend(result.records)

    def give_up(self, piece: Piece, why: str) -> None:
        writer = self._records if piece.kind is Kind.RUN else self._proof_writer()
        for name in piece.lines:
            record = without_outcome(name, Status.HARNESS_ERROR, why)
            writer.extend([canonical(line_of(record)).encode()])

    def close(self) -> Sums:
        """Close the files; return the digests of those whose lines count."""
        for writer in (self._patches, self._series, self._records, self._timings, self._proofs):
            if writer is not None:
                writer.close()
        counting = [self._records, *([self._proofs] if self._proofs else [])]
        return {one.path.relative_to(self._folder.path).as_posix(): one.sha256 for one in counting}

    def _golden_series(self, key: str) -> bytes:
        golden = next(one for one in self._folder.goldens if one.key == key)
        trace = load_channels(self._manifest, self._folder.golden(*golden))
        return Sampler(self._manifest, trace).encoded

    def _proof_writer(self) -> LineWriter:
        if self._proofs is None:
            self._proofs = LineWriter(self._file(equivalence.FOLDER), self._head)
        return self._proofs

    def _sync_blocks(self) -> None:
        """Sync blocks before records, because a stored record names patches that must survive a power cut."""
        self._patches.sync()
        if self._series is not None:
            self._series.sync()

    def _file(self, kind: str) -> Path:
        return inside(self._folder.path, f"{kind}/{self._name}.jsonl")
