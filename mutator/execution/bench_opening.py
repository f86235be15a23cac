"""Opens a bench in a run folder, which it owns until the end of a `with` block."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import remove_anything_at, remove_folder, write_atomic
from mutator._common.folder_locks import lock_run_folder
from mutator.campaigns.bench_files import bench_file_bytes, load_bench_file, naming_arguments
from mutator.campaigns.campaign_expansion import CampaignExpansion
from mutator.campaigns.plan_freezing import make_run_folder
from mutator.campaigns.plan_growth import APPENDED_FILES
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import accepted_version_differences, check_sources, check_version
from mutator.errors import MutatorError
from mutator.execution.bench import Bench
from mutator.execution.distributor_choice import Distributor
from mutator.execution.earlier_benches import EarlierBenches
from mutator.execution.watched_progress import writing_progress
from mutator.store import file_digests
from mutator.store.appended_files import undo_unfinished_growth
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace


@contextmanager
def opened_bench(
    workspace: Workspace,
    out: Path,
    values: Mapping[str, Any],
    *,
    workers: int = 1,
    engine: str | None = None,
    reuse: bool = True,
    distributor: Distributor | None = None,
    earlier: EarlierBenches | None = None,
    notify: ProgressCallback | None = None,
) -> Iterator[Bench]:
    """Lock the run folder `out`, and open the bench in it or begin one. The caller finishes what it plans.

    `values` are those of `bench_files.BenchModel`; `distributor` deals to a cluster, if not None. `earlier`
    has what other benches of this process leave to this one.
    """
    is_new = not out.exists()
    make_run_folder(out)
    with lock_run_folder(out):
        try:
            with writing_progress(out, notify) as progress:
                yield _build_bench(
                    workspace,
                    out,
                    values,
                    workers=workers,
                    engine=engine,
                    reuse=reuse,
                    distributor=distributor,
                    earlier=earlier,
                    notify=progress.notify,
                )
        finally:
            remove_anything_at(out / "work")
            if RunFolder.exists(out):
                undo_unfinished_growth(out, APPENDED_FILES)
                file_digests.add_segments_to_ledger(out)
            elif is_new:  # nothing was planned, so nothing is worth keeping
                remove_folder(out)


@contextmanager
def finishing(bench: Bench) -> Iterator[None]:
    """Finish a bench at the end of the block. After an error in it, the bench can be opened again."""
    try:
        yield
        bench.finish()
    except BaseException:
        bench.abandon()
        raise


def _build_bench(
    workspace: Workspace,
    out: Path,
    values: Mapping[str, Any],
    *,
    workers: int,
    engine: str | None,
    reuse: bool,
    distributor: Distributor | None,
    earlier: EarlierBenches | None,
    notify: ProgressCallback,
) -> Bench:
    file_bytes = bench_file_bytes(values)
    if RunFolder.exists(out):
        _check_existing(workspace, out, file_bytes)
    else:
        write_atomic(out / CAMPAIGN_FILE, file_bytes)
    with naming_arguments(out / CAMPAIGN_FILE, values):
        campaign = load_bench_file(out / CAMPAIGN_FILE)
        manifest = workspace.manifest(campaign.target)
        expansion = CampaignExpansion(workspace, campaign, manifest, campaign.seed, campaign.reading or "")
        canary = expansion.build_canary()
    return Bench(
        workspace,
        manifest,
        campaign,
        canary,
        out,
        workers=workers,
        engine=engine,
        reuse=reuse,
        distributor=distributor,
        earlier=earlier,
        notify=notify,
    )


def _check_existing(workspace: Workspace, out: Path, file_bytes: bytes) -> None:
    """Undo what a killed command left half done; MutatorError unless `out` is this bench's run folder."""
    undo_unfinished_growth(out, APPENDED_FILES)
    folder = RunFolder.open(out)
    if not folder.is_bench:
        raise MutatorError(
            f"holds a run of campaign '{folder.head.campaign}'",
            where=out,
            argument="out",
            expected="a bench's run folder, or a new or empty folder",
            remedy="choose another folder",
        )
    check_version(folder)
    if read_bounded(out / CAMPAIGN_FILE) != file_bytes:
        raise MutatorError(
            "this bench was opened with other arguments",
            where=out / CAMPAIGN_FILE,
            expected="the same target, canary, limits, seed and reading each time",
            remedy="give the same arguments, or choose another folder",
        )
    accepted_version_differences(folder)
    check_sources(out, folder.head.sources, RunInputs.of_run(workspace, folder).digest_by_source())
    file_digests.add_segments_to_ledger(out)
    remove_anything_at(folder.scratch_folder)
