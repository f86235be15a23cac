"""A run that several scenarios share is executed once and counted in each scenario. A check first compares
the scenarios."""

import csv
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common.hashing import canonical_json
from mutator.campaigns.chunks import PendingChunk, pending_chunks_of
from mutator.campaigns.plan import build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import CheckFailed
from mutator.execution.campaign_running import run_campaign
from mutator.execution.cluster import bundle
from mutator.execution.cluster.bundle import Bundle, load_run_inputs
from mutator.execution.cluster.piece_process import PieceRunner
from mutator.execution.cluster.piece_queue import PieceQueue
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.preflight.preflight_checks import run_checks
from mutator.store import plan_file
from mutator.store.records import record_as_json
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

CopyToycar = Callable[[Path], Workspace]
ALONE = "alone: [--alone]"
SHARED = "alone: {args: [--alone], same_in: [A, C]}"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def two_scenarios(toy: Workspace, changes: str) -> Workspace:
    """Return the toy with scenarios A and C, which differ only in the other car, and a campaign of the faults
    that remove this car."""
    scenarios = toy.library / "scenarios"
    (scenarios / "C.yaml").write_text((scenarios / "A.yaml").read_text().replace("0.8", "0.1"))
    edit(toy.library / "targets" / "toycar.yaml", ALONE, changes)
    campaign = toy.campaign("small")
    edit(campaign, "scenarios: [A]", "scenarios: [A, C]")
    edit(campaign, "  - {spec: sensor/lane/shifted, values: 1}\n  - spec: sensor/silence/no_data\n", "")
    return toy


@pytest.fixture(scope="module")
def executed() -> dict[str, list[str]]:
    return {"shared": [], "apart": []}


@pytest.fixture(scope="module")
def runs(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar, executed: dict[str, list[str]]
) -> tuple[Path, Path]:
    execute = ReferenceEngine.execute

    def counted(self: ReferenceEngine, job, scratch):  # type: ignore[no-untyped-def]
        executed[name].append(job.name)
        return execute(self, job, scratch)

    made = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ReferenceEngine, "execute", counted)
        for name, changes in (("shared", SHARED), ("apart", ALONE)):
            folder = tmp_path_factory.mktemp(name)
            toy = two_scenarios(copy_toycar(folder), changes)
            summary = run_campaign(toy, "small", folder / "run", engine="reference")
            assert (summary.exit_code, summary.done) == (0, 8)
            made.append(folder / "run")
    return made[0], made[1]


@pytest.mark.slow
def test_shared_runs_give_the_bytes_of_separate_runs(runs: tuple[Path, Path]) -> None:
    shared, apart = runs
    for name in ("results.csv", "results.parquet"):
        assert (shared / name).read_bytes() == (apart / name).read_bytes()
    with (shared / "results.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["variant"] == "nearer"]
    assert len(rows) == 8
    assert sum(row["scenario"] == "C" for row in rows) == 4


@pytest.mark.slow
def test_plan_and_folder_report_the_shared_runs(runs: tuple[Path, Path]) -> None:
    shared, apart = (load_plan(RunFolder.open(run)) for run in runs)
    assert (len(shared.experiments), shared.runs) == (8, 6)
    assert (len(apart.experiments), apart.runs) == (8, 8)
    assert shared.cost().cpu_s / shared.run_cpu_s < apart.cost().cpu_s / apart.run_cpu_s  # type: ignore[operator]
    assert RunFolder.open(runs[0]).head.runs == 6
    assert {e.id for e in shared.experiments} == {e.id for e in apart.experiments}


@pytest.mark.slow
def test_shared_runs_run_once(runs: tuple[Path, Path], executed: dict[str, list[str]]) -> None:
    ids = {e.id for e in load_plan(RunFolder.open(runs[0])).experiments}
    counts = {which: sum(name in ids for name in names) for which, names in executed.items()}
    assert counts == {"shared": 6, "apart": 8}


@pytest.mark.slow
def test_checks_compare_scenarios_declared_equal(runs: tuple[Path, Path]) -> None:
    checks = json.loads((runs[0] / "checks.json").read_text())["results"]
    assert [c["passed"] for c in checks if c["name"] == "same A+C+alone"] == [True]


@pytest.mark.slow
def test_one_experiment_of_a_shared_run_can_run_on_a_cluster(runs: tuple[Path, Path], tmp_path: Path) -> None:
    """A kill or a split of the work can leave a single experiment of a shared run. The worker then runs the
    golden run itself."""
    folder = RunFolder.open(runs[0])
    toy = Workspace(
        library=runs[0].parent / "toy" / "fault_library", templates=runs[0].parent / "toy" / "templates"
    )
    bundle.unpack_bundle(Bundle.pack_for_run(toy, folder, "reference").data, tmp_path)
    chunk = next(one for one in pending_chunks_of(folder, {}) if {"A", "C"} == set(_scenarios(folder, one)))
    left = replace(chunk, pending_positions=(_scenarios(folder, chunk).index("C"),))
    piece = PieceQueue(folder, [left], ()).take_piece("w")
    assert piece is not None and piece.golden_key == "A+alone"
    site = UnpackedBundle(tmp_path)
    runner = PieceRunner(site, load_run_inputs(site), "w", os.getpid())
    [record] = runner.run_piece(piece, lambda name: None).records
    [name] = piece.experiment_ids
    assert record == canonical_json(record_as_json(folder.records()[name])).encode()


def _scenarios(folder: RunFolder, chunk: PendingChunk) -> list[str]:
    lines = plan_file.read_chunk_lines(folder.path, folder.head.chunks[chunk.chunk_index])
    return [json.loads(line)["scenario"] for line in lines]


def test_different_scenarios_declared_equal_are_refused(toy: Workspace, tmp_path: Path) -> None:
    two_scenarios(toy, SHARED)
    edit(toy.library / "scenarios" / "C.yaml", "speed: 20", "speed: 21")
    folder = freeze_plan(build_plan(toy, "small"), tmp_path / "run", toy)
    with pytest.raises(CheckFailed, match=r"same A\+C\+alone: C differs from A"):
        run_checks(toy, folder)
