"""Check that a run folder is unchanged before anything in it is used.

Files are compared with `digests.json`, lines with their checksums, and records with the plan.
"""

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import is_half_written
from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.store import file_digests, plan_file, verified_runs_cache
from mutator.store.checksummed_lines import Segment, intact_lines, read_segment, unread_segment
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.packed_patches import PatchFolder
from mutator.store.plan_strata import STRATA_FILE
from mutator.store.planned_scenarios import SCENARIOS_FILE
from mutator.store.records import RECORDS_SCHEMA, parse_ending, second_record_error
from mutator.store.run_head import CAMPAIGN_FILE, HEAD, RunHead
from mutator.store.shards import Shard

# folders in which a finished run has no unknown files
FULLY_DIGESTED_FOLDERS = ("plan", "golden", *file_digests.SEGMENT_FOLDERS)
# files that cannot be recreated
IRREPLACEABLE_FILES = (
    HEAD,
    CAMPAIGN_FILE,
    plan_file.EXPERIMENTS_FILE,
    plan_file.FAULTS_FILE,
    plan_file.BATCHES_FILE,
    SCENARIOS_FILE,
    STRATA_FILE,
)
DIGESTED_TOP_FILES = (HEAD, CAMPAIGN_FILE, "plan.csv", "checks.json", "reviewed.json")
_MOST_NAMED_EXPERIMENTS = 5  # in one message: the ids of a million experiments would fill it


def run_problems(
    run: Path, head: RunHead, ledger: DigestLedger, shard: Shard | None, *, ignore_cache: bool = False
) -> Iterator[MutatorError]:
    """Yield every problem of a run folder in which `shard` runs.

    For a finished run that this machine has verified before, only file bytes are compared, unless
    `ignore_cache`.
    """
    key = ""
    current_digests = current_digests_of(run, ledger)
    file_errors = [*file_problems(run, ledger, current_digests), *_open_segment_problems(run, ledger)]
    yield from file_errors
    if ledger.finished:
        unexpected = [
            MutatorError(
                f"not named in {file_digests.DIGESTS_FILE}",
                where=path,
                expected="only files that the finished run wrote",
                remedy=_remedy(run, ""),
            )
            for path in unexpected_files(run, ledger)
        ]
        yield from unexpected
        file_errors += unexpected
        key = "" if file_errors or ledger.rewriting else cache_key_of(run, current_digests)
    if key and not ignore_cache and verified_runs_cache.recall_facts(key).get("verified"):
        return
    try:
        planned = planned_positions(run, head, shard)
    except MutatorError as err:
        yield err
        return
    is_intact = True
    for problem in record_problems(run, head, ledger, planned):
        is_intact = False
        yield problem
    if key and is_intact:
        verified_runs_cache.remember_facts(key, verified=True)


def verified_cache_key(run: Path) -> str:
    """Return the key of a finished run folder's verified content in the cache `verified_runs`.

    The key is empty if the run is not finished or does not match its digests.
    """
    ledger = file_digests.load_ledger(run)
    current_digests = current_digests_of(run, ledger)
    settled = ledger.finished and not ledger.rewriting
    return (
        cache_key_of(run, current_digests)
        if settled and not any(file_problems(run, ledger, current_digests))
        else ""
    )


def current_digests_of(run: Path, ledger: DigestLedger) -> dict[str, FileDigest | None]:
    names = list(dict.fromkeys((*ledger.names, *verified_runs_cache.list_patch_files(run))))
    return file_digests.digests_of_files(run, names)


def cache_key_of(run: Path, current_digests: Mapping[str, FileDigest | None]) -> str:
    """Return the `verified_runs_cache.cache_key` of these files and the ledger."""
    ledger = FileDigest.of_file(run / file_digests.DIGESTS_FILE)
    with_ledger = {**current_digests, file_digests.DIGESTS_FILE: ledger}
    return verified_runs_cache.cache_key(
        {name: file_digest.sha256 if file_digest else None for name, file_digest in with_ledger.items()}
    )


def planned_positions(run: Path, head: RunHead, shard: Shard | None) -> dict[str, int]:
    """Return the ids and positions of the experiments that run in a run folder, in plan order.

    MutatorError if the plan has a duplicate, or if its length does not match its chunks.
    """
    path = run / plan_file.EXPERIMENTS_FILE
    positions: dict[str, int] = {}
    for place, name in enumerate(plan_file.experiment_ids(run)):
        if positions.setdefault(name, place) != place:
            raise MutatorError(
                f"duplicate experiment {name}", where=path, line=place + 1, remedy=_remedy(run, HEAD)
            )
    counts = [count for _, _, count in head.chunks]
    if sum(counts) != len(positions):
        raise MutatorError(
            counted(len(positions), "experiment"),
            where=path,
            expected=f"{sum(counts)}, the total of the chunks in {HEAD}",
            remedy=_remedy(run, HEAD),
        )
    if shard is None:
        return positions
    is_in_shard = [shard.has_chunk(chunk) for chunk, count in enumerate(counts) for _ in range(count)]
    return {name: place for name, place in positions.items() if is_in_shard[place]}


def file_problems(
    run: Path, ledger: DigestLedger, current_digests: Mapping[str, FileDigest | None]
) -> Iterator[MutatorError]:
    for name in ledger.names:
        current = current_digests[name]
        if ledger.accepts(name, current):
            continue
        if current is None:
            yield MutatorError(
                "missing",
                where=path_below(run, name),
                expected=f"the file named in {file_digests.DIGESTS_FILE}",
                remedy=_remedy(run, name),
            )
        else:
            yield from _changed_file_problems(run, name, ledger.files[name], current)


def _changed_file_problems(
    run: Path, name: str, expected: FileDigest, current: FileDigest
) -> Iterator[MutatorError]:
    path = path_below(run, name)
    if expected.lines is not None:
        segment = read_segment(path)
        if segment.damaged_line_numbers:
            yield from map(segment.damage_error, segment.damaged_line_numbers)
            return
        got = f"{counted(len(segment.lines), 'line')}, all with their checksums"
        yield MutatorError(
            got,
            where=path,
            line=len(segment.lines),
            expected=_describe_digest(expected),
            remedy=_remedy(run, name),
        )
        return
    line = None
    if name in (plan_file.EXPERIMENTS_FILE, plan_file.FAULTS_FILE):
        with suppress(MutatorError):  # a missing file is a separate problem
            line = next(
                (problem.line for problem in plan_file.plan_problems(run) if problem.where == str(path)), None
            )
    yield MutatorError(
        f"changed: {_describe_digest(current)}",
        where=path,
        line=line,
        expected=_describe_digest(expected),
        remedy=_remedy(run, name),
    )


def _describe_digest(file_digest: FileDigest) -> str:
    lines = "" if file_digest.lines is None else f"{counted(file_digest.lines, 'line')}, "
    return f"{lines}{file_digest.size} bytes with SHA-256 {file_digest.sha256[:16]}"


def _remedy(run: Path, name: str) -> str:
    if name in IRREPLACEABLE_FILES:
        return "restore it from a copy of the run folder, or use a new folder"
    return f"set the damage aside with `mutator verify {run} --repair`, then fill the gap with `mutator run`"


def _open_segment_problems(run: Path, ledger: DigestLedger) -> Iterator[MutatorError]:
    """Yield a problem for each damaged line of segments that are in use or that a killed command left."""
    for name in file_digests.list_segments(run):
        if name not in ledger.files:
            try:
                segment = read_segment(path_below(run, name))
            except MutatorError as err:
                yield err
                continue
            yield from map(segment.damage_error, segment.damaged_line_numbers)


def unexpected_files(run: Path, ledger: DigestLedger) -> Iterator[Path]:
    """Yield files that a finished run's ledger does not name, in folders where it must name all."""
    ledger_names = {*ledger.files, *ledger.rewriting}
    paths = [run / name for name in DIGESTED_TOP_FILES]
    paths += [path for folder in FULLY_DIGESTED_FOLDERS for path in sorted((run / folder).rglob("*"))]
    for path in paths:
        is_expected = path.relative_to(run).as_posix() in ledger_names or is_half_written(path.name)
        if path.is_file() and not is_expected:
            yield path


def record_problems(
    run: Path, head: RunHead, ledger: DigestLedger, planned: Collection[str]
) -> Iterator[MutatorError]:
    """Yield a problem for each unplanned, duplicate or missing record."""
    patches = PatchFolder(run)
    patch_digests = dict(patches.experiment_digest_pairs())
    for kind in file_digests.SEGMENT_FOLDERS:
        finals: dict[str, int] = {}  # id -> hash of its final record
        for path in sorted((run / kind).glob("*.jsonl")):
            segment, lines = unread_segment(path), intact_lines(path)
            try:
                yield from _segment_head_problem(segment, lines, head.plan_of_lines)
                for number, name, patch, content in _final_records(segment, lines, planned):
                    if isinstance(name, MutatorError):
                        yield name
                        continue
                    if kind == "records" and patch_digests.get(name, "") != patch:
                        yield from patch_problems(patches, name, patch, path.stem)
                    if name in finals:
                        yield second_record_error(path, number, name, same=finals[name] == content)
                    finals[name] = content
            except MutatorError as err:
                yield err
        missing = [name for name in planned if name not in finals]
        if ledger.finished and kind == "records" and missing:
            more = (
                f" and {len(missing) - _MOST_NAMED_EXPERIMENTS} more"
                if len(missing) > _MOST_NAMED_EXPERIMENTS
                else ""
            )
            yield MutatorError(
                f"no record of {', '.join(missing[:_MOST_NAMED_EXPERIMENTS])}{more}",
                where=run / kind,
                expected="a record of each planned experiment, because the run is marked as finished",
                remedy=_remedy(run, ""),
            )


_NumberedLines = Iterator[tuple[int, bytes]]  # line number (from 1) and bytes


def _segment_head_problem(segment: Segment, lines: _NumberedLines, plan: str) -> Iterator[MutatorError]:
    """Yield a problem if a segment belongs to another run or has been moved."""
    number, line = next(lines, (0, b""))
    if number != 1:
        return
    with_head = replace(segment, lines={1: line})
    try:
        with_head.check_head(RECORDS_SCHEMA)
        if (head_plan := with_head.parse_line(1).get("plan")) != plan:
            yield MutatorError(
                f"records of plan {str(head_plan)[:16]}",
                where=segment.path,
                line=1,
                expected=plan[:16],
                remedy="move the file back to its own run folder",
            )
    except MutatorError as err:
        yield err


def _final_records(
    segment: Segment, lines: _NumberedLines, planned: Collection[str]
) -> Iterator[tuple[int, str | MutatorError, str, int]]:
    """Yield line number, experiment, patch and hash of each final record, or a line's problem."""
    for number, line in lines:
        try:
            ending = parse_ending(line)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            yield number, segment.damage_error(number), "", 0
            continue
        if ending.experiment_id not in planned:
            problem = MutatorError(
                f"a record of {ending.experiment_id}, which is not planned for this run",
                where=segment.path,
                line=number,
                expected=f"experiments of {plan_file.EXPERIMENTS_FILE} that belong to this shard",
                remedy=_remedy(segment.path.parent.parent, ""),
            )
            yield number, problem, "", 0
        elif ending.is_final:
            # a hash of 8 bytes is enough to tell two records of this process apart, for a million of them
            yield number, ending.experiment_id, ending.patch_digest, hash(segment.without_checksum(line))


def patch_problems(
    patches: PatchFolder, experiment_id: str, recorded_digest: str, worker: str = ""
) -> Iterator[MutatorError]:
    """Yield a problem if a stored patch does not have the `recorded_digest` (empty: no mutant)."""
    if not recorded_digest:
        return
    data = patches.read_patch(experiment_id)
    stored_digest = "" if data is None else digest(data)
    if stored_digest != recorded_digest:
        yield MutatorError(
            f"the patch of {experiment_id} is not the one that was run: SHA-256 {stored_digest[:16]}"
            if stored_digest
            else f"no patch of {experiment_id}",
            where=patches.expected_file_of(experiment_id, worker),
            expected=f"SHA-256 {recorded_digest[:16]}, as in the record",
            remedy=_remedy(patches.run, ""),
        )
