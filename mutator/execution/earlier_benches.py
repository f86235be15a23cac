"""What benches of one process leave to the next one, whose sources can differ.

`mutator watch` opens a bench for each pass.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mutator._common.hashing import digest
from mutator.execution.earlier_run import EarlierRunUse
from mutator.model import Record
from mutator.preflight.bench_checks import CheckedGolden
from mutator.store.records import record_as_json
from mutator.store.run_folder import RunFolder


@dataclass(kw_only=True)
class EarlierBenches:
    """What earlier benches checked and ran.

    * `passed_goldens`: golden runs that passed their checks, by their place in the cache. Benches add to it.
    * `unproved_records`: digests, by experiment, of the records of benches that were cut off, all in the
      folder of the next one
    * `since`: the run of which a change leaves records standing; None: everything runs
    """

    passed_goldens: dict[Path, CheckedGolden] = field(default_factory=dict)
    unproved_records: dict[str, str] = field(default_factory=dict)
    since: RunFolder | None = None

    @property
    def session_use(self) -> EarlierRunUse:
        return EarlierRunUse(since=self.since, unproved_records=self.unproved_records)

    def note_cut_off(self, records: Mapping[str, Record]) -> None:
        """Note what a bench received before it was cut off."""
        self.unproved_records |= {name: digest(record_as_json(record)) for name, record in records.items()}

    def note_finished(self) -> None:
        """Note that a bench has proved what it had."""
        self.unproved_records.clear()
