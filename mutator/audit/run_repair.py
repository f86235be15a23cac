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

from mutator._common.bounded_reading import MOST_EXPERIMENT_DATA_BYTES, check_file_size, read_bounded
from mutator._common.confined_files import (
    move_below,
    open_below,
    path_below,
    unlink_below,
    write_below,
    writing_below,
)
from mutator._common.files import raising_disk_full
from mutator._common.folder_locks import lock_run_folder
from mutator._common.message_text import counted
from mutator.audit.record_audit import load_stored_records
from mutator.audit.series_repair import repair_series
from mutator.campaigns.plan import load_plan
from mutator.campaigns.plan_freezing import PLAN_CSV, plan_csv_bytes
from mutator.campaigns.plan_growth import APPENDED_FILES
from mutator.errors import MutatorError, TooLarge, UnsafePath
from mutator.model import Status
from mutator.store import file_digests, integrity
from mutator.store.allowed_contents import DAMAGED_FOLDER
from mutator.store.appended_files import undo_unfinished_growth
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.checksummed_lines import Segment, line_file_bytes, read_segment
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.packed_patches import rewrite_patch_file
from mutator.store.records import LINE_SCHEMA_BY_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

_FileChange = tuple[str, bytes | None, str]  # file, new content (None: removed), sentence about the change


def repair_run(folder: RunFolder, workspace: Workspace | None = None) -> list[str]:
    """Move damaged files, lines, patches and series to `damaged/`; return a sentence for each action.

    With a `workspace`, golden series are rebuilt. Raises MutatorError if a command is using the folder
    or the plan is damaged.
    """
    with lock_run_folder(folder.path, patience_s=0.0), raising_disk_full(folder.path):
        renewed = [*_renew_damaged_ledger(folder), *_undo_unfinished_batch(folder)]
        ledger = file_digests.settled_ledger(folder.path)
        lost_patches = _experiments_with_lost_patch(folder)
        changes = [*_file_changes(folder, ledger), *_segment_changes(folder, ledger, lost_patches)]
        for name, *_ in changes:
            _set_aside(folder.path, name)
        blocks = _drop_patches(folder, lost_patches)
        if changes or renewed:
            _apply_changes(folder.path, changes, ledger)
        put_aside = partial(_set_aside, folder.path)
        series = [*repair_series(folder, workspace, put_aside)]
    patches = [*blocks, *(f"patch of {experiment_id} set aside" for experiment_id in lost_patches)]
    return [*renewed, *(sentence for *_, sentence in changes), *patches, *series]


def _renew_damaged_ledger(folder: RunFolder) -> Iterator[str]:
    """If the ledger itself is damaged, write a new one from the current files."""
    run = folder.path
    try:
        file_digests.load_ledger(run)
    except UnsafePath:
        raise  # somebody wrote this on purpose
    except MutatorError:
        plan_and_golden_paths = (path for name in ("plan", "golden") for path in (run / name).rglob("*"))
        names = [
            *integrity.DIGESTED_TOP_FILES,
            *(path.relative_to(run).as_posix() for path in plan_and_golden_paths),
        ]
        digests = file_digests.digests_of_files(
            run, [name for name in names if file_digests.can_be_in_ledger(name)]
        )
        _set_aside(run, file_digests.DIGESTS_FILE)
        file_digests.save_ledger(
            run,
            DigestLedger(files={name: file_digest for name, file_digest in digests.items() if file_digest}),
        )
        name = file_digests.DIGESTS_FILE
        yield f"{name} rebuilt from the current files: only an earlier seal can confirm them"


def _undo_unfinished_batch(folder: RunFolder) -> Iterator[str]:
    """Cut off what a killed command added to the plan of a bench."""
    for name in undo_unfinished_growth(folder.path, APPENDED_FILES):
        yield f"{name}: lines of a batch that was not planned completely cut off"


def _file_changes(folder: RunFolder, ledger: DigestLedger) -> Iterator[_FileChange]:
    """Damaged files, rebuilt or set aside, and files that do not belong in the folder."""
    run = folder.path
    for name, file_digest in ledger.files.items():
        if (
            file_digest.lines is not None
            or name in integrity.IRREPLACEABLE_FILES
            or file_digest.has_same_bytes(FileDigest.of_file_below(run, name))
        ):
            continue
        if name == PLAN_CSV and file_digest.has_same_bytes(
            FileDigest.of_bytes(data := plan_csv_bytes(load_plan(folder)))
        ):
            yield name, data, f"{name} rebuilt from the plan"
        else:
            yield name, None, f"{name} set aside: `mutator run` rebuilds it"
    if ledger.finished:
        for path in integrity.unexpected_files(run, ledger):
            name = path.relative_to(run).as_posix()
            yield name, None, f"{name} set aside: the finished run had no such file"


def _experiments_with_lost_patch(folder: RunFolder) -> list[str]:
    """Planned experiments whose stored patch does not match their record."""
    lost, planned = [], folder.planned_positions()
    for stored in load_stored_records(folder, "records"):
        if stored.record.experiment_id not in planned:
            continue
        try:
            folder.read_patch(stored.record.experiment_id, stored.record)
        except MutatorError:
            lost.append(stored.record.experiment_id)
    return lost


def _drop_patches(folder: RunFolder, lost: Collection[str]) -> list[str]:
    """Set aside the files of these patches, and files with damaged blocks; return a sentence for each
    file with damaged blocks. Other patches in these files are kept.
    """
    run, patches, sentences = folder.path, folder.patches, []
    for path in patches.block_files():
        name = path.relative_to(run).as_posix()
        if not path.is_file():
            _set_aside(run, name)
            continue
        block_file = read_blocks(path)
        names = dict.fromkeys(block.key for block in block_file.blocks)
        if not block_file.is_damaged and not names.keys() & set(lost):
            continue
        _set_aside(run, name)
        if block_file.is_damaged:
            sentences.append(f"{name}: damaged blocks set aside")
        intact = (
            (experiment_id, patches.read_patch(experiment_id))
            for experiment_id in names
            if experiment_id not in lost
        )
        rewrite_patch_file(
            path, [(name_of_experiment, data) for name_of_experiment, data in intact if data is not None]
        )
    return sentences


def _segment_changes(folder: RunFolder, ledger: DigestLedger, lost: Collection[str]) -> Iterator[_FileChange]:
    """Segments with invalid lines, and their remaining content."""
    run, planned = folder.path, folder.planned_positions()
    unexpected = set(integrity.unexpected_files(run, ledger)) if ledger.finished else set()
    for kind, schema in LINE_SCHEMA_BY_FOLDER.items():
        finals: set[str] = set()
        for path in sorted({*(run / kind).glob("*.jsonl")} - unexpected):
            name = path.relative_to(run).as_posix()
            if not path.is_file():
                yield name, None, f"{name} set aside: it is not a file"
                continue
            data = read_bounded(path, MOST_EXPERIMENT_DATA_BYTES)
            segment, file_digest = read_segment(path, data), ledger.files.get(name)
            dropped = lost if kind == "records" else ()
            remaining = list(
                _remaining_lines(_trusted_lines(segment, file_digest, data), planned, dropped, finals)
            )
            dropped_count = max(0, data.count(b"\n") - 1 - len(remaining))
            if (
                dropped_count
                or segment.damaged_line_numbers
                or not _is_intact_in_place(segment, schema, file_digest, data)
            ):
                head = {"schema": schema, "plan": folder.head.plan_of_lines}
                sentence = f"{name}: {counted(dropped_count, 'line')} set aside, {len(remaining)} kept"
                yield name, line_file_bytes(path, head, remaining), sentence
    for name, file_digest in ledger.files.items():
        if file_digest.lines is not None and not os.path.lexists(path_below(run, name)):
            yield name, None, f"{name} is gone"


def _is_intact_in_place(segment: Segment, schema: str, file_digest: FileDigest | None, data: bytes) -> bool:
    try:
        segment.check_head(schema)
    except MutatorError:
        return False
    return file_digest is None or file_digest.has_same_bytes(FileDigest.of_bytes(data))


def _trusted_lines(segment: Segment, file_digest: FileDigest | None, data: bytes) -> list[dict[str, Any]]:
    """Return the content of the trustworthy lines after the head.

    If all checksums match although the file's digest changed, somebody recomputed the checksums. Lines are
    then trusted only if the file was merely extended, and only up to the old length.
    """
    numbers = list(segment.lines)
    is_trusted = (
        segment.damaged_line_numbers
        or file_digest is None
        or file_digest.has_same_bytes(FileDigest.of_bytes(data))
    )
    if (
        not is_trusted
        and file_digest is not None
        and file_digest.lines is not None
        and len(numbers) >= file_digest.lines
    ):
        numbers = numbers[: file_digest.lines]
        old_bytes = b"".join(segment.lines[number] + b"\n" for number in numbers)
        numbers = numbers if file_digest.has_same_bytes(FileDigest.of_bytes(old_bytes)) else []
    return [segment.parse_line(number) for number in numbers if number > 1]


def _remaining_lines(
    lines: list[dict[str, Any]], planned: Collection[str], lost: Collection[str], finals: set[str]
) -> Iterator[dict[str, Any]]:
    """Yield lines of planned experiments that are not lost, with one final record each.

    `finals` has the experiments with a final record in earlier lines.
    """
    for line in lines:
        name = str(line.get("experiment_id"))
        is_final = line.get("status") not in (None, Status.HARNESS_ERROR.value)
        if name in planned and name not in lost and not (is_final and name in finals):
            yield line
            if is_final:
                finals.add(name)


def _set_aside(run: Path, name: str) -> None:
    """Copy a file to a free name in `damaged/`; move a folder, and a file too large to copy."""
    path = path_below(run, name)
    if not os.path.lexists(path):
        return
    free_name, number = f"{DAMAGED_FOLDER}/{name}", 1
    while os.path.lexists(path_below(run, free_name)):
        number += 1
        free_name = f"{DAMAGED_FOLDER}/{name}.{number}"
    if path.is_dir():
        move_below(run, name, free_name)
        return
    try:
        with open_below(run, name) as file:
            check_file_size(file, path)
            with writing_below(run, free_name) as copy:
                shutil.copyfileobj(file, copy)
    except TooLarge:
        move_below(run, name, free_name)


def _apply_changes(run: Path, changes: list[_FileChange], ledger: DigestLedger) -> None:
    """Apply the changes. The run is then no longer finished, unless only plan.csv was rebuilt."""
    new_digests = {
        name: None
        if data is None
        else FileDigest.of_bytes(data, data.count(b"\n") if name.endswith(".jsonl") else None)
        for name, data, _ in changes
        if not name.startswith("timings/")
    }
    finished = ledger.finished and {*new_digests} <= {PLAN_CSV}
    with file_digests.announcing_rewrites(run, new_digests, finished=finished):
        for name, data, _ in changes:
            if data is None:
                unlink_below(run, name)
            else:
                write_below(run, name, data)
    file_digests.add_segments_to_ledger(run)
