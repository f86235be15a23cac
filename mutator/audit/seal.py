"""The digests of a run folder: what somebody publishes or signs, and compares later.

* The *seal* covers a finished run's results and everything that results and pages are made from: all of
  run.json and checks.json but `OUTSIDE`, the campaign, the plan, golden runs, records with their patches, and
  the proof. It includes the versions of Python and packages.
* The *results digest* covers golden runs, records, and run.json but `OUTSIDE_RESULTS`. It leaves out all
  versions and the texts of exceptions, so that it does not depend on versions that compute the same results.
* The *review digest* covers the decisions that allowed the run, with `--require-reviewed`.

No digest depends on costs, hosts, or the division of the work into sessions, workers and shards.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.files import read_json
from mutator._common.hashing import canonical_json, digest
from mutator.campaigns.freezing import CSV
from mutator.store import file_digests, plan_file
from mutator.store.approvals import review_digest
from mutator.store.check_results import FILE as CHECKS
from mutator.store.check_results import SCHEMA as CHECKS_SCHEMA
from mutator.store.checksummed_lines import bare_segment, intact_lines
from mutator.store.records import PROOF_FOLDER, parse_ending
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN, HEAD
from mutator.store.work_stretches import describe_stretches

SCHEMA, RESULTS_SCHEMA = "seal/2", "results-digest/2"
_RUNS_SCHEMA = "results-digest/1"  # of the plan and its runs, as the seal includes them
# Everything else in these files is sealed, including keys that later versions add.
OUTSIDE = {
    HEAD: ("stretches", "choices.shard", "choices.series_mb"),
    CHECKS: ("digest", "run_cpu_s"),  # the key of a cache, which depends on the machine; a cost
}
OUTSIDE_RESULTS = ("schema", "provenance", *OUTSIDE[HEAD])  # of run.json
_FILES = (CAMPAIGN, CSV, plan_file.EXPERIMENTS, plan_file.FAULTS)
_TEXTS, _NO_TEXTS = ("detail", "error.message"), (b'"detail":""', b'"error":null')
_UNSEALED_FILES = "times, engines and hosts of the experiments; series, kept traces, plots, stills, films"

_APPROVALS = "only the review digest covers who approved what"


@dataclass(frozen=True, slots=True, kw_only=True)
class Seals:
    """The digests of a run to publish or sign, 64 hex digits each."""

    seal: str | None = None  #: the seal; None for a run that is unfinished
    results_digest: str | None = None  #: the results digest; None like the seal
    review_digest: str | None = None  #: the review digest; None for a run without `reviewed.json`

    def texts(self) -> dict[str, str]:
        """Return the digests that the run has, by name."""
        names = {
            "seal": self.seal,
            "results digest": self.results_digest,
            "review digest": self.review_digest,
        }
        return {name: value for name, value in names.items() if value}


def seals_of(folder: RunFolder) -> Seals:
    """Compute the digests of a run folder from its content."""
    review = review_digest(folder.path)
    if not folder.is_finished:
        return Seals(review_digest=review)
    head, goldens = folder.head.as_json(), golden_files(folder)
    runs = digest([_RUNS_SCHEMA, folder.head.plan, goldens, _records(folder, "records")])
    results = digest(
        [
            RESULTS_SCHEMA,
            without(head, OUTSIDE_RESULTS),
            goldens,
            _records(folder, "records", _without_texts),
        ]
    )
    facts = {
        HEAD: without(head, OUTSIDE[HEAD]),
        CHECKS: without(read_json(folder.path / CHECKS, CHECKS_SCHEMA), OUTSIDE[CHECKS]),
        "versions": _versions(folder),
        "files": _sha256(folder, _FILES),
        PROOF_FOLDER: _records(folder, PROOF_FOLDER),
    }
    return Seals(seal=digest([SCHEMA, runs, facts]), results_digest=results, review_digest=review)


def seal_or_why_not(folder: RunFolder) -> dict[str, str]:
    """Return the texts of `seals_of`; the seal of a run without one is the reason."""
    return {"seal": "none: the run is not finished"} | seals_of(folder).texts()


def without(content: Mapping[str, Any], paths: Iterable[str]) -> dict[str, Any]:
    """Copy JSON content without the keys at `paths`, such as `choices.shard`."""
    found = dict(content)
    for path in paths:
        key, _, rest = path.partition(".")
        if rest and isinstance(found.get(key), Mapping):
            found[key] = without(found[key], [rest])
        elif not rest:
            found.pop(key, None)
    return found


def unsealed_facts(folder: RunFolder) -> dict[str, str]:
    """Return the facts of a run folder that its seal does not cover, by name: who can write to the folder can
    change them.
    """
    choices = folder.head.choices
    chosen = {"chosen: shard": choices.shard, "chosen: series_mb": choices.series_mb}
    environment = {
        name: text for name, text in describe_stretches(folder.stretches).items() if name != "python"
    }
    approvals = {"approvals": _APPROVALS} if review_digest(folder.path) else {}
    made = {name: str(value) for name, value in chosen.items() if value}
    return {**environment, **made, **approvals, "other files": _UNSEALED_FILES}


def golden_digests(folder: RunFolder, names: Sequence[str]) -> dict[str, str]:
    """Digest of each golden run's files `names` (trace and record)."""
    found = {}
    for one in folder.golden_runs:
        place = folder.golden_folder(*one)
        files = [digest(read_bounded(path_below(place, name))) for name in names]
        found[one.key] = digest(files)
    return found


def golden_files(folder: RunFolder) -> dict[str, str]:
    """SHA-256 of every file of the golden runs, by name in the run folder."""
    paths = sorted(path for path in (folder.path / "golden").rglob("*") if path.is_file())
    return _sha256(folder, [path.relative_to(folder.path).as_posix() for path in paths])


def _sha256(folder: RunFolder, names: Sequence[str]) -> dict[str, str]:
    found = file_digests.digests_of_files(folder.path, names)
    return {name: one.sha256 for name, one in found.items() if one}


def _versions(folder: RunFolder) -> list[str]:
    """Return the distinct sets of versions that computed anything, as canonical text."""
    return sorted({canonical_json([one.python, one.packages]) for one in folder.stretches})


def _records(
    folder: RunFolder, kind: str, sealed: Callable[[bytes], bytes] = lambda body: body
) -> dict[str, str]:
    """Digest of what is `sealed` of each valid record's line without its checksum, by experiment id."""
    found = {}
    for path in sorted(path_below(folder.path, kind).glob("*.jsonl")):
        segment = bare_segment(path)
        for number, line in intact_lines(path):
            if number > 1 and (ending := parse_ending(line)).is_final:
                found[ending.experiment_id] = digest(sealed(segment.without_checksum(line)))
    return found


def _without_texts(body: bytes) -> bytes:
    """Return a record's line without the texts of exceptions, which differ between versions of Python."""
    if all(part in body for part in _NO_TEXTS):
        return body
    return canonical_json(without(json.loads(b"{" + body), _TEXTS)).encode()
