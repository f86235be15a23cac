"""Benches that are interrupted, killed, closed, or attacked by a mutant."""

import errno
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator import Bench, Experiment, MutatorError
from mutator.audit.run_audit import run_audit_checks
from mutator.campaigns import plan_growth
from mutator.execution import suspended_workers
from mutator.execution.bench_crew import BenchCrew
from mutator.model import Status
from mutator.preflight.bench_checks import BenchChecks
from mutator.preflight.preflight_check_runner import CheckRunner
from mutator.serve.run_states import RUNNING, state_of_run
from mutator.store.appended_files import AppendedFile
from mutator.store.run_head import HEAD
from mutator.workspace import Workspace

pytestmark = pytest.mark.usefixtures("kept_checks")


@contextmanager
def opened(toycar: Workspace, out: Path, **arguments: Any) -> Iterator[Bench]:
    with mutator.open_bench(toycar, out, campaign="small", **arguments) as bench:
        yield bench


def longer(bench: Bench, *values: float, scenario: str = "A") -> list[Experiment]:
    return [bench.build_experiment("sensor/distance/longer", scenario, 1.0, value=value) for value in values]


def check_whole(out: Path, toycar: Workspace, experiment_count: int) -> None:
    """The run folder is intact, finished, and has these experiments."""
    run = mutator.load_run(out)
    assert run.folder.head.experiments == experiment_count
    assert run.seal
    assert [d for check in run_audit_checks(run.folder, toycar) for d in check.differences] == []


def killed(command: Callable[[], None]) -> None:
    """Run a command in a process that ends with its first SIGKILL."""
    if not (pid := os.fork()):
        try:
            command()
        finally:
            os._exit(9)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL


def kill_this_process(*arguments: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def at_file(name: str, act: Callable[[], object]) -> Callable[[AppendedFile], None]:
    """`write_added`, with an act in place of writing the file of this name."""
    write_added = AppendedFile.write_added

    def write(file: AppendedFile) -> None:
        if file.name.endswith(name):
            act()
        write_added(file)

    return write


def test_the_seal_does_not_depend_on_borders_of_batches_with_other_variants(
    toycar: Workspace, tmp_path: Path
) -> None:
    """A batch that adds a variant, but no golden run, changes the seal as in one batch with both."""
    with opened(toycar, tmp_path / "one") as bench:
        asked = [*longer(bench, 5), bench.build_experiment("sensor/lane/shifted", "A", 1.0, value=1.5)]
        bench.run(asked)
    with opened(toycar, tmp_path / "many") as bench:
        for experiment in asked:
            bench.run([experiment])
    one, many = (mutator.load_run(tmp_path / name) for name in ("one", "many"))
    assert one.seal == many.seal is not None


def test_a_kill_in_the_first_checks_leaves_a_folder_to_open(toycar: Workspace, tmp_path: Path) -> None:
    """Before the first plan there is only scratch work, which the next opening removes."""

    def command() -> None:
        BenchChecks.check_goldens = kill_this_process  # type: ignore[assignment, method-assign]
        with opened(toycar, tmp_path / "b") as bench:
            bench.run(longer(bench, 5))

    killed(command)
    assert (tmp_path / "b" / "work").is_dir() and (tmp_path / "b" / "progress.json").is_file()
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
    check_whole(tmp_path / "b", toycar, 1)


def test_a_kill_in_the_first_plan_leaves_no_line_of_it(toycar: Workspace, tmp_path: Path) -> None:
    """What a killed command wrote of a plan without run.json is no part of the next plan."""

    def command() -> None:
        AppendedFile.write_added = at_file("plan.csv", kill_this_process)  # type: ignore[method-assign]
        with opened(toycar, tmp_path / "b") as bench:
            bench.run(longer(bench, 5))

    killed(command)
    assert (tmp_path / "b" / "plan" / "experiments.jsonl").stat().st_size
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 40))
    check_whole(tmp_path / "b", toycar, 1)


@pytest.mark.parametrize("is_first", [True, False])
def test_a_full_disk_leaves_the_bench_as_it_was(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_first: bool
) -> None:
    """A batch that cannot be written is not planned; the open bench takes it once there is space."""

    def fail() -> None:
        raise OSError(errno.ENOSPC, "full")

    with opened(toycar, tmp_path / "b") as bench:
        if not is_first:
            bench.run(longer(bench, 5))
        with monkeypatch.context() as patch:
            patch.setattr(AppendedFile, "write_added", at_file("plan.csv", fail))
            with pytest.raises(OSError, match="full"):
                bench.run(longer(bench, 40))
        assert len(bench.run(longer(bench, 40, 5))) == 2
    check_whole(tmp_path / "b", toycar, 2)


def test_a_full_disk_ends_a_block_without_damage(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even if the batch cannot be taken back at once, the folder can be opened again."""

    def fail(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, "full")

    with monkeypatch.context() as patch, pytest.raises(OSError), opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
        patch.setattr(plan_growth, "write_atomic", fail)
        patch.setattr("mutator.execution.bench.undo_unfinished_growth", fail)
        with pytest.raises(OSError):
            bench.run(longer(bench, 40))
        with pytest.raises(MutatorError, match="the plan could not be written"):
            bench.run(longer(bench, 40))
        fail()
    with opened(toycar, tmp_path / "b") as bench:
        assert len(bench.run(longer(bench, 5, 40))) == 2
    check_whole(tmp_path / "b", toycar, 2)


def test_an_interruption_while_the_plan_is_written_comes_after_it(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C then leaves a whole batch, and a bench to use."""
    interrupt = at_file("plan.csv", lambda: os.kill(os.getpid(), signal.SIGINT))
    with opened(toycar, tmp_path / "b") as bench:
        with monkeypatch.context() as patch:
            patch.setattr(AppendedFile, "write_added", interrupt)
            with pytest.raises(KeyboardInterrupt):
                bench.run(longer(bench, 40))
        assert [experiment.id for experiment in bench.pending] == [longer(bench, 40)[0].id]
        assert len(bench.run(longer(bench, 40))) == 1
    check_whole(tmp_path / "b", toycar, 1)


def test_an_interruption_of_the_checks_loses_no_golden_run(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A golden run from the cache is stored by the next call, although this one was interrupted."""
    with opened(toycar, tmp_path / "cached") as bench:
        bench.run(longer(bench, 5))
    text = (toycar.library / "scenarios" / "B.yaml").read_text()
    (toycar.library / "scenarios" / "new.yaml").write_text(f"{text}# not in the cache\n")
    with opened(toycar, tmp_path / "b") as bench:
        with monkeypatch.context() as patch:
            patch.setattr(CheckRunner, "run_all", lambda *_: os.kill(os.getpid(), signal.SIGINT))
            with pytest.raises(KeyboardInterrupt):
                bench.run([*longer(bench, 5), *longer(bench, 5, scenario="new")])
        assert len(bench.run(longer(bench, 5))) == 1
    check_whole(tmp_path / "b", toycar, 1)


def test_a_closed_bench_refuses_calls(toycar: Workspace, tmp_path: Path) -> None:
    """After its block, a bench can neither run nor prove anything, and its seal stays."""
    with opened(toycar, tmp_path / "b") as bench:
        asked = longer(bench, 5)
        bench.run(asked)
    for call in (lambda: bench.run(asked), bench.prove):
        with pytest.raises(MutatorError, match="this bench is closed"):
            call()
    check_whole(tmp_path / "b", toycar, 1)


@pytest.mark.parametrize("is_failed", [False, True])
def test_the_end_of_the_block_waits_for_a_call_of_another_thread(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_failed: bool
) -> None:
    """The call gets its records, or fails if the block does; the folder is whole in both cases."""
    write, began, ends = plan_growth.write_atomic, threading.Event(), list[Any]()

    def write_slowly(path: Path, data: bytes) -> None:
        began.set()
        time.sleep(0.5)
        write(path, data)

    def call(bench: Bench) -> None:
        try:
            ends.append(bench.run(longer(bench, 40)))
        except MutatorError as err:
            ends.append(err)

    try:
        with opened(toycar, tmp_path / "b") as bench:
            bench.run(longer(bench, 5))
            monkeypatch.setattr(plan_growth, "write_atomic", write_slowly)
            thread = threading.Thread(target=call, args=[bench])
            thread.start()
            assert began.wait(60)
            if is_failed:
                raise ZeroDivisionError
    except ZeroDivisionError:
        assert "the bench was closed" in str(ends[0])
        with opened(toycar, tmp_path / "b") as bench:
            bench.run(bench.pending)
    else:
        assert len(ends[0]) == 1
    thread.join()
    check_whole(tmp_path / "b", toycar, 2)


def test_workers_outlive_the_thread_that_first_needs_them(toycar: Workspace, tmp_path: Path) -> None:
    """Each cell or request may have a thread of its own; the workers stay."""
    with opened(toycar, tmp_path / "b") as bench:
        thread = threading.Thread(target=lambda: bench.run(longer(bench, 5)))
        thread.start()
        thread.join()
        [worker] = bench._opened._crew._workers
        with pytest.raises(subprocess.TimeoutExpired):
            worker.process.wait(0.5)
        assert len(bench.run(longer(bench, 40))) == 1
        assert bench._opened._crew._workers == [worker]


def test_a_changed_run_json_is_restored_before_the_next_batch(toycar: Workspace, tmp_path: Path) -> None:
    """A mutant that edits run.json never has its edit signed with the next batch."""
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
        path = tmp_path / "b" / HEAD
        before = path.read_bytes()
        head = json.loads(before)
        head["stretches"][0]["packages"]["numpy"] = "0.0.1"
        path.write_text(json.dumps(head))
        with pytest.raises(MutatorError, match=r"run\.json.*was changed by a mutant"):
            bench.run(longer(bench, 40))
        assert path.read_bytes() == before
        bench.run(longer(bench, 40))
    check_whole(tmp_path / "b", toycar, 2)


def test_batches_in_flight_change_neither_plan_nor_seal(toycar: Workspace, tmp_path: Path) -> None:
    """Each submitted experiment has its record, once for each time; plan and seal are as in one batch, in the
    order of submission. A refused batch, a call of `run` and an open flight at the end of the block lose
    nothing.
    """
    with opened(toycar, tmp_path / "one") as bench:
        asked = [*longer(bench, 5, 12.5, 40), *longer(bench, 5, 12.5, 40, scenario="B")]
        records = {record.experiment_id: record for record in bench.run(asked)}
    with opened(toycar, tmp_path / "flight", workers=2) as bench:
        bench.submit(asked[:2], "first")
        bench.submit(asked[1:4], "second")
        with pytest.raises(MutatorError, match="a list of experiments"):
            bench.submit("text")  # type: ignore[arg-type]
        arrived = []
        for record in bench.results():
            arrived.append(record)
            if len(arrived) == 1:
                assert bench.run(asked[4:5], "third") == [records[asked[4].id]]
        assert sorted(r.experiment_id for r in arrived) == sorted(e.id for e in [*asked[:2], *asked[1:4]])
        assert all(records[record.experiment_id] == record for record in arrived)
        assert list(bench.results()) == []
        bench.submit(asked[5:], "fourth")
    one, flight = (mutator.load_run(tmp_path / name, workspace=toycar) for name in ("one", "flight"))
    assert one.seal == flight.seal is not None
    assert dict(one.records) == dict(flight.records)
    lines = (tmp_path / "flight" / "plan" / "batches.jsonl").read_text().splitlines()
    assert [json.loads(line)["reason"] for line in lines] == ["first", "second", "third", "fourth"]
    check_whole(tmp_path / "flight", toycar, 6)


@pytest.mark.parametrize("is_interrupted", [False, True])
def test_what_was_in_flight_is_pending_after_a_failure(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_interrupted: bool
) -> None:
    """A worker that dies and Ctrl-C end all batches in flight; what is pending can be submitted again."""
    monkeypatch.setattr(suspended_workers, "_CHECK_INTERVAL_S", 600.0)  # it stays stopped
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
        [worker] = bench._opened._crew._workers
        os.kill(worker.process.pid, signal.SIGSTOP)  # type: ignore[union-attr]
        bench.submit(longer(bench, 40))
        bench.submit(longer(bench, 12.5))
        if is_interrupted:
            threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        else:
            os.kill(worker.process.pid, signal.SIGKILL)  # type: ignore[union-attr]
        with pytest.raises(KeyboardInterrupt if is_interrupted else MutatorError):
            list(bench.results())
        assert list(bench.results()) == []
        assert [experiment.id for experiment in bench.pending] == [e.id for e in longer(bench, 40, 12.5)]
        bench.submit(bench.pending)
        assert len(list(bench.results())) == 2
    check_whole(tmp_path / "b", toycar, 3)


def test_a_stopped_worker_goes_on(toycar: Workspace, tmp_path: Path) -> None:
    """A mutant can stop its worker: the bench does not wait for ever, and what ran is asked for again."""
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
        [worker] = bench._opened._crew._workers
        os.kill(worker.process.pid, signal.SIGSTOP)  # type: ignore[union-attr]
        end = threading.Timer(60.0, worker.kill)  # of a test that fails
        end.start()
        [record] = bench.run(longer(bench, 40))
        end.cancel()
        assert (record.status, record.detail) == (
            Status.HARNESS_ERROR,
            "its worker was stopped while it ran",
        )
        assert [record.status for record in bench.run(longer(bench, 40))] == [Status.OK]
    check_whole(tmp_path / "b", toycar, 2)


def test_a_second_interruption_leaves_the_bench_usable(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while the first one ends the workers comes after that, and nothing stays in flight."""
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
        crew = bench._opened._crew

        def kill_interrupted() -> None:
            os.kill(os.getpid(), signal.SIGINT)
            BenchCrew.kill(crew)

        with monkeypatch.context() as patch:
            patch.setattr(crew, "receive", lambda: os.kill(os.getpid(), signal.SIGINT))
            patch.setattr(crew, "kill", kill_interrupted)
            with pytest.raises(KeyboardInterrupt):
                bench.run(longer(bench, 40))
        assert not bench._opened._awaited.running and not crew._workers
        assert len(bench.run(longer(bench, 40))) == 1
    check_whole(tmp_path / "b", toycar, 2)


def test_watchers_see_how_far_an_open_bench_is(toycar: Workspace, tmp_path: Path) -> None:
    """Like a campaign, it has a progress while it is open, and none afterwards."""
    with opened(toycar, tmp_path / "b") as bench:
        bench.run(longer(bench, 5))
        state = state_of_run(bench.load().folder)
        assert state.state == RUNNING and state.progress is not None
        assert (state.progress.done, state.progress.total) == (1, 1)
        assert state.progress.detail == "waits for the next batch"
    assert state_of_run(mutator.load_run(tmp_path / "b").folder).progress is None
