"""Write the results of workers into the run folder."""

import json
from functools import partial

from mutator.errors import MutatorError
from mutator.execution.cluster.piece_messages import Piece, PieceKind, PieceResult
from mutator.execution.records_without_outcome import record_without_outcome
from mutator.execution.written_files import FileDigests
from mutator.model import Status
from mutator.outcomes.hazard_and_metric_judgement import load_manifest_channels
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.store.run_folder import RunFolder
from mutator.store.run_writer import RunWriter
from mutator.targets.manifest import TargetManifest


class ResultIntake:
    """Appends results to the run folder, like a worker on this machine.

    Results are trusted, because a worker that might compute differently gets no work.
    """

    def __init__(self, folder: RunFolder, manifest: TargetManifest, name: str) -> None:
        self._folder, self._manifest = folder, manifest
        self._writer = RunWriter(folder, name)

    def append_result(self, piece: Piece, result: PieceResult) -> None:
        """Append the result of a piece. MutatorError if it belongs to other experiments."""
        names = [json.loads(line)["experiment_id"] for line in result.records]
        if sorted(names) != sorted(piece.plan_lines):
            raise MutatorError(
                f"a worker's records ({len(names)}) do not match its piece "
                f"(experiments: {len(piece.plan_lines)})",
                where=self._folder.path,
                expected="one record per experiment",
                remedy="this is a defect of the harness; please report it",
            )
        if piece.kind is PieceKind.PROVE:
            self._writer.extend_proof(result.records)
            return
        goldens = {key: partial(self._golden_series, key) for key in result.series_goldens}
        self._writer.extend_series(result.series, goldens)
        self._writer.extend_results(result.records, result.timings, result.patches)

    def append_harness_errors(self, piece: Piece, reason: str) -> None:
        append = self._writer.append_record if piece.kind is PieceKind.RUN else self._writer.append_proof
        for name in piece.plan_lines:
            append(record_without_outcome(name, Status.HARNESS_ERROR, reason))

    def close(self) -> FileDigests:
        """Close the files; return the digests of those whose lines count."""
        self._writer.close()
        return self._writer.sha256_by_segment

    def _golden_series(self, key: str) -> bytes:
        golden = next(golden_run for golden_run in self._folder.golden_runs if golden_run.key == key)
        trace = load_manifest_channels(self._manifest, self._folder.golden_folder(*golden))
        return SeriesSampler(self._manifest, trace).encoded_golden
