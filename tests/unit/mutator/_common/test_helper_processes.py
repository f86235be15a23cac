"""Work that several processes share."""

import os
import signal
from itertools import islice

import pytest

from mutator._common.helper_processes import computing_in_background, map_in_processes
from mutator.errors import MutatorError


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_results_keep_the_order_of_the_inputs(processes: int) -> None:
    for count in (0, 1, 7):
        assert list(map_in_processes(lambda n: n * n, range(count), processes)) == [
            n * n for n in range(count)
        ]


def test_the_work_is_done_in_other_processes() -> None:
    found = list(map_in_processes(lambda _: os.getpid(), range(6), 2))
    assert found == found[:2] * 3 and len({*found, os.getpid()}) == 3


def test_errors_of_other_processes_are_raised() -> None:
    def fails(n: int) -> int:
        if n == 3:
            raise MutatorError("three", where="here", line=3)
        return n

    found = map_in_processes(fails, range(9), 2)
    assert list(islice(found, 3)) == [0, 1, 2]
    with pytest.raises(MutatorError, match="here:3: three"):
        next(found)
    with pytest.raises(MutatorError, match="was killed"):
        list(map_in_processes(lambda _: os.kill(os.getpid(), signal.SIGKILL), range(4), 2))


def test_no_process_keeps_running_after_the_consumer_stops() -> None:
    found = map_in_processes(lambda n: (os.getpid(), b"x" * 1_000_000), range(50), 2)
    pids = [next(found)[0], next(found)[0]]
    found.close()  # type: ignore[attr-defined]
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


@pytest.mark.parametrize("processes", [1, 2])
def test_beside_uses_another_process_if_two_are_allowed(processes: int) -> None:
    with computing_in_background(os.getpid, processes) as found:
        assert (found() == os.getpid()) is (processes == 1)

    def fails() -> None:
        raise MutatorError("there")

    with computing_in_background(fails, processes) as found, pytest.raises(MutatorError, match="there"):
        found()
    with pytest.raises(ValueError, match="here"), computing_in_background(fails, processes):
        raise ValueError("here")
