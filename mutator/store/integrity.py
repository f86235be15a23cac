"""Check that a run folder is unchanged before anything in it is used.

Files are compared with `digests.json`, lines with their checksums, and records with the plan.
"""

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from mutator._common.below import inside
from mutator._common.files import is_half_written
from mutator._common.hashing import digest
from mutator._common.text import counted
from mutator.errors import MutatorError
from mutator.store import file_digests, plan_file, verified_runs_cache
from mutator.store.checksummed_lines import Segment, bare_segment, intact_lines, read_segment
from mutator.store.file_digests import Digest, Ledger
from mutator.store.patch_files import Patches
from mutator.store.records import SCHEMA, ending_on, second_record
from mutator.store.run_head import CAMPAIGN, HEAD, RunHead
from mutator.store.shards import Shard

SEALED = ("plan", "golden", *file_digests.SEGMENTS)  # folders in which a finished run has no unknown files
WHOLE = (HEAD, CAMPAIGN, plan_file.EXPERIMENTS, plan_file.FAULTS)  # files that cannot be recreated
TOP = (HEAD, CAMPAIGN, "plan.csv", "checks.json", "reviewed.json")
_MANY = 5  # at most this many experiments are named in one message


def problems(
    run: Path, head: RunHead, ledger: Ledger, shard: Shard | None, *, anew: bool = False
) -> Iterator[MutatorError]:
    """Yield every problem of a run folder in which `shard` runs.

    For a finished run that this machine has verified before, only file bytes are compared, unless `anew`.
    """
    key = ""
    found = digests_of(run, ledger)
    wrong = [*file_problems(run, ledger, found), *_open_segments(run, ledger)]
    yield from wrong
    if ledger.finished:
        others = [
            MutatorError(
                f"not named in {file_digests.FILE}",
                where=path,
                expected="only files that the finished run wrote",
                remedy=_remedy(run, ""),
            )
            for path in strangers(run, ledger)
        ]
        yield from others
        wrong += others
        key = "" if wrong or ledger.rewriting else key_of(run, found)
    if key and not anew and verified_runs_cache.recall(key).get("verified"):
        return
    try:
        planned = share(run, head, shard)
    except MutatorError as err:
        yield err
        return
    none_yet = True
    for problem in id_problems(run, head, ledger, planned):
        none_yet = False
        yield problem
    if key and none_yet:
        verified_runs_cache.remember(key, verified=True)


def content_key(run: Path) -> str:
    """Return the key of a finished run folder's verified content in the cache `verified_runs`.

    The key is empty if the run is not finished or does not match its digests.
    """
    ledger = file_digests.read(run)
    found = digests_of(run, ledger)
    settled = ledger.finished and not ledger.rewriting
    return key_of(run, found) if settled and not any(file_problems(run, ledger, found)) else ""


def digests_of(run: Path, ledger: Ledger) -> dict[str, Digest | None]:
    names = list(dict.fromkeys((*ledger.names, *verified_runs_cache.other_files(run))))
    return file_digests.of_files(run, names)


def key_of(run: Path, found: Mapping[str, Digest | None]) -> str:
    """Return the `verified_runs.key_of` of these files and the ledger."""
    ledger = Digest.of_file(run / file_digests.FILE)
    told = {**found, file_digests.FILE: ledger}
    return verified_runs_cache.key_of({name: one.sha256 if one else None for name, one in told.items()})


def share(run: Path, head: RunHead, shard: Shard | None) -> dict[str, int]:
    """Return the ids and positions of the experiments that run in a run folder, in plan order.

    MutatorError if the plan has a duplicate, or if its length does not match its chunks.
    """
    path = run / plan_file.EXPERIMENTS
    places: dict[str, int] = {}
    for place, name in enumerate(plan_file.ids(run)):
        if places.setdefault(name, place) != place:
            raise MutatorError(
                f"duplicate experiment {name}", where=path, line=place + 1, remedy=_remedy(run, HEAD)
            )
    counts = [count for _, _, count in head.chunks]
    if sum(counts) != len(places):
        raise MutatorError(
            counted(len(places), "experiment"),
            where=path,
            expected=f"{sum(counts)}, the total of the chunks in {HEAD}",
            remedy=_remedy(run, HEAD),
        )
    if shard is None:
        return places
    ours = [shard.has(chunk) for chunk, count in enumerate(counts) for _ in range(count)]
    return {name: place for name, place in places.items() if ours[place]}


def file_problems(
    run: Path, ledger: Ledger, digests_found: Mapping[str, Digest | None]
) -> Iterator[MutatorError]:
    for name in ledger.names:
        found = digests_found[name]
        if ledger.accepts(name, found):
            continue
        if found is None:
            yield MutatorError(
                "missing",
                where=inside(run, name),
                expected=f"the file named in {file_digests.FILE}",
                remedy=_remedy(run, name),
            )
        else:
            yield from _changed(run, name, ledger.files[name], found)


def _changed(run: Path, name: str, known: Digest, found: Digest) -> Iterator[MutatorError]:
    path = inside(run, name)
    if known.lines is not None:
        segment = read_segment(path)
        if segment.damaged:
            yield from map(segment.problem, segment.damaged)
            return
        got = f"{counted(len(segment.lines), 'line')}, all with their checksums"
        yield MutatorError(
            got, where=path, line=len(segment.lines), expected=_told(known), remedy=_remedy(run, name)
        )
        return
    line = None
    if name in (plan_file.EXPERIMENTS, plan_file.FAULTS):
        with suppress(MutatorError):  # a missing file is a separate problem
            line = next((one.line for one in plan_file.problems(run) if one.where == str(path)), None)
    yield MutatorError(
        f"changed: {_told(found)}", where=path, line=line, expected=_told(known), remedy=_remedy(run, name)
    )


def _told(one: Digest) -> str:
    lines = "" if one.lines is None else f"{counted(one.lines, 'line')}, "
    return f"{lines}{one.size} bytes with SHA-256 {one.sha256[:16]}"


def _remedy(run: Path, name: str) -> str:
    if name in WHOLE:
        return "restore it from a copy of the run folder, or use a new folder"
    return f"set the damage aside with `mutator verify {run} --repair`, then fill the gap with `mutator run`"


def _open_segments(run: Path, ledger: Ledger) -> Iterator[MutatorError]:
    """Yield a problem for each damaged line of segments that are in use or that a killed command left."""
    for name in file_digests.segments(run):
        if name not in ledger.files:
            try:
                segment = read_segment(inside(run, name))
            except MutatorError as err:
                yield err
                continue
            yield from map(segment.problem, segment.damaged)


def strangers(run: Path, ledger: Ledger) -> Iterator[Path]:
    """Yield files that a finished run's ledger does not name, in folders where it must name all."""
    known = {*ledger.files, *ledger.rewriting}
    paths = [run / name for name in TOP]
    paths += [path for folder in SEALED for path in sorted((run / folder).rglob("*"))]
    for path in paths:
        ours = path.relative_to(run).as_posix() in known or is_half_written(path.name)
        if path.is_file() and not ours:
            yield path


def id_problems(run: Path, head: RunHead, ledger: Ledger, planned: Collection[str]) -> Iterator[MutatorError]:
    """Yield a problem for each unplanned, duplicate or missing record."""
    patches = Patches(run)
    stored = dict(patches.digests())
    for kind in file_digests.SEGMENTS:
        done: dict[str, int] = {}  # id -> hash of its final record
        for path in sorted((run / kind).glob("*.jsonl")):
            segment, lines = bare_segment(path), intact_lines(path)
            try:
                yield from _head_problem(segment, lines, head.plan)
                for number, name, patch, content in _counted(segment, lines, planned):
                    if isinstance(name, MutatorError):
                        yield name
                        continue
                    if kind == "records" and stored.get(name, "") != patch:
                        yield from patch_problems(patches, name, patch, path.stem)
                    if name in done:
                        yield second_record(path, number, name, same=done[name] == content)
                    done[name] = content
            except MutatorError as err:
                yield err
        missing = [name for name in planned if name not in done]
        if ledger.finished and kind == "records" and missing:
            more = f" and {len(missing) - _MANY} more" if len(missing) > _MANY else ""
            yield MutatorError(
                f"no record of {', '.join(missing[:_MANY])}{more}",
                where=run / kind,
                expected="a record of each planned experiment, because the run is marked as finished",
                remedy=_remedy(run, ""),
            )


_Lines = Iterator[tuple[int, bytes]]  # line number (from 1) and bytes


def _head_problem(segment: Segment, lines: _Lines, plan: str) -> Iterator[MutatorError]:
    """Yield a problem if a segment belongs to another run or has been moved."""
    number, line = next(lines, (0, b""))
    if number != 1:
        return
    told = replace(segment, lines={1: line})
    try:
        told.check_head(SCHEMA)
        if (found := told.content(1).get("plan")) != plan:
            yield MutatorError(
                f"records of plan {str(found)[:16]}",
                where=segment.path,
                line=1,
                expected=plan[:16],
                remedy="move the file back to its own run folder",
            )
    except MutatorError as err:
        yield err


def _counted(
    segment: Segment, lines: _Lines, planned: Collection[str]
) -> Iterator[tuple[int, str | MutatorError, str, int]]:
    """Yield line number, experiment, patch and hash of each final record, or a line's problem."""
    for number, line in lines:
        try:
            ending = ending_on(line)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            yield number, segment.problem(number), "", 0
            continue
        if ending.experiment_id not in planned:
            problem = MutatorError(
                f"a record of {ending.experiment_id}, which is not planned for this run",
                where=segment.path,
                line=number,
                expected=f"experiments of {plan_file.EXPERIMENTS} that belong to this shard",
                remedy=_remedy(segment.path.parent.parent, ""),
            )
            yield number, problem, "", 0
        elif ending.counts:
            yield number, ending.experiment_id, ending.patch, hash(segment.body_of(line))


def patch_problems(
    patches: Patches, experiment_id: str, known: str, worker: str = ""
) -> Iterator[MutatorError]:
    """Yield a problem if a stored patch does not have the record's digest `known` (empty: no mutant)."""
    if not known:
        return
    data = patches.read(experiment_id)
    found = "" if data is None else digest(data)
    if found != known:
        yield MutatorError(
            f"the patch of {experiment_id} is not the one that was run: SHA-256 {found[:16]}"
            if found
            else f"no patch of {experiment_id}",
            where=patches.file(experiment_id, worker),
            expected=f"SHA-256 {known[:16]}, as in the record",
            remedy=_remedy(patches.run, ""),
        )
