"""Targets and runs that the fork engine leaves to the reference engine, and why."""

from dataclasses import replace

import pytest

from mutator.engines.engine_jobs import RunMode
from mutator.model import Status
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time

from ..fork_on_toy import LIMITS, Edit, Fork


def test_a_target_with_threads_is_not_forked(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/go.py",
        "class Drive:",
        "import threading\nwait = threading.Event().wait\n"
        "threading.Thread(target=wait, name='poll', daemon=True).start()\n"
        "class Drive:",
    )
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert (execution.mode, execution.status) == (RunMode.REFERENCE, Status.OK)
    assert execution.fallback_reason == (
        "once it is loaded, it has 2 threads, and only one can be forked: besides the main one, 'poll'"
    )


def test_a_target_with_pandas_is_forked(fork: Fork, edit: Edit) -> None:
    """pandas loads pyarrow, whose allocator would start a thread. The harness switches that thread off."""
    pytest.importorskip("pyarrow")
    fork.limits = replace(LIMITS, memory_mb=4096)
    edit("tree/toycar/go.py", "class Drive:", "import pandas\nimport pyarrow\n\n\nclass Drive:")
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert (execution.mode, execution.fallback_reason) == (RunMode.FORK, "")


def test_a_target_that_cannot_be_imported_is_not_forked(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/go.py",
        "class Drive:",
        "if __name__ != '__main__':\n    raise ValueError(3)\n\n\nclass Drive:",
    )
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert (execution.mode, execution.status) == (RunMode.REFERENCE, Status.OK)
    assert "cannot be loaded: ValueError: 3 (toycar/go.py:" in execution.fallback_reason


def test_the_stored_reason_is_printable(fork: Fork, edit: Edit) -> None:
    """A target can raise an error with any text."""
    edit(
        "tree/toycar/sensing.py",
        "        self.publish((gap",
        "        if gap > 45.0:\n            raise ValueError('\\udcff' * 1000)\n        self.publish((gap",
    )
    execution = fork.run(fork.job(trigger_at_time(5.9)))
    assert (execution.status, execution.mode) == (Status.CRASHED, RunMode.REFERENCE)
    assert (
        execution.fallback_reason.startswith(r"ended as crashed: ValueError: \udcff\udcff")
        and execution.fallback_reason.isprintable()
    )


@pytest.mark.slow
def test_a_target_that_behaves_differently_step_by_step_is_not_forked(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/go.py",
        "    drive = begin(arguments)\n",
        "    drive = begin(arguments)\n    drive.steps -= 1\n",
    )
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert execution.mode is RunMode.REFERENCE
    assert "its log.npz differs when it is driven step by step" in execution.fallback_reason


STARTED = {
    "a daemon": "threading.Thread(target=time.sleep, args=(100,), daemon=True).start()",
    "one that ends later": "threading.Thread(target=time.sleep, args=(0.3,)).start()",
    "a pool": "self.pool = ThreadPoolExecutor(2); self.pool.submit(abs, gap).result()",
    "a library's": "_thread.start_new_thread(time.sleep, (100,))",
}


@pytest.mark.parametrize("what", STARTED)
def test_a_thread_that_only_the_faulty_run_starts_does_not_waste_its_fork(
    fork: Fork, edit: Edit, what: str
) -> None:
    """A fresh interpreter would start it, too: the results have the same bytes."""
    edit(
        "tree/toycar/sensing.py",
        "        self.publish((gap",
        "        if gap > 45.0:\n            import _thread, threading, time\n"
        "            from concurrent.futures import ThreadPoolExecutor\n"
        f"            {STARTED[what]}\n        self.publish((gap",
    )
    job = fork.job(trigger_at_time(5.9))
    execution = fork.run(job)
    assert (execution.status, execution.mode, execution.fallback_reason) == (Status.OK, RunMode.FORK, "")
    again = fork.engine.reference.execute(job, fork.folder / "again")
    for name in ("log.npz", "said.json"):
        assert (execution.out / name).read_bytes() == (again.out / name).read_bytes()
    assert execution.probe_report == again.probe_report


@pytest.mark.slow
def test_a_thread_that_never_ends_costs_the_wall_limit_once(fork: Fork, edit: Edit) -> None:
    """A process ends only with its last thread, unless that is a daemon."""
    fork.limits = replace(LIMITS, wall_s=6)
    edit(
        "tree/toycar/sensing.py",
        "        self.publish((gap",
        "        if gap > 45.0:\n            import threading, time\n"
        "            threading.Thread(target=time.sleep, args=(100,)).start()\n        self.publish((gap",
    )
    execution = fork.run(fork.job(trigger_at_time(5.9)))
    assert (execution.status, execution.mode) == (Status.TIMEOUT, RunMode.FORK)


def test_a_golden_run_that_leaves_a_thread_is_not_forked(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/go.py",
        "        from zipfile import",
        "        import threading\n        threading.Thread(target=threading.Event().wait, name='poll',"
        " daemon=True).start()\n        from zipfile import",
    )
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert (execution.status, execution.mode) == (Status.OK, RunMode.REFERENCE)
    assert execution.fallback_reason.startswith("at its end it has 2 threads")
    assert "'poll'" in execution.fallback_reason


@pytest.mark.slow
def test_a_run_that_writes_into_its_tree_is_repeated_by_the_reference_engine(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/sensing.py",
        "        self.publish((gap",
        "        if gap > 45.0:\n            open(__file__, 'a').write('x')\n        self.publish((gap",
    )
    execution = fork.run(fork.job(trigger_at_time(5.9)))
    assert (execution.status, execution.mode) == (Status.HARNESS_ERROR, RunMode.REFERENCE)
    assert execution.fallback_reason == "it writes into its own tree"
    assert "toycar/sensing.py in the tree that ran" in execution.detail


def test_a_fault_in_a_generator_is_not_forked(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/sensing.py",
        "    def publish(self",
        "    def walk(self):\n        gap = 0.0\n        yield gap\n\n    def publish(self",
    )
    execution = fork.run(fork.job(trigger_at_time(2.0), function="Sensor.walk"))
    assert (execution.status, execution.mode) == (Status.OK, RunMode.REFERENCE)
    assert execution.fallback_reason == "Sensor.walk in toycar/sensing.py may be suspended between two steps"


@pytest.mark.slow
def test_without_a_stepwise_golden_run_nothing_is_forked(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/go.py",
        "    return Drive(case)",
        "    return Drive(case if __name__ == '__main__' else {})",
    )
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert (execution.mode, execution.status) == (RunMode.REFERENCE, Status.OK)
    assert execution.fallback_reason.startswith("its golden run cannot be driven step by step: KeyError: ")


EARLY = """
        self.steps = int(case["steps"])
        self.look()

    def look(self):
        world = self.world
        now = -1.0
        self.seen = now
"""


def test_a_target_that_observes_before_its_first_step_is_not_forked(fork: Fork, edit: Edit) -> None:
    """A fork would miss such observations."""
    edit("fault_library/targets/toycar.yaml", "function: Drive.step,", "function: Drive.look,")
    edit("tree/toycar/go.py", '\n        self.steps = int(case["steps"])\n', EARLY)
    for trigger in (always_trigger(armed_after_s=-2.0), trigger_at_time(2.0)):
        execution = fork.run(fork.job(trigger))
        assert (execution.mode, execution.status) == (RunMode.REFERENCE, Status.OK)
        assert execution.fallback_reason == "it observes before its first step"
