"""The series that a page contains, because it lies alone: of the worst experiments, up to a limit.

web/replay/series_file.js reads them.
"""

import base64
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mutator.errors import MutatorError
from mutator.model import Record
from mutator.store.time_series_folder import TimeSeriesFolder

MOST_EMBEDDED_SERIES_BYTES = 4_000_000  # of about 400 experiments; a page with it can be mailed
EMBEDDED_SERIES_ELEMENT = "embedded-series"  # id of the script element


@dataclass(slots=True)
class EmbeddedSeries:
    """The encoded series for a page, as text of at most `most_bytes`. A golden run is stored once."""

    most_bytes: int
    size_bytes: int = 0
    _run_numbers: dict[str, int] = field(default_factory=dict)  # number of each text
    _runs_by_key: dict[str, tuple[int, int]] = field(default_factory=dict)  # golden and faulty

    def add(self, series_by_key: Mapping[str, tuple[bytes, bytes]]) -> bool:
        """Add the encoded golden and faulty series of experiments. Return whether they fit; otherwise nothing
        is added.
        """
        texts_by_key = {key: tuple(map(_base64_text, runs)) for key, runs in series_by_key.items()}
        new_texts = {text for texts in texts_by_key.values() for text in texts} - self._run_numbers.keys()
        size = sum(map(len, new_texts))
        if self.size_bytes + size > self.most_bytes:
            return False
        self.size_bytes += size
        for key, texts in texts_by_key.items():
            golden, faulty = (self._run_numbers.setdefault(text, len(self._run_numbers)) for text in texts)
            self._runs_by_key[key] = (golden, faulty)
        return True

    def __contains__(self, key: object) -> bool:
        return key in self._runs_by_key

    def __len__(self) -> int:
        return len(self._runs_by_key)

    def as_json(self) -> dict[str, Any]:
        return {"runs": list(self._run_numbers), "of": self._runs_by_key}


def _base64_text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def readable_encoded_series(series: TimeSeriesFolder, record: Record | None) -> tuple[bytes, bytes] | None:
    """Return the encoded golden and faulty series of an experiment with this record; None if they do not
    exist, are damaged, or belong to another run than the record.
    """
    if record is None:
        return None
    try:
        if series.load_series(record.experiment_id, record) is None:
            return None
        return series.read_encoded(record.experiment_id)
    except MutatorError:
        return None


def embed_worst(
    series: TimeSeriesFolder, records: Iterable[Record | None], most_bytes: int
) -> tuple[EmbeddedSeries, int]:
    """Embed the series of `records`, worst first, until one does not fit. Return them, and how many records
    were considered: those after these are left out because of the limit.
    """
    embedded = EmbeddedSeries(most_bytes)
    number = 0
    for number, record in enumerate(records, 1):
        encoded = readable_encoded_series(series, record)
        if record and encoded and not embedded.add({record.experiment_id: encoded}):
            return embedded, number - 1
    return embedded, number
