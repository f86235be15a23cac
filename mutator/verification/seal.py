"""The seal of a finished run: one digest of everything that counts, whoever computed it on how many machines.

It is a function of content alone: of the plan, the choices that made it and the sources, of the versions of
mutator, Python and packages, of the checks and golden runs, and of each record with its patch. Costs, hosts,
processors and the git commit are not in it, nor is how the work was cut into sessions, workers and shards.
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
# What run.json says of the results, and reports repeat.
_HEAD = (
    *("plan", "campaign_digest", "study", "seed", "reading", "runs"),
    *("hazards", "compared", "sources", "target_files"),
)


def seal_of(folder: RunFolder) -> str | None:
    """The seal of a run folder, computed from what it holds: 64 hex digits. None for a run that is not
    finished, or not verifiable."""
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
    """But for how the work was cut, and how much is kept to look at."""
    return {name: value for name, value in given.items() if name != "series_mb"} | {"shard": None}


def seal_or_why_not(folder: RunFolder) -> str:
    """The seal, or in a few words why there is none."""
    none = "the run is not finished" if folder.verifiable else not_verifiable(folder)
    return seal_of(folder) or f"none: {none}"


def not_verifiable(folder: RunFolder) -> str:
    """What is said of a run folder of an earlier schema."""
    return f"not verifiable, as {folder.head['schema']} has no digests"


def golden_digests(folder: RunFolder, names: Sequence[str]) -> dict[str, str]:
    """Digest of the files called `names`, trace and record, of each golden run."""
    found = {}
    for one in folder.goldens:
        place = folder.golden(*one)
        files = [digest((place / name).read_bytes()) for name in names]
        found[one.key] = digest(files)
    return found


def _versions(folder: RunFolder) -> list[str]:
    """Each set of versions that computed anything, once, as canonical text."""
    return sorted({canonical([one.python, one.packages]) for one in folder.stretches})


def _records(folder: RunFolder, kind: str) -> dict[str, str]:
    """Digest of each record that counts, by experiment id: of its line, without the checksum."""
    found = {}
    for path in sorted((folder.path / kind).glob("*.jsonl")):
        segment = bare_segment(path, checksums=True)
        for number, line in intact_lines(path, checksums=True):
            if number > 1 and (ending := ending_on(line)).counts:
                found[ending.experiment_id] = digest(segment.body_of(line))
    return found
