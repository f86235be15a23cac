"""Measure campaigns on a cluster.

`python benchmarks/cluster.py [overhead] [intake] [ends] [--campaign NAME]`. By default, it measures all
three. `overhead` is the CPU time of all processes for a campaign on two Dask workers of this machine and on
two local workers, alternately and with warm caches. `intake` is the number of results a second that the
command accepts from two workers whose runs take no time. `ends` simulates 64 workers that run 10,000
experiments with a campaign's durations, and compares the time at which the last worker ends with the mean.
"""

import argparse
import ctypes
import heapq
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import mean, median
from types import SimpleNamespace
from typing import Any

from mutator.campaigns.chunks import PendingChunk, pending_chunks_of
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import append_session_environment
from mutator.execution.cluster import cluster_distributor, worker_roster, worker_tasks
from mutator.execution.cluster import result_intake as intakes
from mutator.execution.cluster.bundle import Bundle
from mutator.execution.cluster.cluster_choice import parse_cluster_choice
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceResult
from mutator.execution.cluster.piece_queue import PieceQueue
from mutator.execution.written_files import WrittenFiles
from mutator.store.checksummed_blocks import block_bytes
from mutator.store.packed_patches import pack_patches
from mutator.store.run_folder import RunFolder
from mutator.store.series_packing import EXPERIMENT_BLOCK
from mutator.store.session_environments import SessionEnvironment
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
WORKERS, EXPERIMENTS = 64, 10_000
GOLDEN_S = 1.2  # of CPU for a worker's golden run
RECORD = {  # a record of the most frequent kind in a campaign
    "activation": {"count": 1200, "first": 4.11, "last": 16.1},
    "alerts": [["fcw", 9.81]],
    "detail": "",
    "hazards": [["H1", 12.3]],
    "max_dev": [["brake", 0.31], ["gas", 0.22], ["steer_torque", 0.0021]],
    "outcome": "hazard",
    "status": "ok",
    "t_manifest": 4.12,
    "trace_digest": "0" * 64,
    "tree": "0" * 64,
    "metrics": [[f"metric_{i}", 1.2345678] for i in range(12)],
    "left": [[f"channel_{i}", 4.12 + i, 0.5] for i in range(12)],
}
PATCH_BYTES, SERIES_BYTES = 1_900, 5_900
PR_SET_CHILD_SUBREAPER = 36  # of prctl: orphans become children of this process


def overhead(campaign: str, rounds: int) -> None:
    took: dict[str, list[float]] = {"local": [], "cluster": []}
    options = {"local": ["-n", "2"], "cluster": ["-n", "2", "--cluster", "local:2"]}
    with tempfile.TemporaryDirectory() as place:
        env = os.environ | {"XDG_CACHE_HOME": f"{place}/cache"}
        for number in range(rounds + 1):  # the first fills the caches
            for name in options if number % 2 == 0 else reversed(options):
                command = [sys.executable, "-m", "mutator", "run", campaign, "--out", f"{place}/run"]
                command += ["--no-stills", "--no-reuse", *options[name]]
                used = cpu_s(command, env)
                shutil.rmtree(f"{place}/run")
                if number:
                    took[name].append(used)
                    print(f"{name:8} {took[name][-1]:8.1f} s CPU", flush=True)
    local, cluster = median(took["local"]), median(took["cluster"])
    print(f"overhead, {campaign}: {local:.1f} s of CPU with local workers, {cluster:.1f} s with Dask's")
    print(f"ratio {cluster / local:.3f}")


def cpu_s(command: list[str], env: dict[str, str]) -> float:
    """Return the CPU time (s) of a command and all its descendants, including those that outlive their
    parent.
    """
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, cwd=ROOT, env=env, capture_output=True, check=True)
    with suppress(ChildProcessError):  # no child is left
        while True:
            os.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@contextmanager
def planned(name: str = "paper") -> Iterator[tuple[Workspace, RunFolder, tuple[PendingChunk, ...]]]:
    """Yield a frozen plan, by default that of the paper's 11,280 experiments."""
    workspace = Workspace.find(ROOT)
    with tempfile.TemporaryDirectory() as place:
        folder = freeze_plan(build_plan(workspace, name), Path(place) / "run", workspace)
        yield workspace, folder, pending_chunks_of(folder, {})


# These functions replace those of a real worker and take no time. Dask sends them to the workers.


def machine_facts(packages: Any) -> dict[str, Any]:
    return dict.fromkeys(("mutator", "python", "platform", "cpu"), "") | {
        "host": "here",
        "blas": [],
        "packages": {},
    }


def deliver_bundle(*given: Any) -> None:
    return None


def attend_run(run: str) -> None:
    from distributed import secede

    secede()
    time.sleep(3600)


def leave_run(run: str) -> None:
    return None


def run_piece(run: str, data: bytes) -> bytes:
    piece = Piece.from_bytes(data)
    line = json.dumps({"experiment_id": "@"} | RECORD, separators=(",", ":")).encode()
    timing = b'{"cpu_s":0.3,"engine":"fork","experiment_id":"@","host":"here","wall_s":0.3,"worker":"w"}'
    patch, series = random.Random(1).randbytes(PATCH_BYTES // 4) * 4, random.Random(2).randbytes(SERIES_BYTES)
    return PieceResult(
        number=piece.number,
        ending=PieceEnding.FINISHED,
        seconds=0.0005 * len(piece.plan_lines),
        needs_proof=True,
        records=tuple(line.replace(b"@", name.encode()) for name in piece.plan_lines),
        timings=tuple(timing.replace(b"@", name.encode()) for name in piece.plan_lines),
        patches=pack_patches((name, patch) for name in piece.plan_lines),
        series=b"".join(
            block_bytes(EXPERIMENT_BLOCK, f"{name} {piece.golden_key}", series) for name in piece.plan_lines
        ),
    ).to_bytes()


def intake() -> None:
    for fake in (machine_facts, deliver_bundle, attend_run, leave_run, run_piece):
        setattr(worker_tasks, fake.__name__, fake)
    with planned() as (workspace, folder, left):
        folder = append_session_environment(folder, SessionEnvironment(python="", packages={}, platform=""))
        session: Any = SimpleNamespace(
            workspace=workspace,
            folder=folder,
            manifest=workspace.manifest(folder.head.target),
            pending=left,
            proof=(),
            written=WrittenFiles(),
            engine="fork",
            accept_versions=True,
            worker_prefix="0001-",
            note_machine=lambda machine: None,
            problem="",
            interrupted=False,
            workers_note="",
        )
        Bundle.pack_for_run = classmethod(lambda cls, *given: cls(b"", ""))  # type: ignore[assignment, method-assign]
        worker_roster.WorkerRoster.reason_to_refuse = lambda self, facts: ""  # type: ignore[method-assign]
        times: list[float] = []
        take = intakes.ResultIntake.append_result

        def timed(self: Any, piece: Piece, result: PieceResult) -> None:
            take(self, piece, result)
            times.append(time.monotonic())
            counts.append(len(piece.plan_lines))

        counts: list[int] = []
        intakes.ResultIntake.append_result = timed  # type: ignore[method-assign]
        before = time.process_time()
        cluster_distributor.ClusterDistributor(parse_cluster_choice("local:2")).run(session)
        used = time.process_time() - before
        if session.problem:
            raise SystemExit(session.problem)
        total = sum(counts)
        per_s = sum(counts[1:]) / (times[-1] - times[0])
        print(f"intake: {total:,} results in {len(counts)} pieces: {per_s:,.0f} a second,")
        print(f"{1e6 * used / total:.0f} us of the command's CPU each")


def ends(seed: int) -> None:
    with planned() as (_, folder, left):
        some, count = [], 0
        for one in left:
            if count < EXPERIMENTS:
                some.append(one)
                count += len(one.pending_positions)
        ended, busy, pieces = simulated(folder, some, random.Random(seed))
    last, middle = max(ended), mean(ended)
    print(
        f"ends: {count:,} experiments, {WORKERS} workers, {pieces} pieces; last worker ends at {last:.1f} s,"
    )
    after, at_work = 100 * (last / middle - 1), 100 * busy / (last * WORKERS)
    print(f"{after:.1f} % after the mean of all workers; workers are busy {at_work:.1f} % of the time")


def simulated(
    folder: RunFolder, left: Sequence[PendingChunk], draw: random.Random
) -> tuple[list[float], float, int]:
    """Return when each worker finished, their total working time and the number of pieces."""
    now = [0.0]
    board = PieceQueue(folder, left, (), now=lambda: now[0])
    names = [f"w{number}" for number in range(WORKERS)]
    for name in names:
        board.add_worker(name, 1)
    goldens: dict[str, str] = {}
    ended, busy, pieces = dict.fromkeys(names, 0.0), 0.0, 0
    events: list[tuple[float, int, str, Piece | None, float]] = [
        (0.0, number, name, None, 0.0) for number, name in enumerate(names)
    ]
    while not board.is_empty:
        now[0], _, name, piece, took = heapq.heappop(events)
        if piece is not None:
            board.finish_piece(piece, name, took)
            ended[name] = now[0]
        got = board.take_piece(name)
        if got is None:
            heapq.heappush(events, (now[0] + 0.1, pieces, name, None, 0.0))
            continue
        took = sum(draw.lognormvariate(-1.2, 0.7) for _ in range(got.run_count))
        took += GOLDEN_S if goldens.get(name) != got.golden_key else 0.0
        goldens[name] = got.golden_key
        busy, pieces = busy + took, pieces + 1
        heapq.heappush(events, (now[0] + took, pieces + WORKERS, name, got, took))
    return list(ended.values()), busy, pieces


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", nargs="*", default=["ends", "intake", "overhead"])
    parser.add_argument("--campaign", default="paper_sample")
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    for what in options.what:
        if what == "overhead":
            overhead(options.campaign, options.rounds)
        elif what == "intake":
            intake()
        else:
            ends(seed=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
