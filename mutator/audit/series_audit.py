"""Audit series: check that their files are unchanged. No result depends on them."""

from collections.abc import Iterator, Set

import numpy as np

from mutator._common.confined_files import path_below
from mutator.errors import MutatorError
from mutator.outcomes.hazards_and_metrics import load_channels
from mutator.outcomes.series_sampling import Sampler
from mutator.store import plan_file
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.run_folder import RunFolder
from mutator.store.series_check import check_deviations
from mutator.store.series_folder import (
    INDEX_NAME,
    SeriesFolder,
    SeriesIndex,
    check_same_run,
    load_kept_series,
    repair_remedy,
    rerun_command,
)
from mutator.store.series_format import Series, decode_series
from mutator.store.series_packing import list_worker_files
from mutator.targets.manifest import TargetManifest

_ROUNDING = 1e-5  # relative; values have six digits


def series(folder: RunFolder, manifest: TargetManifest | None = None) -> tuple[int, Iterator[MutatorError]]:
    """Return the number of series files, and their problems: damaged files, missing files that others need,
    series of other runs than the records, and, with a `manifest`, series that differ from the golden runs.
    """
    there = SeriesFolder(folder.path)
    return sum(path.is_file() for path in there.path.rglob("*")), _problems(folder, there, manifest)


def _problems(
    folder: RunFolder, there: SeriesFolder, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    run = folder.path
    yield from _packed(folder, there, manifest)
    yield from _kept(folder, there, manifest)
    for path in list_worker_files(run):
        if read_blocks(path).is_damaged:
            yield MutatorError(
                "damaged blocks",
                where=path,
                expected="series as a worker appended them",
                remedy=repair_remedy(run),
            )


def _kept(folder: RunFolder, there: SeriesFolder, manifest: TargetManifest | None) -> Iterator[MutatorError]:
    names, records = there.kept_ids(), folder.records()
    planned = {one.id: one for one in plan_file.load_experiments(folder.path)} if names and manifest else {}
    for name in names:
        path = there.kept_path(name)
        try:
            golden, faulty = load_kept_series(path)
            if (record := records.get(name)) is not None:
                check_same_run(faulty.facts, record, path)
                check_deviations(golden, faulty, record, path)
            if name in planned and (run := folder.golden_folder_of(planned[name])).is_dir():
                assert manifest is not None
                if not _are_same(golden, Sampler(manifest, load_channels(manifest, run)).golden):
                    raise MutatorError(
                        "differs", where=path, expected=f"the series of {run.relative_to(folder.path)}"
                    )
        except MutatorError as err:
            yield _told(err, err.got, f"{rerun_command(folder.path, name)} rebuilds it")


def _packed(
    folder: RunFolder, there: SeriesFolder, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    run, path = folder.path, there.path / f"{INDEX_NAME}.js"
    try:
        index = there.index
    except MutatorError as err:
        yield err
        return
    if index is None:
        # if segments are left, the run was killed before it wrote the index
        if any(there.path.glob("*.js")) and not list_worker_files(run):
            what = "the index of the chunks beside it"
            yield MutatorError("missing", where=path, expected=what, remedy=repair_remedy(run))
        return
    if index.plan != folder.head.plan:
        got, expected = f"series of plan {index.plan[:16]}", folder.head.plan[:16]
        yield MutatorError(got, where=path, expected=expected, remedy=repair_remedy(run))
        return
    damaged = set()
    for name, _ in index.chunks:
        try:
            there.read_chunk(name)
        except MutatorError as err:
            damaged.add(name)
            ids = [one for one in _users(index, name) if not there.kept_path(one).is_file()]
            more = f" and {len(ids) - 1} more" if len(ids) > 1 else ""
            got = f"{err.got}; the series of {ids[0]}{more} cannot be read" if ids else err.got
            yield _told(err, got, repair_remedy(run))

    yield from _of_other_runs(folder, there, index, damaged)
    yield from _of_other_goldens(folder, there, index, manifest)


def _of_other_runs(
    folder: RunFolder, there: SeriesFolder, index: SeriesIndex, damaged: Set[str]
) -> Iterator[MutatorError]:
    """Series that do not belong to the records. Those in `damaged` chunks are reported with their chunk."""
    records = folder.records()
    for name, number in index.experiment_entries.items():
        if (record := records.get(name)) is None:  # lost; its series is not shown until it runs again
            continue
        chunk, golden_chunk = (
            index.entry_places[one][0]
            for one in (number, index.golden_entries[index.golden_by_experiment[name]])
        )
        if damaged & {chunk, golden_chunk}:
            continue
        path = path_below(there.path, f"{chunk}.js")
        try:
            golden, faulty = there.load_packed_series(index, name)
            check_same_run(faulty.facts, record)
            check_deviations(golden, faulty, record)
        except MutatorError as err:
            remedy = repair_remedy(folder.path)
            yield MutatorError(f"{name}: {err.got}", where=path, expected=err.expected, remedy=remedy)


def _of_other_goldens(
    folder: RunFolder, there: SeriesFolder, index: SeriesIndex, manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    for key, number in index.golden_entries.items() if manifest else ():
        assert manifest is not None
        path = path_below(there.path, f"{index.entry_places[number][0]}.js")
        try:
            stored = decode_series(there.read_entry(number))
            golden = Sampler(
                manifest, load_channels(manifest, path_below(folder.path, f"golden/{key}"))
            ).golden
        except MutatorError:  # reported elsewhere
            continue
        if not _are_same(stored, golden):
            expected = f"the series of golden/{key}"
            yield MutatorError("differs", where=path, expected=expected, remedy=repair_remedy(folder.path))


def _are_same(stored: Series, golden: Series) -> bool:
    """Whether two series have the same channels, times and values, up to the rounding of older versions."""
    channels, wanted = (
        [(one["name"], one.get("own_times")) for one in series.facts["channels"]]
        for series in (stored, golden)
    )
    if (
        channels != wanted
        or stored.t.tobytes() != golden.t.tobytes()
        or stored.sample_every != golden.sample_every
    ):
        return False
    rows = zip(stored.channel_values, golden.channel_values, strict=True)
    return all(np.allclose(one, other, rtol=_ROUNDING, equal_nan=True) for one, other in rows)


def _told(err: MutatorError, got: str, remedy: str) -> MutatorError:
    return MutatorError(got, where=err.where, expected=err.expected, remedy=remedy)


def _users(index: SeriesIndex, chunk: str) -> list[str]:
    """Return the experiments that need a chunk for their own series or for that of their golden run."""
    inside = {number for number, (name, _) in enumerate(index.entry_places) if name == chunk}
    goldens = {key for key, number in index.golden_entries.items() if number in inside}
    return [
        name
        for name, number in index.experiment_entries.items()
        if number in inside or index.golden_by_experiment[name] in goldens
    ]
