"""The replays on a comparison's page: both runs of the worst changes, up to a limit, to play side by side.

web/comparison/pair.js shows them.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast
from urllib.parse import quote

from mutator._common.hashing import as_json_types
from mutator._common.message_text import counted
from mutator.comparison.experiment_matching import ExperimentPair
from mutator.comparison.run_comparison_and_gates import Comparison
from mutator.store.embedded_series import (
    EMBEDDED_SERIES_ELEMENT,
    MOST_EMBEDDED_SERIES_BYTES,
    EmbeddedSeries,
    readable_encoded_series,
)
from mutator.store.missing_series import reason_for_missing_series
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.web import json_script_element

_TRACE_DIGEST_DIGITS = 16  # of the digest that a series must name


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportAddresses:
    """The address of each run's report, for links from the page; '' if there is no report."""

    a: str = ""
    b: str = ""


def addresses_from(out: Path, comparison: Comparison) -> ReportAddresses:
    """Return the addresses of the reports on disk, relative to the folder `out`."""
    pages = (side.folder.path / "report" / "index.html" for side in (comparison.a, comparison.b))
    a, b = (_relative_address(page, out) if page.is_file() else "" for page in pages)
    return ReportAddresses(a=a, b=b)


def _relative_address(page: Path, out: Path) -> str:
    # "./": otherwise, a first folder with a colon would be a scheme
    return "./" + quote(Path(os.path.relpath(page.resolve(), out.resolve())).as_posix())


def replay_elements(comparison: Comparison, addresses: ReportAddresses) -> tuple[str, ...]:
    """Return the script elements with the replays of the changed pairs, and what these draw."""
    embedded, digests, complete_count = _embed_pairs(comparison)
    facts = {
        "sides": [
            _side_facts(comparison, 0, f"Before: {comparison.names.a}", addresses.a),
            _side_facts(comparison, 1, f"After: {comparison.names.b}", addresses.b),
        ],
        "traces": digests,
        "complete": complete_count,
        "beyond": _describe_limit(complete_count),
    }
    return (
        json_script_element(facts, "facts"),
        json_script_element(embedded.as_json(), EMBEDDED_SERIES_ELEMENT),
    )


def _describe_limit(complete_count: int) -> str:
    worst = (
        f"the {counted(complete_count, 'experiment')} with the worst changes" if complete_count else "none"
    )
    return (
        f"This page contains the replays of {worst}, because replays fill at most "
        f"{MOST_EMBEDDED_SERIES_BYTES / 1e6:g} MB of it. The report of the run has the others that it kept."
    )


def _side_facts(comparison: Comparison, number: int, title: str, address: str) -> dict[str, Any]:
    folder = (comparison.a, comparison.b)[number].folder
    return {
        "title": title,
        "report": address,
        "scene": comparison.scenes[number],
        "hazards": as_json_types(folder.head.about_hazards),
        "reason": reason_for_missing_series(folder, is_packed=TimeSeriesFolder(folder.path).is_packed),
    }


def _embed_pairs(comparison: Comparison) -> tuple[EmbeddedSeries, dict[str, str], int]:
    """Embed the series of the changed pairs, worst first, until a pair does not fit. Return them, the start
    of the digest of each one's trace, and how many pairs were considered.
    """
    embedded, digests = EmbeddedSeries(MOST_EMBEDDED_SERIES_BYTES), {}
    sides = [
        (letter, TimeSeriesFolder(run.folder.path), run.folder.records())
        for letter, run in (("a", comparison.a), ("b", comparison.b))
    ]
    for number, pair in enumerate(comparison.changed_pairs):
        series_by_key: dict[str, tuple[bytes, bytes]] = {}
        for letter, series, records in sides:
            record = records.get(_id_in(pair, letter))
            if record and (encoded := readable_encoded_series(series, record)):
                key = f"{letter}/{record.experiment_id}"
                series_by_key[key] = encoded
                digests[key] = record.trace_digest[:_TRACE_DIGEST_DIGITS]
        if not embedded.add(series_by_key):
            return embedded, digests, number
    return embedded, digests, len(comparison.changed_pairs)


def _id_in(pair: ExperimentPair, letter: str) -> str:
    return cast(str, getattr(pair, letter).id)
