"""The digests of a run folder: what somebody publishes or signs, and compares later.

* The *seal* covers a finished run's results and everything that results and pages are made from: all of
  run.json and checks.json but `UNSEALED_KEYS`, the campaign, the plan, golden runs, records with their
  patches, and the proof. It includes the versions of Python and packages.
* The *results digest* covers golden runs, records, and run.json but `KEYS_OUTSIDE_RESULTS_DIGEST`. It leaves
  out all versions and the texts of exceptions, so that it does not depend on versions that compute the same
  results.
* The *batches digest* covers the borders and reasons of a bench's batches, which no other digest covers.
* The *review digest* covers the decisions that allowed the run, with `--require-reviewed`.

No digest depends on costs, hosts, or the division of the work into sessions, workers and shards.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import read_json
from mutator._common.hashing import canonical_json, digest
from mutator.campaigns.plan_freezing import PLAN_CSV
from mutator.errors import MutatorError
from mutator.store import file_digests, plan_file
from mutator.store.checks_file import CHECKED_GOLDENS_KEY, CHECKS_SCHEMA, MEASURED_LIMITS_KEY
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checksummed_lines import intact_lines, unread_segment
from mutator.store.golden_files import (
    GOLDEN_FOLDER,
    list_golden_files,
    read_golden_files,
    stored_golden,
    stored_golden_keys,
)
from mutator.store.recorded_approvals import review_digest
from mutator.store.records import PROOF_FOLDER, parse_ending
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD
from mutator.store.session_environments import describe_environments, version_texts_by_package

SEAL_SCHEMA, RESULTS_DIGEST_SCHEMA = "seal/2", "results-digest/2"
_RUNS_SCHEMA = "results-digest/1"  # of the plan and its runs, as the seal includes them
# Everything else in these files is sealed, including keys that later versions add.
UNSEALED_KEYS_BY_FILE = {
    HEAD: ("stretches", "choices.shard", "choices.series_mb"),
    # the key of a cache, which depends on the machine; a cost, and the limits that follow from it
    CHECKS: ("digest", "run_cpu_s", MEASURED_LIMITS_KEY, CHECKED_GOLDENS_KEY),
}
KEYS_OUTSIDE_RESULTS_DIGEST = ("schema", "provenance", *UNSEALED_KEYS_BY_FILE[HEAD])  # of run.json
_SEALED_FILES = (CAMPAIGN_FILE, PLAN_CSV, plan_file.EXPERIMENTS_FILE, plan_file.FAULTS_FILE)
_EXCEPTION_TEXT_KEYS, _EMPTY_EXCEPTION_TEXTS = ("detail", "error.message"), (b'"detail":""', b'"error":null')
_UNSEALED_FILES_NOTE = (
    "times, engines and hosts of the experiments; series, kept traces, plots, stills, films"
)

_APPROVALS_NOTE = "only the review digest covers who approved what"


@dataclass(frozen=True, slots=True, kw_only=True)
class Seals:
    """The digests of a run to publish or sign, 64 hex digits each."""

    seal: str | None = None  #: the seal; None for a run that is unfinished
    results_digest: str | None = None  #: the results digest; None like the seal
    review_digest: str | None = None  #: the review digest; None for a run without `reviewed.json`
    #: the batches digest, of the borders and reasons of a bench's batches; None for a campaign
    batches_digest: str | None = None

    def digest_by_name(self) -> dict[str, str]:
        """Return the digests that the run has, by name."""
        names = {
            "seal": self.seal,
            "results digest": self.results_digest,
            "review digest": self.review_digest,
            "batches digest": self.batches_digest,
        }
        return {name: value for name, value in names.items() if value}


def seals_of(folder: RunFolder) -> Seals:
    """Compute the digests of a run folder from its content."""
    review = review_digest(folder.path)
    if not folder.is_finished:
        return Seals(review_digest=review)
    batches = plan_file.last_batch_digest(folder.path) if folder.is_bench else None
    head, goldens = folder.head.as_json(), golden_file_digests(folder)
    runs = digest([_RUNS_SCHEMA, folder.head.plan, goldens, _record_digests(folder, "records")])
    results = digest(
        [
            RESULTS_DIGEST_SCHEMA,
            without_keys(head, KEYS_OUTSIDE_RESULTS_DIGEST),
            goldens,
            _record_digests(folder, "records", _without_exception_texts),
        ]
    )
    facts = {
        HEAD: without_keys(head, UNSEALED_KEYS_BY_FILE[HEAD]),
        CHECKS: without_keys(read_json(folder.path / CHECKS, CHECKS_SCHEMA), UNSEALED_KEYS_BY_FILE[CHECKS]),
        "versions": _version_texts(folder),
        "files": _sha256_by_name(folder, _SEALED_FILES),
        PROOF_FOLDER: _record_digests(folder, PROOF_FOLDER),
    }
    return Seals(
        seal=digest([SEAL_SCHEMA, runs, facts]),
        results_digest=results,
        review_digest=review,
        batches_digest=batches,
    )


def digests_or_why_no_seal(folder: RunFolder) -> dict[str, str]:
    """Return the texts of `seals_of`; the seal of a run without one is the reason."""
    return {"seal": "none: the run is not finished"} | seals_of(folder).digest_by_name()


def without_keys(content: Mapping[str, Any], key_paths: Iterable[str]) -> dict[str, Any]:
    """Copy JSON content without the keys at `paths`, such as `choices.shard`."""
    rest_of_content = dict(content)
    for path in key_paths:
        key, _, rest = path.partition(".")
        if rest and isinstance(rest_of_content.get(key), Mapping):
            rest_of_content[key] = without_keys(rest_of_content[key], [rest])
        elif not rest:
            rest_of_content.pop(key, None)
    return rest_of_content


def unsealed_facts(folder: RunFolder) -> dict[str, str]:
    """Return the facts of a run folder that its seal does not cover, by name: who can write to the folder can
    change them.
    """
    choices = folder.head.choices
    chosen = {"chosen: shard": choices.shard, "chosen: series_mb": choices.series_mb}
    environment = {
        name: text
        for name, text in describe_environments(folder.session_environments).items()
        if name != "python"
    }
    approvals = {"approvals": _APPROVALS_NOTE} if review_digest(folder.path) else {}
    choice_texts = {name: str(value) for name, value in chosen.items() if value}
    return {**environment, **choice_texts, **approvals, "other files": _UNSEALED_FILES_NOTE}


def golden_digests(folder: RunFolder, names: Sequence[str]) -> dict[str, str]:
    """Digest of each golden run's files `names` (trace and record)."""
    digests = {}
    for golden_run in folder.goldens_with_files:
        files = read_golden_files(folder.path / GOLDEN_FOLDER, golden_run.key)
        if missing := [name for name in names if name not in files]:
            raise MutatorError(f"golden run {golden_run.key} has no {missing[0]}", where=folder.path)
        digests[golden_run.key] = digest([digest(files[name]) for name in names])
    return digests


def golden_file_digests(folder: RunFolder) -> dict[str, str]:
    """SHA-256 of every file of the golden runs, by its name in the run folder if no run were packed."""
    golden = folder.path / GOLDEN_FOLDER
    stored = [stored_golden(golden, key) for key in stored_golden_keys(golden)]
    unpacked = (path for run in stored if run.is_dir() for path in list_golden_files(run))
    digests = _sha256_by_name(folder, [path.relative_to(folder.path).as_posix() for path in unpacked])
    for key in (path.stem for path in stored if path.is_file()):
        files = read_golden_files(golden, key)
        digests |= {f"{GOLDEN_FOLDER}/{key}/{name}": digest(data) for name, data in files.items()}
    return digests


def _sha256_by_name(folder: RunFolder, names: Sequence[str]) -> dict[str, str]:
    digests = file_digests.digests_of_files(folder.path, names)
    return {name: file_digest.sha256 for name, file_digest in digests.items() if file_digest}


def _version_texts(folder: RunFolder) -> list[str]:
    """Return the distinct sets of versions that computed anything, as canonical text.

    A bench meets golden runs, and the packages that they load, in the order of its batches: all are one set.
    """
    if folder.is_bench:
        pythons = {stretch.python for stretch in folder.session_environments}
        return [canonical_json([sorted(pythons), version_texts_by_package(folder.session_environments)])]
    return sorted(
        {canonical_json([stretch.python, stretch.packages]) for stretch in folder.session_environments}
    )


def _record_digests(
    folder: RunFolder, kind: str, sealed_part: Callable[[bytes], bytes] = lambda body: body
) -> dict[str, str]:
    """Digest of the `sealed_part` of each valid record's line without its checksum, by experiment id."""
    digests = {}
    for path in sorted(path_below(folder.path, kind).glob("*.jsonl")):
        segment = unread_segment(path)
        for number, line in intact_lines(path):
            if number > 1 and (ending := parse_ending(line)).is_final:
                digests[ending.experiment_id] = digest(sealed_part(segment.without_checksum(line)))
    return digests


def _without_exception_texts(body: bytes) -> bytes:
    """Return a record's line without the texts of exceptions, which differ between versions of Python."""
    if all(part in body for part in _EMPTY_EXCEPTION_TEXTS):
        return body
    return canonical_json(without_keys(json.loads(b"{" + body), _EXCEPTION_TEXT_KEYS)).encode()
