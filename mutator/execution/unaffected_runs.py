"""Which experiments of an earlier run a change cannot affect, so that `--since` leaves them out.

The record of a run stands if everything that decided it is still the same: the code that it executed, its
inputs, the golden run with which it is compared, and the harness. docs/explanation/what-a-change-affects.md
says why this is enough.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from mutator._common.hashing import digest
from mutator.engines.engine_jobs import RunMode
from mutator.engines.executed_functions import ExecutedFunctions
from mutator.execution.code_recording import CodeRecording
from mutator.execution.earlier_run import NOT_RECORDED_REASON
from mutator.execution.experiment_runner import CopiedRun
from mutator.execution.run_reuse import is_storable
from mutator.model import Experiment, Record
from mutator.mutants.mutant_building import Mutant
from mutator.store.embedded_series import readable_encoded_series
from mutator.store.executed_code import ExecutedCode, ExecutedCodes
from mutator.store.preflight_results import golden_digests
from mutator.store.records import PROOF_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.targets.function_digests import MODULE_PART, parts_of_file
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches_any_glob

_EXPERIMENTS_PER_RUN_OF_PROOF = 20  # of those that are left out and in the sample of the proof


class TargetChange:
    """What differs between the target of an earlier run, by its `digest_by_path`, and the present one."""

    def __init__(self, manifest: TargetManifest, digest_by_path: Mapping[str, str]) -> None:
        self._manifest, self._tree = manifest, manifest.tree
        now = self._tree.digest_by_path
        paths = digest_by_path.keys() | now.keys()
        self._changed = sorted(path for path in paths if digest_by_path.get(path) != now.get(path))
        self._before = digest_by_path

    @cached_property
    def reason_for_all(self) -> str:
        """What can affect every run: a file that is new or gone, or whose bytes any run can read."""
        for path in self._changed:
            if path not in self._before:
                return f"{path} is new"
            if path not in self._tree.files:
                return f"{path} is gone"
            if not path.endswith(".py") or matches_any_glob(path, self._manifest.globs_read_by_runs):
                return f"{path} changed, which is data"
        return ""

    def reason_of_code(self, code: ExecutedCode) -> str:
        """Return what has changed of what a run executed or read; empty if nothing has."""
        for path in self._changed:
            if path in code.files_read:
                return f"{path} changed, which they read"
            parts = parts_of_file(self._tree, path) if path in code.parts_by_file else {}
            for name, part_digest in code.parts_by_file.get(path, {}).items():
                if name not in parts or parts[name].digest != part_digest:
                    what = "outside of its functions" if name == MODULE_PART else f"in {name}"
                    return f"{path} changed {what}"
        return self._reason_of_lines(code)

    def reason_of_moved_lines(self, paths: Iterable[str]) -> str:
        """Return which of these files has changed, so that its line numbers can differ."""
        path = next((path for path in paths if path in self._changed), "")
        return path and f"{path} changed, and line numbers count for them"

    def _reason_of_lines(self, code: ExecutedCode) -> str:
        if not any(path in self._changed for path in code.parts_by_file):
            return ""
        reads_lines = any(
            parts_of_file(self._tree, path)[name].reads_lines
            for path, names in code.parts_by_file.items()
            for name in names
        )
        return self.reason_of_moved_lines(code.parts_by_file) if reads_lines else ""


class UnaffectedRuns:
    """The runs of the folder `earlier_run`, as a worker asks which of them stand.

    `golden_digest_of` returns the digest of an experiment's present golden run.
    """

    def __init__(
        self,
        earlier_run: Path,
        recording: CodeRecording,
        manifest: TargetManifest,
        golden_digest_of: Callable[[Experiment], str],
    ) -> None:
        self._folder = RunFolder.open_unverified(earlier_run)  # the session has verified it
        self._recording = recording
        self._golden_digest_of = golden_digest_of
        self._change = TargetChange(manifest, self._folder.head.target_files)
        self._records, self._timings = self._folder.records(), self._folder.timings()
        self._proof_records = self._folder.records(PROOF_FOLDER)
        self._golden_digest_by_key = golden_digests(self._folder)
        self._codes, self._series = ExecutedCodes(self._folder.path), TimeSeriesFolder(self._folder.path)
        self._reason_by_code: dict[str, str] = {}
        self._proved_count = 0

    def find(self, experiment: Experiment, mutant: Mutant) -> CopiedRun | None:
        """Return the earlier run of an experiment, with the digests of its present mutant; None if the
        experiment must run.
        """
        if self.reason(experiment):
            return None
        return self._copied_run(self._records[experiment.id], experiment, mutant)

    def find_for_proof(self, experiment: Experiment, mutant: Mutant) -> CopiedRun | None:
        """Like `find`, but return the record of the reference engine. Of those that it has, the first and
        every twentieth must run, to prove that they could be left out.
        """
        name = experiment.id
        if self.reason(experiment):
            return None
        record = self._records[name]
        if name in self._proof_records:
            record = self._proof_records[name]
        elif self._timings[name]["engine"] != RunMode.REFERENCE.value:
            return None
        self._proved_count += 1
        if self._proved_count % _EXPERIMENTS_PER_RUN_OF_PROOF == 1 or not is_storable(record):
            return None
        return self._copied_run(record, experiment, mutant)

    def reason(self, experiment: Experiment) -> str:
        """Return why an experiment must run, as text about several; empty if its earlier record stands."""
        name = experiment.id
        if name not in self._records or name not in self._timings:
            return "they have no record there"
        record, code_digest = self._records[name], str(self._timings[name].get("executed", ""))
        if not is_storable(record):
            return f"they ended there as {record.status.value}"
        code = self._codes.find(code_digest)
        if code is None:
            return NOT_RECORDED_REASON
        if code_digest not in self._reason_by_code:
            self._reason_by_code[code_digest] = self._reason_of_code(code)
        reason = self._reason_by_code[code_digest] or self._reason_of_golden(experiment)
        if not reason and _names_lines(record):
            reason = self._change.reason_of_moved_lines(_files_of(experiment, code))
        return reason if reason.isprintable() else ascii(reason)

    def _reason_of_code(self, code: ExecutedCode) -> str:
        if code.obstacle:
            return f"what they executed is not known: {code.obstacle}"
        if reason := self._change.reason_for_all or self._recording.reason_of_surroundings(code):
            return reason
        return self._change.reason_of_code(code)

    def _reason_of_golden(self, experiment: Experiment) -> str:
        key = self._folder.golden_run_of(experiment).key
        if self._golden_digest_by_key.get(key) != self._golden_digest_of(experiment):
            return f"the golden run of {experiment.scenario} changed"
        return ""

    def _copied_run(self, record: Record, experiment: Experiment, mutant: Mutant) -> CopiedRun:
        code = self._codes.find(str(self._timings[experiment.id]["executed"]))
        assert code is not None
        encoded = readable_encoded_series(self._series, record)
        return CopiedRun(
            record=record_of_mutant(record, mutant),
            faulty_series=encoded[1] if encoded else None,
            mode=RunMode.UNAFFECTED,
            why=f"since {self._folder.path.name}",
            executed_functions=ExecutedFunctions(
                names_by_file={path: tuple(parts) for path, parts in code.parts_by_file.items()},
                files_read=tuple(code.files_read),
            ),
            packages=code.packages,
        )


def record_of_mutant(record: Record, mutant: Mutant) -> Record:
    """Return the record as a run of this mutant would have it: other parts of its tree can differ."""
    return replace(record, tree=mutant.tree_digest, patch=digest(mutant.patch_bytes))


def _names_lines(record: Record) -> bool:
    """Whether a record can contain line numbers: of an exception, or of why a fault was never active."""
    return record.error is not None or ".py" in record.detail


def _files_of(experiment: Experiment, code: ExecutedCode) -> Iterator[str]:
    yield from code.parts_by_file
    yield from (injection.location.path for injection in experiment.fault.injections)
