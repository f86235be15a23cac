"""Audit series: check that their files are unchanged. No result depends on them."""

from collections.abc import Iterator, Set

import numpy as np

from mutator._common.confined_files import path_below
from mutator.errors import MutatorError
from mutator.outcomes.hazard_and_metric_judgement import load_manifest_channels
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.store import plan_file
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.golden_files import GOLDEN_FOLDER, golden_output_folder
from mutator.store.run_folder import RunFolder
from mutator.store.series_format import Series, decode_series
from mutator.store.series_packing import list_unpacked_worker_files
from mutator.store.series_record_check import check_deviations
from mutator.store.time_series_folder import (
    INDEX_NAME,
    SeriesIndex,
    TimeSeriesFolder,
    check_same_run,
    load_rerun_series,
    repair_remedy,
    rerun_command,
)
from mutator.targets.manifest import TargetManifest

_RELATIVE_ROUNDING = 1e-5  # relative; values have six digits


def audit_series(
    folder: RunFolder, manifest: TargetManifest | None = None
) -> tuple[int, Iterator[MutatorError]]:
    """Return the number of series files, and their problems: damaged files, missing files that others need,
    series of other runs than the records, and, with a `manifest`, series that differ from the golden runs.
    """
    series_folder = TimeSeriesFolder(folder.path)
    return sum(path.is_file() for path in series_folder.path.rglob("*")), _series_problems(
        folder, series_folder, manifest
    )


def _series_problems(
    folder: RunFolder, series_folder: TimeSeriesFolder, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    run = folder.path
    yield from _packed_series_problems(folder, series_folder, manifest)
    yield from _kept_series_problems(folder, series_folder, manifest)
    for path in list_unpacked_worker_files(run):
        if read_blocks(path).is_damaged:
            yield MutatorError(
                "damaged blocks",
                where=path,
                expected="series as a worker appended them",
                remedy=repair_remedy(run),
            )


def _kept_series_problems(
    folder: RunFolder, series_folder: TimeSeriesFolder, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    names, records = series_folder.rerun_ids(), folder.records()
    planned = (
        {experiment.id: experiment for experiment in plan_file.load_experiments(folder.path)}
        if names and manifest
        else {}
    )
    for name in names:
        path = series_folder.rerun_series_path(name)
        try:
            golden, faulty = load_rerun_series(path)
            if (record := records.get(name)) is not None:
                check_same_run(faulty.facts, record, path)
                check_deviations(golden, faulty, record, path)
            if name in planned and (run := folder.golden_folder_of(planned[name])).is_dir():
                assert manifest is not None
                if not _is_same_series(
                    golden, SeriesSampler(manifest, load_manifest_channels(manifest, run)).golden
                ):
                    raise MutatorError(
                        "differs",
                        where=path,
                        expected=f"the series of golden/{folder.golden_run_of(planned[name]).key}",
                    )
        except MutatorError as err:
            yield _error_with_remedy(err, err.got, f"{rerun_command(folder.path, name)} rebuilds it")


def _packed_series_problems(
    folder: RunFolder, series_folder: TimeSeriesFolder, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    run, path = folder.path, series_folder.path / f"{INDEX_NAME}.js"
    try:
        index = series_folder.index
    except MutatorError as err:
        yield err
        return
    if index is None:
        # if segments are left, the run was killed before it wrote the index
        if any(series_folder.path.glob("*.js")) and not list_unpacked_worker_files(run):
            what = "the index of the chunks beside it"
            yield MutatorError("missing", where=path, expected=what, remedy=repair_remedy(run))
        return
    if index.plan != (plan := folder.head.plan_of_lines):
        got, expected = f"series of plan {index.plan[:16]}", plan[:16]
        yield MutatorError(got, where=path, expected=expected, remedy=repair_remedy(run))
        return
    damaged = set()
    for name, _ in index.chunk_entry_counts:
        try:
            series_folder.read_chunk(name)
        except MutatorError as err:
            damaged.add(name)
            ids = [
                experiment_id
                for experiment_id in _experiments_using(index, name)
                if not series_folder.rerun_series_path(experiment_id).is_file()
            ]
            more = f" and {len(ids) - 1} more" if len(ids) > 1 else ""
            got = f"{err.got}; the series of {ids[0]}{more} cannot be read" if ids else err.got
            yield _error_with_remedy(err, got, repair_remedy(run))

    yield from _other_run_problems(folder, series_folder, index, damaged)
    yield from _other_golden_problems(folder, series_folder, index, manifest)


def _other_run_problems(
    folder: RunFolder, series_folder: TimeSeriesFolder, index: SeriesIndex, damaged: Set[str]
) -> Iterator[MutatorError]:
    """Series that do not belong to the records. Those in `damaged` chunks are reported with their chunk."""
    records = folder.records()
    for name, number in index.entry_number_by_experiment.items():
        if (record := records.get(name)) is None:  # lost; its series is not shown until it runs again
            continue
        chunk, golden_chunk = (
            index.entry_places[entry][0]
            for entry in (number, index.entry_number_by_golden[index.golden_by_experiment[name]])
        )
        if damaged & {chunk, golden_chunk}:
            continue
        path = path_below(series_folder.path, f"{chunk}.js")
        try:
            golden, faulty = series_folder.load_packed_series(index, name)
            check_same_run(faulty.facts, record)
            check_deviations(golden, faulty, record)
        except MutatorError as err:
            remedy = repair_remedy(folder.path)
            yield MutatorError(f"{name}: {err.got}", where=path, expected=err.expected, remedy=remedy)


def _other_golden_problems(
    folder: RunFolder, series_folder: TimeSeriesFolder, index: SeriesIndex, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    for key, number in index.entry_number_by_golden.items() if manifest else ():
        assert manifest is not None
        path = path_below(series_folder.path, f"{index.entry_places[number][0]}.js")
        try:
            stored = decode_series(series_folder.read_entry(number))
            golden = SeriesSampler(
                manifest,
                load_manifest_channels(manifest, golden_output_folder(folder.path / GOLDEN_FOLDER, key)),
            ).golden
        except MutatorError:  # reported elsewhere
            continue
        if not _is_same_series(stored, golden):
            expected = f"the series of golden/{key}"
            yield MutatorError("differs", where=path, expected=expected, remedy=repair_remedy(folder.path))


def _is_same_series(stored: Series, golden: Series) -> bool:
    """Whether two series have the same channels, times and values, up to the rounding of older versions."""
    channels, golden_channels = (
        [(channel["name"], channel.get("own_times")) for channel in series.facts["channels"]]
        for series in (stored, golden)
    )
    if (
        channels != golden_channels
        or stored.t.tobytes() != golden.t.tobytes()
        or stored.sample_every != golden.sample_every
    ):
        return False
    rows = zip(stored.channel_values, golden.channel_values, strict=True)
    return all(
        np.allclose(stored_row, golden_row, rtol=_RELATIVE_ROUNDING, equal_nan=True)
        for stored_row, golden_row in rows
    )


def _error_with_remedy(err: MutatorError, got: str, remedy: str) -> MutatorError:
    return MutatorError(got, where=err.where, expected=err.expected, remedy=remedy)


def _experiments_using(index: SeriesIndex, chunk: str) -> list[str]:
    """Return the experiments that need a chunk for their own series or for that of their golden run."""
    inside = {number for number, (name, _) in enumerate(index.entry_places) if name == chunk}
    goldens = {key for key, number in index.entry_number_by_golden.items() if number in inside}
    return [
        name
        for name, number in index.entry_number_by_experiment.items()
        if number in inside or index.golden_by_experiment[name] in goldens
    ]
