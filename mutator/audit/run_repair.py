"""Set aside damaged parts of a run folder, so that `mutator run` can fill the gaps.

Intact lines of a segment are kept. Files that only a copy of the folder can replace (run.json, campaign.yaml,
the plan) are not touched.
"""

import os
import shutil
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import MOST_DATA_BYTES, check_file_size, read_bounded
from mutator._common.confined_files import (
    move_below,
    open_below,
    path_below,
    unlink_below,
    write_below,
    writing_below,
)
from mutator._common.files import raising_disk_full
from mutator._common.folder_locks import owning_run_folder
from mutator._common.message_text import counted
from mutator.audit.record_audit import recorded
from mutator.audit.series_repair import repair_series
from mutator.campaigns.freezing import CSV, plan_csv
from mutator.campaigns.plan import load_plan
from mutator.errors import MutatorError, Outside, TooLarge
from mutator.model import Status
from mutator.store import file_digests, integrity
from mutator.store.allowed_contents import DAMAGED_FOLDER
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.checksummed_lines import Segment, line_file_bytes, read_segment
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.patch_files import rewrite_patch_file
from mutator.store.records import LINE_SCHEMA_BY_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

_Change = tuple[str, bytes | None, str]  # file, new content (None: removed), sentence about the change


def repair(folder: RunFolder, workspace: Workspace | None = None) -> list[str]:
    """Move damaged files, lines, patches and series to `damaged/`; return a sentence for each action.

    With a `workspace`, golden series are rebuilt. Raises MutatorError if a command is using the folder
    or the plan is damaged.
    """
    with owning_run_folder(folder.path, patience_s=0.0), raising_disk_full(folder.path):
        renewed = list(_renewed_ledger(folder))
        ledger = file_digests.settled_ledger(folder.path)
        lost = _lost_patches(folder)
        changes = [*_files(folder, ledger), *_segments(folder, ledger, lost)]
        for name, *_ in changes:
            _put_aside(folder.path, name)
        blocks = _drop_patches(folder, lost)
        if changes or renewed:
            _carry_out(folder.path, changes, ledger)
        put_aside = partial(_put_aside, folder.path)
        series = [*repair_series(folder, workspace, put_aside)]
    patches = [*blocks, *(f"patch of {one} set aside" for one in lost)]
    return [*renewed, *(said for *_, said in changes), *patches, *series]


def _renewed_ledger(folder: RunFolder) -> Iterator[str]:
    """If the ledger itself is damaged, write a new one from the current files."""
    run = folder.path
    try:
        file_digests.load_ledger(run)
    except Outside:
        raise  # somebody wrote this on purpose
    except MutatorError:
        below = (path for name in ("plan", "golden") for path in (run / name).rglob("*"))
        names = [*integrity.TOP_FILES, *(path.relative_to(run).as_posix() for path in below)]
        found = file_digests.digests_of_files(
            run, [name for name in names if file_digests.is_ledger_name(name)]
        )
        _put_aside(run, file_digests.FILE)
        file_digests.save_ledger(run, DigestLedger(files={name: one for name, one in found.items() if one}))
        yield f"{file_digests.FILE} rebuilt from the current files: only an earlier seal can confirm them"


def _files(folder: RunFolder, ledger: DigestLedger) -> Iterator[_Change]:
    """Damaged files, rebuilt or set aside, and files that do not belong in the folder."""
    run = folder.path
    for name, known in ledger.files.items():
        if (
            known.lines is not None
            or name in integrity.IRREPLACEABLE_FILES
            or known.has_same_bytes(FileDigest.of_file_below(run, name))
        ):
            continue
        if name == CSV and known.has_same_bytes(FileDigest.of_bytes(data := plan_csv(load_plan(folder)))):
            yield name, data, f"{name} rebuilt from the plan"
        else:
            yield name, None, f"{name} set aside: `mutator run` rebuilds it"
    if ledger.finished:
        for path in integrity.unexpected_files(run, ledger):
            name = path.relative_to(run).as_posix()
            yield name, None, f"{name} set aside: the finished run had no such file"


def _lost_patches(folder: RunFolder) -> list[str]:
    """Planned experiments whose stored patch does not match their record."""
    lost, planned = [], folder.planned_positions()
    for one in recorded(folder, "records"):
        if one.record.experiment_id not in planned:
            continue
        try:
            folder.read_patch(one.record.experiment_id, one.record)
        except MutatorError:
            lost.append(one.record.experiment_id)
    return lost


def _drop_patches(folder: RunFolder, lost: Collection[str]) -> list[str]:
    """Set aside the files of these patches, and files with damaged blocks; return a sentence for each
    file with damaged blocks. Other patches in these files are kept.
    """
    run, patches, said = folder.path, folder.patches, []
    for path in patches.block_files():
        name = path.relative_to(run).as_posix()
        if not path.is_file():
            _put_aside(run, name)
            continue
        found = read_blocks(path)
        names = dict.fromkeys(block.key for block in found.blocks)
        if not found.is_damaged and not names.keys() & set(lost):
            continue
        _put_aside(run, name)
        if found.is_damaged:
            said.append(f"{name}: damaged blocks set aside")
        kept = ((one, patches.read(one)) for one in names if one not in lost)
        rewrite_patch_file(path, [(one, data) for one, data in kept if data is not None])
    return said


def _segments(folder: RunFolder, ledger: DigestLedger, lost: Collection[str]) -> Iterator[_Change]:
    """Segments with invalid lines, and their remaining content."""
    run, planned = folder.path, folder.planned_positions()
    strangers = set(integrity.unexpected_files(run, ledger)) if ledger.finished else set()
    for kind, schema in LINE_SCHEMA_BY_FOLDER.items():
        done: set[str] = set()
        for path in sorted({*(run / kind).glob("*.jsonl")} - strangers):
            name = path.relative_to(run).as_posix()
            if not path.is_file():
                yield name, None, f"{name} set aside: it is not a file"
                continue
            data = read_bounded(path, MOST_DATA_BYTES)
            segment, known = read_segment(path, data), ledger.files.get(name)
            dropped = lost if kind == "records" else ()
            kept = list(_kept(_trusted(segment, known, data), planned, dropped, done))
            gone = max(0, data.count(b"\n") - 1 - len(kept))
            if gone or segment.damaged_lines or not _in_place(segment, schema, known, data):
                head = {"schema": schema, "plan": folder.head.plan}
                said = f"{name}: {counted(gone, 'line')} set aside, {len(kept)} kept"
                yield name, line_file_bytes(path, head, kept), said
    for name, known in ledger.files.items():
        if known.lines is not None and not os.path.lexists(path_below(run, name)):
            yield name, None, f"{name} is gone"


def _in_place(segment: Segment, schema: str, known: FileDigest | None, data: bytes) -> bool:
    try:
        segment.check_head(schema)
    except MutatorError:
        return False
    return known is None or known.has_same_bytes(FileDigest.of_bytes(data))


def _trusted(segment: Segment, known: FileDigest | None, data: bytes) -> list[dict[str, Any]]:
    """Return the content of the trustworthy lines after the head.

    If all checksums match although the file's digest changed, somebody recomputed the checksums. Lines are
    then trusted only if the file was merely extended, and only up to the old length.
    """
    numbers = list(segment.lines)
    whole = segment.damaged_lines or known is None or known.has_same_bytes(FileDigest.of_bytes(data))
    if not whole and known is not None and known.lines is not None and len(numbers) >= known.lines:
        numbers = numbers[: known.lines]
        first = b"".join(segment.lines[number] + b"\n" for number in numbers)
        numbers = numbers if known.has_same_bytes(FileDigest.of_bytes(first)) else []
    return [segment.content(number) for number in numbers if number > 1]


def _kept(
    lines: list[dict[str, Any]], planned: Collection[str], lost: Collection[str], done: set[str]
) -> Iterator[dict[str, Any]]:
    """Yield lines of planned experiments that are not lost, with one final record each.

    `done` has the experiments with a final record in earlier lines.
    """
    for line in lines:
        name = str(line.get("experiment_id"))
        final = line.get("status") not in (None, Status.HARNESS_ERROR.value)
        if name in planned and name not in lost and not (final and name in done):
            yield line
            if final:
                done.add(name)


def _put_aside(run: Path, name: str) -> None:
    """Copy a file to a free name in `damaged/`; move a folder, and a file too large to copy."""
    path = path_below(run, name)
    if not os.path.lexists(path):
        return
    place, number = f"{DAMAGED_FOLDER}/{name}", 1
    while os.path.lexists(path_below(run, place)):
        number += 1
        place = f"{DAMAGED_FOLDER}/{name}.{number}"
    if path.is_dir():
        move_below(run, name, place)
        return
    try:
        with open_below(run, name) as file:
            check_file_size(file, path)
            with writing_below(run, place) as copy:
                shutil.copyfileobj(file, copy)
    except TooLarge:
        move_below(run, name, place)


def _carry_out(run: Path, changes: list[_Change], ledger: DigestLedger) -> None:
    """Apply the changes. The run is then no longer finished, unless only plan.csv was rebuilt."""
    coming = {
        name: None
        if data is None
        else FileDigest.of_bytes(data, data.count(b"\n") if name.endswith(".jsonl") else None)
        for name, data, _ in changes
        if not name.startswith("timings/")
    }
    finished = ledger.finished and {*coming} <= {CSV}
    with file_digests.rewriting_files(run, coming, finished=finished):
        for name, data, _ in changes:
            if data is None:
                unlink_below(run, name)
            else:
                write_below(run, name, data)
    file_digests.close_segments(run)
