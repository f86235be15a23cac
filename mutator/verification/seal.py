"""The seal of a finished run: one digest of its results and everything that determines them.

It covers the plan, the choices that made it, the sources, the versions of mutator, Python and packages, the
checks and golden runs, and each record with its patch. It excludes costs, hosts, processors, the git commit,
and the division into sessions, workers and shards.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from mutator._common.files import read_json
from mutator._common.hashing import canonical, digest
from mutator.store import digests
from mutator.store.check_results import FILE as CHECKS
from mutator.store.check_results import SCHEMA as CHECKS_SCHEMA
from mutator.store.lines import bare_segment, intact_lines
from mutator.store.records import ending_on
from mutator.store.run_folder import RunFolder

SCHEMA = "seal/1"
# the parts of run.json that concern results
_HEAD = (
    *("plan", "campaign_digest", "study", "seed", "reading", "runs"),
    *("hazards", "compared", "sources", "target_files"),
)


def seal_of(folder: RunFolder) -> str | None:
    """The seal of a run folder, computed from its content: 64 hex digits. None if the run is not finished or
    not verifiable."""
    if not folder.finished:
        return None
    head, checks = folder.head, read_json(folder.path / CHECKS, CHECKS_SCHEMA)
    facts = {key: head[key] for key in _HEAD}
    facts |= {"seeds": head["seeds"]} if "seeds" in head else {}
    facts |= {
        "choices": _choices(head["choices"]),
        "mutator": head["provenance"]["mutator"],
        "checks": checks["results"],
        "goldens": golden_digests(folder, head["golden_files"]),
        "versions": _versions(folder),
    }
    return digest([SCHEMA, facts, *(_records(folder, kind) for kind in digests.SEGMENTS)])


def _choices(given: Mapping[str, Any]) -> dict[str, Any]:
    """The choices, without the division of work and limits on kept data."""
    return {name: value for name, value in given.items() if name != "series_mb"} | {"shard": None}


def seal_or_why_not(folder: RunFolder) -> str:
    none = "the run is not finished" if folder.verifiable else not_verifiable(folder)
    return seal_of(folder) or f"none: {none}"


def not_verifiable(folder: RunFolder) -> str:
    return f"not verifiable, because {folder.head['schema']} has no digests"


def golden_digests(folder: RunFolder, names: Sequence[str]) -> dict[str, str]:
    """Digest of each golden run's files `names` (trace and record)."""
    found = {}
    for one in folder.goldens:
        place = folder.golden(*one)
        files = [digest((place / name).read_bytes()) for name in names]
        found[one.key] = digest(files)
    return found


def _versions(folder: RunFolder) -> list[str]:
    """The distinct sets of versions that computed anything, as canonical text."""
    return sorted({canonical([one.python, one.packages]) for one in folder.stretches})


def _records(folder: RunFolder, kind: str) -> dict[str, str]:
    """Digest of each valid record's line without its checksum, by experiment id."""
    found = {}
    for path in sorted((folder.path / kind).glob("*.jsonl")):
        segment = bare_segment(path, checksums=True)
        for number, line in intact_lines(path, checksums=True):
            if number > 1 and (ending := ending_on(line)).counts:
                found[ending.experiment_id] = digest(segment.body_of(line))
    return found
