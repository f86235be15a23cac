"""Merge the run folders of all shards of a plan into the folder that a single run would have made."""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from mutator._common.confined_files import open_below, path_below
from mutator._common.files import json_bytes, raising_disk_full, read_json, write_atomic, writing_atomic
from mutator._common.folder_locks import lock_run_folder
from mutator._common.message_text import counted
from mutator.audit.run_digests_and_seal import UNSEALED_KEYS_BY_FILE, without_keys
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.defended_runs import defended_run_path
from mutator.campaigns.plan_freezing import make_run_folder
from mutator.campaigns.run_provenance import version_error
from mutator.errors import CheckFailed, MutatorError
from mutator.preflight import equivalence_check
from mutator.results import table_building
from mutator.results.table_reader import frame_of_experiments
from mutator.results.worst_first_ranking import worst_first_rank_by_ok_experiment
from mutator.store import file_digests, integrity, plan_file, run_deletion
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checks_file import CHECKS_SCHEMA, measured_limits_as_json
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.packed_patches import PatchWriter
from mutator.store.plain_contents_check import check_plain_contents
from mutator.store.preflight_results import check_verdicts_are_final
from mutator.store.recorded_approvals import APPROVALS_FILE as REVIEWED
from mutator.store.records import endings_of
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.store.run_writer import copy_line_files
from mutator.store.series_packing import pack_series
from mutator.store.session_environments import SessionEnvironment, version_differences
from mutator.store.time_series_folder import SERIES_FOLDER as SERIES

_UNFINISHED_MARK = f".{HEAD}."  # followed by a process id: marks an unfinished merge
_SHARDS_REMEDY = "give the folder of each shard of one plan exactly once"


def merge_shards(shards: Sequence[Path], out: Path, *, accept_versions: bool = False) -> Path:
    """Merge the run folders `shards`, and those of their sets of defences, into the new or empty folder
    `out`; return the path of its results.csv.

    Raises MutatorError for a shard that is missing, duplicate, unfinished, in use, or of another plan; unless
    `accept_versions`, also for one that ran with different versions. Raises CheckFailed if a proof failed, or
    if golden runs differ, because the machines then compute different results.
    """
    if RunFolder.exists(out):
        raise MutatorError(
            "holds a run",
            where=out,
            argument="out",
            expected="a new folder",
            remedy="choose another `out`",
        )
    if not shards:
        raise MutatorError("no run folder", argument="shards", remedy=_SHARDS_REMEDY)
    folders = [_open_shard(path) for path in shards]
    sets = load_campaign_of_run(folders[0]).defence_sets
    folders_by_set = {
        names: [_open_shard(defended_run_path(shard.path, names)) for shard in folders] for names in sets
    }
    for same_plan in (folders, *folders_by_set.values()):
        _check_same_plan(same_plan)
        _check_shard_numbers(same_plan)
        for folder in same_plan:
            _check_shard_finished(folder)
    results = _merge(folders, out, accept_versions=accept_versions)
    for names, defended in folders_by_set.items():
        _merge(defended, defended_run_path(out, names), accept_versions=accept_versions)
    return results


def _merge(folders: Sequence[RunFolder], out: Path, *, accept_versions: bool) -> Path:
    with ExitStack() as stack:
        for folder in folders:
            stack.enter_context(lock_run_folder(folder.path, patience_s=0.0))
            _check_shard_finished(folder)
        stretches = list(_merged_stretches(folders, accept_versions=accept_versions))
        _check_same_goldens(folders)
        _make_empty_folder(out)
        stack.enter_context(lock_run_folder(out))
        try:
            with raising_disk_full(out):
                path_below(out, f"{_UNFINISHED_MARK}{os.getpid()}").touch()
                _copy_shards(folders, out, stretches)
            return table_building.build_tables(out)
        except BaseException:
            run_deletion.delete_unfinished_run(out)
            raise


def _make_empty_folder(out: Path) -> None:
    """Make the folder to merge into. Delete files that a killed merge left there."""
    if out.is_dir():
        check_plain_contents(out.resolve())
    if any(out.glob(f"{_UNFINISHED_MARK}*")):
        with lock_run_folder(out, patience_s=0.0):
            run_deletion.delete_unfinished_run(out)
    make_run_folder(out)


def _open_shard(path: Path) -> RunFolder:
    return RunFolder.open(path)


def _check_same_plan(folders: Sequence[RunFolder]) -> None:
    first = folders[0]
    for folder in folders[1:]:
        for key, _, _ in folder.head.differences(first.head):
            if key in ("plan", "sources"):
                raise MutatorError(
                    f"made from a different {key.rstrip('s')} than {first.path}",
                    where=folder.path,
                    expected="shards of one plan, with the same target, templates and scenarios",
                    remedy=_SHARDS_REMEDY,
                )
        first_content, content = (
            without_keys(shard.head.as_json(), UNSEALED_KEYS_BY_FILE[HEAD]) for shard in (first, folder)
        )
        if differ := [
            key for key in {**first_content, **content} if first_content.get(key) != content.get(key)
        ]:
            raise MutatorError(
                f"'{differ[0]}' differs from {first.path / HEAD}",
                where=folder.path / HEAD,
                expected="shards that were planned with the same library and the same version of mutator",
                remedy=_SHARDS_REMEDY,
            )


def _check_shard_numbers(folders: Sequence[RunFolder]) -> None:
    folders_by_number: dict[int, RunFolder] = {}
    shard_count: int | None = None
    for folder in folders:
        shard = folder.shard
        if shard is None:
            raise MutatorError(
                "a whole run, not a shard",
                where=folder.path,
                expected="the run of a shard",
                remedy=_SHARDS_REMEDY,
            )
        shard_count = shard_count or shard.shard_count
        if shard.shard_count != shard_count:
            raise MutatorError(
                f"shard {shard.number}/{shard.shard_count}",
                where=folder.path,
                expected=f"one of {shard_count} shards, like {folders[0].path}",
                remedy=_SHARDS_REMEDY,
            )
        if shard.number in folders_by_number:
            raise MutatorError(
                f"shard {shard.number}/{shard_count} is given twice",
                where=folder.path,
                expected=f"a different shard from {folders_by_number[shard.number].path}",
                remedy=_SHARDS_REMEDY,
            )
        folders_by_number[shard.number] = folder
    missing = [f"{k}/{shard_count}" for k in range(1, (shard_count or 0) + 1) if k not in folders_by_number]
    if missing:
        raise MutatorError(
            f"no folder for shard {', '.join(missing)}", expected="all shards", remedy=_SHARDS_REMEDY
        )


def _check_shard_finished(folder: RunFolder) -> None:
    check_verdicts_are_final(folder)
    records = folder.records()
    finished_count = sum(ending.is_final for ending in endings_of(records))
    if finished_count < folder.planned_experiment_count:
        raise MutatorError(
            f"unfinished: {finished_count} of {folder.planned_experiment_count} experiments are done",
            where=folder.path,
            expected="a finished shard",
            remedy="resume it with the command that started it",
        )
    equivalence_check.compare_sample(folder, records)
    if remaining_count := len(equivalence_check.remaining_sampled_experiments(folder)):
        raise MutatorError(
            f"unfinished: its proof has {counted(remaining_count, 'experiment')} left to run",
            where=folder.path,
            expected="a finished shard",
            remedy="resume it with the command that started it",
        )


def _check_same_goldens(folders: Sequence[RunFolder]) -> None:
    first = read_json(folders[0].path / CHECKS, CHECKS_SCHEMA)["goldens"]
    for folder in folders[1:]:
        goldens = read_json(folder.path / CHECKS, CHECKS_SCHEMA)["goldens"]
        if differ := [name for name in first if goldens.get(name) != first[name]]:
            raise CheckFailed(
                f"the golden run {differ[0]} differs from the one in {folders[0].path}",
                where=folder.path,
                expected="machines on which the target computes the same bytes",
                remedy="run this shard again on such a machine (run.json lists the machines)",
            )


def _merged_stretches(folders: Sequence[RunFolder], *, accept_versions: bool) -> Iterator[SessionEnvironment]:
    """Yield all stretches. Unless `accept_versions`, all must have the versions of the first shard."""
    first = folders[0]
    for folder in folders:
        ends = zip(first.session_environments[-1:], folder.session_environments[-1:], strict=False)
        differing_versions = [
            text
            for first_stretch, stretch in ends
            for text in version_differences(first_stretch, stretch.python, stretch.packages)
        ]
        if differing_versions and not accept_versions:
            raise version_error(folder.path, f"unlike {first.path}, this shard used", differing_versions)
        assert folder.shard is not None
        for i, stretch in enumerate(folder.session_environments):
            yield replace(
                stretch,
                records=f"{stretch.records}-shard{folder.shard.number}",
                accepted=(*stretch.accepted, *(() if i else differing_versions)),
            )


def _copy_shards(folders: Sequence[RunFolder], out: Path, stretches: Sequence[SessionEnvironment]) -> None:
    """Copy all content. The head is written last, so that an unfinished copy is not a run folder."""
    first = folders[0]
    ledger = file_digests.settled_ledger(first.path)
    reviewed = all((folder.path / REVIEWED).exists() for folder in folders)
    files = {
        name: file_digest
        for name, file_digest in ledger.files.items()
        if file_digest.lines is None and name not in (HEAD, CHECKS) and (reviewed or name != REVIEWED)
    }
    for name in files:
        place = path_below(out, name)
        place.parent.mkdir(parents=True, exist_ok=True)
        with open_below(first.path, name) as source, writing_atomic(place) as copy:
            shutil.copyfileobj(source, copy)
    checks = _merged_checks(folders)
    write_atomic(out / CHECKS, checks)
    files[CHECKS] = FileDigest.of_bytes(checks)
    for folder in folders:
        _copy_patches(folder, out)
        assert folder.shard is not None
        copy_line_files(folder, out, f"-shard{folder.shard.number}")
    _pack_series(folders, out)
    choices = replace(first.head.choices, shard=None)
    head = replace(first.head, choices=choices, stretches=tuple(stretches)).file_bytes()
    file_digests.save_ledger(out, DigestLedger(files=files | {HEAD: FileDigest.of_bytes(head)}))
    file_digests.add_segments_to_ledger(out, finished=True)
    write_atomic(out / HEAD, head)


def _merged_checks(folders: Sequence[RunFolder]) -> bytes:
    """Return the first shard's checks, with the longest limits that any shard measured: a run that finished
    in its shard must also finish when it is repeated.
    """
    first, limits = folders[0], [folder.limits for folder in folders]
    longest = replace(
        limits[0], cpu_s=max(each.cpu_s for each in limits), wall_s=max(each.wall_s for each in limits)
    )
    return json_bytes({**read_json(first.path / CHECKS, CHECKS_SCHEMA), **measured_limits_as_json(longest)})


def _copy_patches(folder: RunFolder, out: Path) -> None:
    assert folder.shard is not None
    writer = PatchWriter(out, f"0001-shard{folder.shard.number}")
    for record in endings_of(folder.records()):
        name, patch_digest = record.experiment_id, record.patch_digest
        for problem in integrity.patch_problems(folder.patches, name, patch_digest):
            raise problem
        if patch_digest and (data := folder.patches.read_patch(name)) is not None:
            writer.append(name, data)
    writer.close()


def _pack_series(folders: Sequence[RunFolder], out: Path) -> None:
    """Pack the series of all shards before the head is written, because nothing packs them later."""
    shards = tuple(folder.path for folder in folders)
    if any((shard / SERIES).is_dir() for shard in shards):
        import pandas as pd

        first = folders[0]
        frames = [
            frame_of_experiments(folder, plan_file.iterate_experiments(folder.path)) for folder in folders
        ]
        ranks = worst_first_rank_by_ok_experiment(pd.concat(frames, ignore_index=True))
        pack_series(out, first.head.plan, ranks, first.series_budget_mb, other_runs=shards)
