"""The worker's part of a run: a separate process runs the pieces of work and ends when it is no longer
needed."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from mutator.errors import MutatorError, PieceNoLongerNeeded
from mutator.execution.cluster import bundle
from mutator.execution.cluster.bundle import Bundle, load_run_inputs
from mutator.execution.cluster.golden_cache import GoldenRunCache
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceResult
from mutator.execution.cluster.piece_queue import PieceQueue
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.execution.cluster.worker_host import WorkerHost
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.session_opening import open_session
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


def children(host: WorkerHost) -> list[int]:
    """Return the ids of the processes that run the host's pieces."""
    words = str(host.folder).encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if words in (told := path.read_bytes()) and b"cluster.piece_process" in told:
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


@contextmanager
def attended(host: WorkerHost) -> Iterator[threading.Event]:
    unwanted = threading.Event()
    thread = threading.Thread(target=host.start_processes_on_request, args=(lambda: not unwanted.is_set(),))
    thread.start()
    try:
        yield unwanted
    finally:
        unwanted.set()
        thread.join()


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory, copy_toycar: object) -> tuple[Bundle, Piece]:
    """What a worker receives for the toy's small campaign: the bundle, and a piece of work."""
    folder = tmp_path_factory.mktemp("sent")
    toy: Workspace = copy_toycar(folder)  # type: ignore[operator]
    run = folder / "run"
    open_run = partial(open_or_freeze_run, toy, "small", run, Choices(), reviewed=False)
    with open_session(toy, open_run, run, workers=2, engine="fork") as session:
        session.prepare()
        board = PieceQueue(session.folder, session.pending, ())
        board.add_worker("w", 1)
        piece = board.take_piece("w")
        assert piece is not None
        return Bundle.pack_for_run(toy, session.folder, "fork"), piece


@pytest.fixture
def host(sent: tuple[Bundle, Piece], tmp_path: Path) -> WorkerHost:
    return WorkerHost.unpack_in(sent[0].data, str(tmp_path / "place"), "alpha")


def test_all_pieces_run_in_one_process_that_ends_with_the_host(
    host: WorkerHost, sent: tuple[Bundle, Piece]
) -> None:
    piece = sent[1]
    with attended(host):
        first = host.run_piece(piece.to_bytes(), lambda: True)
        [child] = children(host)
        second = host.run_piece(piece.to_bytes(), lambda: True)
        assert children(host) == [child]
    assert (first.ending, first.reason, len(first.records)) == (
        PieceEnding.FINISHED,
        "",
        len(piece.plan_lines),
    )
    assert second.records == first.records
    assert (
        first.needs_proof and first.patches and first.series and first.series_goldens == (piece.golden_key,)
    )
    assert children(host) == [] and not host.folder.exists()


def test_a_killed_process_is_reported_with_its_experiment(
    host: WorkerHost, sent: tuple[Bundle, Piece]
) -> None:
    with attended(host):
        killer = threading.Thread(target=lambda: os.kill(_first(host), signal.SIGKILL))
        killer.start()
        result = host.run_piece(sent[1].to_bytes(), lambda: True)
        killer.join()
        assert (result.ending, result.running_experiment) == (
            PieceEnding.PROCESS_DIED,
            sent[1].experiment_ids[0],
        )
        assert "killed by SIGKILL" in result.reason
        assert host.run_piece(sent[1].to_bytes(), lambda: True).ending is PieceEnding.FINISHED


def _first(host: WorkerHost) -> int:
    while not (found := children(host)):
        time.sleep(0.01)
    return found[0]


def test_if_the_process_does_not_start_no_piece_is_blamed(
    host: WorkerHost, sent: tuple[Bundle, Piece]
) -> None:
    (host.folder / "meta.json").unlink()
    with attended(host):
        result = host.run_piece(sent[1].to_bytes(), lambda: True)
    assert result.ending is PieceEnding.WORKER_UNFIT
    assert "meta.json" in result.reason


def test_the_process_of_a_cancelled_piece_ends(host: WorkerHost, sent: tuple[Bundle, Piece]) -> None:
    asked: list[float] = []

    def wanted() -> bool:
        asked.append(time.monotonic())
        return len(asked) < 4

    with attended(host):
        with pytest.raises(PieceNoLongerNeeded):
            host.run_piece(sent[1].to_bytes(), wanted)
        assert children(host) == []


def test_damaged_data_is_refused(sent: tuple[Bundle, Piece], host: WorkerHost, tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="damaged parcel"):
        WorkerHost.unpack_in(sent[0].data[:-1] + b"?", str(tmp_path / "other"), "alpha")
    assert not [*(tmp_path / "other").iterdir()]
    with pytest.raises(MutatorError, match="damaged parcel"):
        host.run_piece(sent[1].to_bytes()[:-1], lambda: True)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "mutator" / "goldens"


def run_once(sent: tuple[Bundle, Piece], place: Path) -> PieceResult:
    host = WorkerHost.unpack_in(sent[0].data, str(place), "alpha")
    with attended(host):
        return host.run_piece(sent[1].to_bytes(), lambda: True)


def written(entry: Path) -> int:
    return (entry / "log.npz").stat().st_mtime_ns


def test_hosts_of_a_machine_share_golden_runs(
    sent: tuple[Bundle, Piece], cache: Path, tmp_path: Path
) -> None:
    first = run_once(sent, tmp_path / "a")
    (entry,) = cache.iterdir()
    before = written(entry)
    assert run_once(sent, tmp_path / "b").records == first.records
    assert [*cache.iterdir()] == [entry] and written(entry) == before
    (entry / "log.npz").write_bytes(b"damaged")
    assert run_once(sent, tmp_path / "c").records == first.records
    assert [*cache.iterdir()] == [entry] and (entry / "log.npz").read_bytes() != b"damaged"


def test_a_cached_golden_run_must_match_the_campaign(
    sent: tuple[Bundle, Piece], cache: Path, tmp_path: Path
) -> None:
    run_once(sent, tmp_path / "a")
    bundle.unpack_bundle(sent[0].data, tmp_path / "site")
    site = UnpackedBundle(tmp_path / "site")
    manifest = load_run_inputs(site).manifest
    golden, known = site.golden_and_digest_by_key[sent[1].golden_key]
    to = tmp_path / "golden"
    assert GoldenRunCache(site, manifest).copy_golden(golden, known, to) and to.is_dir()
    assert not GoldenRunCache(site, manifest).copy_golden(golden, "0" * 64, to) and not to.exists()
    source = next((site.folder / "target").rglob("*.py"))
    source.write_text(source.read_text() + "# another\n")
    assert not GoldenRunCache(site, manifest).copy_golden(golden, known, to)
